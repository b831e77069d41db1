"""Results of a benchmark as tables: what the terminal, the page and the JSON file show."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from motor_sysid.benchmark.equivalences import invisible, same_as
from motor_sysid.benchmark.outcome import Outcome, Result
from motor_sysid.benchmark.peers import PEERS
from motor_sysid.benchmark.statistics import Share
from motor_sysid.benchmark.targets import covered, named_as_well, rates, visible

SCHEMA = 'motor_sysid/benchmark/2'

BASE = ('R', 'L', 'k_t', 'J', 'b')
GOOD = (Outcome.RIGHT,)
BAD = (Outcome.WRONG, Outcome.EXTRA, Outcome.FALSE_ALARM, Outcome.FAILED)


@dataclass(frozen=True)
class Cell:
    """One cell: text, whether it is good or bad news, and how strongly to show that (0 to 1)."""

    text: str
    tone: str = ''
    weight: float = 0.0


@dataclass(frozen=True)
class Table:
    """A table with a heading and a sentence on how to read it.

    Attributes
    ----------
    title, note:
        Heading and sentence.
    head:
        Column titles.
    rows:
        Cells, one for each column.
    wide:
        Whether it has too many columns for a terminal.
    """

    title: str
    note: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    wide: bool = False


def tables(results: Sequence[Result]) -> list[Table]:
    """Return every table of the report; those without rows are left out."""
    known = [r for r in results if r.known]
    absent = [r for r in results if not r.known]
    every = [
        rate_table(results),
        effect_table(results),
        peer_table(results),
        time_table(results),
        outcome_table(results),
        leakage_table(results),
        coverage_table(results),
        confusion_table('Confusion matrix', known),
        confusion_table('Confusion matrix where the catalogue lacks the effect', absent),
        trouble_table(results),
    ]
    return [table for table in every if table.rows]


def rate_table(results: Sequence[Result]) -> Table:
    """Return the rates with limits and goals."""
    rows = []
    for rate in rates(results):
        tone = {'pass': 'good', 'fail': 'bad'}.get(rate.verdict[:4], '')
        goal = str(rate.goal) if rate.goal else ''
        rows.append(
            (*_cells(rate.title, *_parts(rate.share), goal), Cell(rate.verdict, tone, 0.35))
        )
    return Table(
        'Rates',
        'Limits are 95 % (Wilson). "not certain": the limits reach over the goal, more runs would '
        'tell.',
        ('what', 'cases', 'share', '95 % limits', 'goal', 'verdict'),
        tuple(rows),
    )


def peer_table(results: Sequence[Result]) -> Table:
    """Return the diagnosis beside its peers, on the cases on which all of them ran."""
    names = [name for name in PEERS if any(name in (r.peers or {}) for r in results)]
    shared = [r for r in results if names and all(name in (r.peers or {}) for name in names)]
    rows = [_peer_row('this diagnosis', shared, lambda r: r.named, lambda r: r.seconds)]
    for key in names:
        rows.append(
            _peer_row(
                PEERS[key].title,
                shared,
                lambda r, key=key: (r.peers or {})[key].effects,  # type: ignore[misc]
                lambda r, key=key: (r.peers or {})[key].seconds,  # type: ignore[misc]
            )
        )
    return Table(
        'Peers on the same records',
        'Exact set: all that is hidden and nothing else. The peers cannot say "unknown", so a '
        'withheld effect counts as a false name whenever they name anything. Effects that no '
        'record shows are left out.',
        ('method', 'false alarm, complete', 'one effect: first', 'one effect: exact set',
         'two effects: exact set', 'withheld: names something', 'median time'),
        tuple(rows) if names and shared else (),
    )  # fmt: skip


def effect_table(results: Sequence[Result]) -> Table:
    """Return how often each single effect is named, of the cases that show it."""
    single = [r for r in results if r.category == 'single' and r.known]
    rows = []
    for effect in sorted({r.effects[0] for r in single if not _unseen(r)}):
        mine = [r for r in single if r.effects[0] == effect]
        seen = [r for r in mine if visible(r)]
        exact = sum(r.outcome is Outcome.RIGHT for r in seen)
        special = sum(r.outcome is not Outcome.RIGHT and named_as_well(r) for r in seen)
        wrong = sum(r.outcome in BAD for r in mine)
        errors = [_median(seen, which) for which in ('before', 'after', 'reference')]
        rows.append((
            *_cells(effect, str(len(mine)), str(len(seen))),
            _count(exact, len(seen), 'good'), _count(special, len(seen), 'soft'),
            _count(wrong, len(mine), 'bad'), Cell(' → '.join(errors) if seen else ''),
        ))  # fmt: skip
    return Table(
        'Single effects',
        'Of all sizes. Visible: the held-out error of the linear model is 2 % or more above that '
        'of the true structure. Named: exactly, of the visible ones; or as its special case that '
        'runs as well. Wrong: of all. Error: median held-out error of the linear model → with '
        'what was named → of the true structure, visible ones.',
        ('hidden', 'cases', 'visible', 'named', 'special case', 'wrong', 'error'),
        tuple(rows),
        wide=True,
    )


def time_table(results: Sequence[Result]) -> Table:
    """Return how long the diagnosis takes."""
    rows = []
    for category in dict.fromkeys(r.category for r in results):
        times = [r.seconds for r in results if r.category == category]
        middle, most = np.percentile(times, (50, 90))
        rows.append(
            _cells(category, str(len(times)), *(f'{t:.1f} s' for t in (middle, most, max(times))))
        )
    return Table(
        'Time of a diagnosis',
        'Two training records and one to validate, on the machine and beside the work of the run.',
        ('cases', 'number', 'median', '90 % within', 'longest'),
        tuple(rows),
    )


def outcome_table(results: Sequence[Result]) -> Table:
    """Return one row for each hidden effect and size, with outcomes as columns."""
    seen = [o for o in Outcome if any(r.outcome is o for r in results)]
    rows = []
    for name, size, mine in _groups(results):
        counts = Counter(r.outcome for r in mine)
        ratios = [r.after / r.reference for r in mine if r.after and r.reference]
        ratio = f'{np.median(ratios):.3f}' if ratios else ''
        cells = [_count(counts[o], len(mine), _tone(o)) for o in seen]
        rows.append((*_cells(name, size), *cells, Cell(ratio)))
    return Table(
        'Outcomes',
        'Number of cases. Error ratio: held-out error of the last model over that of the true '
        'structure fitted to the same data, median.',
        ('hidden', 'size', *(o.value for o in seen), 'error ratio'),
        tuple(rows),
        wide=True,
    )


def leakage_table(results: Sequence[Result]) -> Table:
    """Return the errors of the base parameters before and after adding what is missing."""
    rows = []
    for name, size, mine in _groups(results):
        right = [r for r in mine if r.outcome in (Outcome.RIGHT, Outcome.AMBIGUOUS) and r.known]
        if not right:
            continue
        cells = []
        for parameter in BASE:
            before, after, best = (
                _median_error(right, parameter, which)
                for which in ('base_before', 'base_after', 'base_reference')
            )
            cells.append(f'{before} → {after} ({best})')
        rows.append(_cells(name, size, str(len(right)), *cells))
    return Table(
        'Base parameters',
        'Median |error| of the linear model → after adding what was named (true structure fitted '
        'to the same data), where the verdict is right.',
        ('hidden', 'size', 'cases', *BASE),
        tuple(rows),
        wide=True,
    )


def coverage_table(results: Sequence[Result]) -> Table:
    """Return how often stated 95 % intervals hold the truth, by effect parameter."""
    mine, best = _sigmas(results, 'sigmas'), _sigmas(results, 'reference_sigmas')
    rows = [
        _cells(
            name, *_parts(covered(mine.get(name, []))), *_parts(covered(best.get(name, [])))[1:]
        )
        for name in sorted({*mine, *best})
    ]
    return Table(
        'Intervals of effect parameters',
        'How often the stated 95 % interval holds the true value, in models with exactly the true '
        'effects; right: the true structure fitted to the same data.',
        ('parameter', 'cases', 'share', '95 % limits', 'true structure', '95 % limits'),
        tuple(rows),
        wide=True,
    )


def confusion_table(title: str, results: Sequence[Result]) -> Table:
    """Return truth and size in rows, answers in columns."""
    answers = sorted({r.answer for r in results}, key=_column_order)
    rows = []
    for name, size, mine in _groups(results):
        cells = []
        for answer in answers:
            same = [r for r in mine if r.answer == answer]
            tone = Counter(_tone(r.outcome) for r in same).most_common(1)[0][0] if same else ''
            cells.append(_count(len(same), len(mine), tone))
        rows.append((*_cells(name, size), *cells))
    return Table(
        title,
        'Rows: what is hidden. Columns: what was said. Green is right, red is a wrong name, an '
        'extra effect, a false alarm or a failure.',
        ('hidden', 'size', *answers),
        tuple(rows),
        wide=True,
    )


def trouble_table(results: Sequence[Result]) -> Table:
    """Return the cases to look into: whatever is bad, by name."""
    bad = [r for r in results if r.outcome in BAD or r.error]
    return Table(
        'Cases to look into',
        'Each runs again alone with `motor-sysid benchmark diagnosis --case NAME`.',
        ('case', 'outcome', 'said', 'motor', 'error'),
        tuple(_cells(r.case, r.outcome.value, r.answer, r.motor, r.error) for r in bad),
        wide=True,
    )


def as_dict(results: Sequence[Result]) -> dict[str, object]:
    """Return everything as plain values for JSON."""
    return {
        'schema': SCHEMA,
        'rates': [
            {
                'what': rate.title,
                'count': rate.share.count,
                'total': rate.share.total,
                'limits': rate.share.limits,
                'goal': str(rate.goal) if rate.goal else None,
                'verdict': rate.verdict or None,
            }
            for rate in rates(results)
        ],
        'confusion': [
            {'hidden': hidden, 'size': size, 'known': known, 'said': said, 'count': count}
            for (hidden, size, known, said), count in sorted(
                Counter((r.title, r.size, r.known, r.answer) for r in results).items()
            )
        ],
        'cases': [r.as_dict() for r in results],
    }


def _groups(results: Sequence[Result]) -> list[tuple[str, str, list[Result]]]:
    """Return name, size and cases of everything that was hidden, single effects first."""
    keys = sorted({(len(r.effects), not r.known, r.title, r.size) for r in results})
    found = []
    for count, absent, title, size in keys:
        mine = [r for r in results if (r.title, r.size, not r.known) == (title, size, absent)]
        name = f'{title} (not in the catalogue)' if absent else title
        found.append((name, f'{100 * size:g} %' if count else '', mine))
    return found


def _column_order(answer: str) -> tuple[int, str]:
    special = ('complete', 'ambiguous', 'unknown effect', 'insufficient data', 'failed')
    if answer in special:
        return 2 + special.index(answer), ''
    return answer.count('+') > 0, answer


def _count(count: int, total: int, tone: str) -> Cell:
    return Cell(str(count), tone, count / total) if count else Cell('')


def _tone(outcome: Outcome) -> str:
    return 'good' if outcome in GOOD else 'bad' if outcome in BAD else 'soft'


def _cells(*texts: str) -> tuple[Cell, ...]:
    return tuple(Cell(text) for text in texts)


def _parts(share: Share) -> tuple[str, str, str]:
    """Return number of cases, share and limits as text."""
    if not share.total:
        return '0', '', ''
    low, high = share.limits
    return str(share.total), f'{100 * share.value:.1f} %', f'{100 * low:.1f} to {100 * high:.1f} %'


def _median(results: Sequence[Result], which: str) -> str:
    values = [getattr(r, which) for r in results if getattr(r, which)]
    return f'{np.median(values):.3g} %' if values else '-'


def _median_error(results: Sequence[Result], parameter: str, which: str) -> str:
    errors = [abs(getattr(r, which)[parameter]) for r in results if getattr(r, which)]
    return _percent(float(np.median(errors))) if errors else '-'


def _percent(value: float) -> str:
    """Return a share in percent with two digits, in full where it is large."""
    return f'{100 * value:.0f} %' if value > 0.995 else f'{100 * value:.2g} %'


def _sigmas(results: Sequence[Result], which: str) -> dict[str, list[float]]:
    found: dict[str, list[float]] = {}
    for result in results:
        values: Mapping[str, float] = getattr(result, which) or {}
        for name, value in values.items():
            found.setdefault(name, []).append(value)
    return found


def _unseen(r: Result) -> bool:
    return len(r.effects) == 1 and invisible(r.effects[0])


def _peer_row(
    title: str,
    results: Sequence[Result],
    named: Callable[[Result], tuple[str, ...]],
    seconds: Callable[[Result], float],
) -> tuple[Cell, ...]:
    def share(category: str, happened: Callable[[Result], bool]) -> str:
        mine = [r for r in results if r.category == category and not _unseen(r)]
        return Share(sum(map(happened, mine)), len(mine)).brief

    def first(r: Result) -> bool:
        return bool(named(r)) and any(named(r)[0] in one for one in same_as(frozenset(r.effects)))

    def exact(r: Result) -> bool:
        return frozenset(named(r)) in same_as(frozenset(r.effects))

    return _cells(
        title,
        share('complete', lambda r: bool(named(r))),
        share('single', first),
        share('single', exact),
        share('pair', exact),
        share('withheld', lambda r: bool(named(r))),
        f'{np.median([seconds(r) for r in results]):.1f} s' if results else '',
    )
