"""Results of a benchmark as figures, tables and a confusion matrix."""

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from motor_sysid.benchmark.outcome import Outcome, Result
from motor_sysid.benchmark.statistics import Share

SCHEMA = 'motor_sysid/benchmark/1'
VISIBLE = 1.02
"""An effect counts as visible if it raises the held-out error of the base model by 2 %."""

_HONEST = (Outcome.RIGHT, Outcome.AMBIGUOUS)


def shares(results: Sequence[Result]) -> dict[str, Share]:
    """Return the shares that the diagnosis is judged by, by sentence."""
    hidden = [r for r in results if r.effects and r.known]
    one = [r for r in hidden if len(r.effects) == 1]
    table = {
        'complete model: something is said to be missing': _share(
            [r for r in results if not r.effects], lambda r: r.outcome is not Outcome.RIGHT
        )
    }
    for size in sorted({r.size for r in one}):
        sized = [r for r in one if r.size == size]
        table[f'one effect, size {100 * size:g} %: named first'] = _share(sized, _first)
        table[f'one effect, size {100 * size:g} %: named first, where it is visible'] = _share(
            [r for r in sized if r.before > VISIBLE], _first
        )
    table['one effect: exactly that, or ambiguous with it'] = _share(
        one, lambda r: r.outcome in _HONEST
    )
    table['any effect of the catalogue: a wrong name'] = _share(hidden, _wrong)
    table['two effects: exactly both'] = _share(
        [r for r in hidden if len(r.effects) == 2], lambda r: r.outcome is Outcome.RIGHT
    )
    absent = [r for r in results if r.effects and not r.known]
    table['effect that the catalogue lacks: a wrong neighbour named'] = _share(absent, _wrong)
    table['effect that the catalogue lacks: said to be unknown'] = _share(
        absent, lambda r: r.outcome is Outcome.RIGHT
    )
    table['it raised an error'] = _share(list(results), lambda r: r.outcome is Outcome.FAILED)
    return table


def report(results: Sequence[Result]) -> str:
    """Return the whole report as Markdown."""
    parts = [
        '# Benchmark of the diagnosis',
        f'{len(results)} cases. Shares with 95 % confidence limits (Wilson).',
        _table(('what', 'share'), [(name, str(s)) for name, s in shares(results).items()]),
        '## By hidden effect',
        by_effect(results),
        '## What was hidden, and what was said',
        confusion(results),
        _speed(results),
    ]
    return '\n\n'.join(parts) + '\n'


def by_effect(results: Sequence[Result]) -> str:
    """Return a Markdown table: one row for each hidden effect and size, outcomes as columns."""
    seen = [o for o in Outcome if any(r.outcome is o for r in results)]
    groups = sorted({(r.withheld, r.title, r.size) for r in results})
    rows = []
    for withheld, title, size in groups:
        mine = [r for r in results if (r.withheld, r.title, r.size) == (withheld, title, size)]
        counts = Counter(r.outcome for r in mine)
        name = f'{title} (not in the catalogue)' if withheld else title
        ratio = float(np.median([r.over_floor for r in mine]))
        rows.append(
            (name, f'{100 * size:g} %', *(str(counts[o] or '') for o in seen), f'{ratio:.2f}')
        )
    return _table(('hidden', 'size', *(o.value for o in seen), 'error / sensor noise'), rows)


def confusion(results: Sequence[Result]) -> str:
    """Return the confusion matrix as a Markdown table: truth in rows, answers in columns."""
    matrix = Counter((r.title, r.answer) for r in results)
    answers = sorted({r.answer for r in results}, key=lambda a: (a.islower(), a))
    titles = sorted({r.title for r in results})
    rows = [(t, *(str(matrix[t, a] or '') for a in answers)) for t in titles]
    return _table(('hidden', *answers), rows)


def as_dict(results: Sequence[Result]) -> dict[str, object]:
    """Return everything as plain values for JSON."""
    return {
        'schema': SCHEMA,
        'shares': {
            name: {'count': s.count, 'total': s.total, 'limits': s.limits}
            for name, s in shares(results).items()
        },
        'confusion': [
            {'hidden': hidden, 'said': said, 'count': count}
            for (hidden, said), count in sorted(
                Counter((r.title, r.answer) for r in results).items()
            )
        ],
        'cases': [r.as_dict() for r in results],
    }


def _first(r: Result) -> bool:
    return bool(r.named) and r.named[0] in r.effects


def _wrong(r: Result) -> bool:
    return r.outcome in (Outcome.WRONG, Outcome.EXTRA)


def _share(results: Sequence[Result], happened: Callable[[Result], bool]) -> Share:
    return Share(sum(map(happened, results)), len(results))


def _speed(results: Sequence[Result]) -> str:
    seconds = [r.seconds for r in results]
    return (
        f'Time of a diagnosis: median {np.median(seconds):.1f} s, '
        f'95 % below {np.quantile(seconds, 0.95):.1f} s, longest {max(seconds):.1f} s.'
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ['---'] * len(head), *rows]
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)
