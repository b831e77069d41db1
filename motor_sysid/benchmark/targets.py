"""The rates that the diagnosis is judged by, each with its goal and whether it is met.

A goal counts as met for certain when the 95 % limits lie on its good side.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
import math

from motor_sysid.benchmark.equivalences import invisible, same_as, special_cases
from motor_sysid.benchmark.outcome import Outcome, Result
from motor_sysid.benchmark.statistics import Share

VISIBLE = 1.02
"""An effect counts as visible if the held-out error of the base model is at least 2 % above that
of the true structure."""

CLOSE = 1.05
INTERVAL = 1.959964
"""Half width of a 95 % interval in sigmas."""


@dataclass(frozen=True)
class Goal:
    """Bounds that a share should keep, 0 to 1."""

    lowest: float = 0.0
    highest: float = 1.0

    def __str__(self) -> str:
        """Return it in percent."""
        if self.lowest > 0 and self.highest < 1:
            return f'{100 * self.lowest:g} to {100 * self.highest:g} %'
        if self.lowest > 0:
            return f'at least {100 * self.lowest:g} %'
        return f'at most {100 * self.highest:g} %'

    def verdict(self, share: Share) -> str:
        """Say whether a share keeps it."""
        room = [1 - self.lowest] * (self.lowest > 0) + [self.highest] * (self.highest < 1)
        if share.total * min(room) < 1:
            return 'not enough runs'
        low, high = share.limits
        inside = self.lowest <= share.value <= self.highest
        if inside:
            return 'pass' if self.lowest <= low and high <= self.highest else 'pass, not certain'
        return 'fail, not certain' if low <= self.highest and high >= self.lowest else 'fail'


@dataclass(frozen=True)
class Rate:
    """A share, what it is a share of, and the goal for it if there is one."""

    title: str
    share: Share
    goal: Goal | None = None

    @property
    def verdict(self) -> str:
        """Whether the goal is met; empty without one."""
        return self.goal.verdict(self.share) if self.goal else ''


def rates(results: Sequence[Result]) -> list[Rate]:
    """Return every rate."""
    complete = [r for r in results if r.category == 'complete']
    return [
        Rate(
            'complete model: something is said to be missing',
            _share(complete, lambda r: r.outcome is Outcome.FALSE_ALARM),
            Goal(highest=0.01),
        ),
        *_single(results),
        *_names(results),
        *_numbers(results),
        Rate('any case: it raised, crashed or ran out of time',
             _share(results, lambda r: r.outcome is Outcome.FAILED)),
        Rate('any case: half of the held-out data were fitted as well',
             _share(results, lambda r: r.lent)),
    ]  # fmt: skip


def named_first(result: Result) -> bool:
    """Whether what it named first is hidden, or the same as something hidden."""
    return bool(result.named) and any(
        result.named[0] in one for one in same_as(frozenset(result.effects))
    )


def named_as_well(result: Result) -> bool:
    """Whether what it named first is hidden, or its special case and the rest invisible.

    Bristles that hardly bend are Stribeck friction: that runs as well as the true structure.
    """
    if named_first(result) or not (result.named and result.after and result.reference):
        return named_first(result)
    special = result.named[0] in special_cases(frozenset(result.effects))
    return special and result.after <= VISIBLE * result.reference


def ranked_first(result: Result) -> bool:
    """Whether the strongest candidate of the first round is hidden, named or not."""
    return any(result.first in one for one in same_as(frozenset(result.effects)))


def visible(result: Result) -> bool:
    """Whether the true structure runs clearly better than the base model."""
    best = result.reference or result.floor
    return result.before is not None and best is not None and result.before > VISIBLE * best


def both_visible(result: Result) -> bool:
    """Whether the true structure runs clearly better than it does without one of its effects."""
    less, best = result.lacking, result.reference
    return less is not None and best is not None and less > VISIBLE * best


def runs_as_well(result: Result) -> bool:
    """Whether it named all that is hidden, or a part or special case that runs as well."""
    if result.outcome is not Outcome.PART or not (result.after and result.reference):
        return result.outcome is Outcome.RIGHT
    return result.after <= VISIBLE * result.reference


def covered(sigmas: Iterable[float]) -> Share:
    """Return how many errors lie within the stated 95 % interval."""
    inside = [abs(z) <= INTERVAL for z in sigmas]
    return Share(sum(inside), len(inside))


def _single(results: Sequence[Result]) -> list[Rate]:
    one = [r for r in results if r.category == 'single' and r.known]
    seen = [r for r in one if not invisible(r.effects[0])]
    found = []
    for size, goal in ((0.01, None), (0.03, Goal(lowest=0.97)), (0.10, Goal(lowest=0.995))):
        sized = [r for r in seen if math.isclose(r.size, size)]
        name = f'one effect, {100 * size:g} %'
        found += [
            Rate(f'{name}: named first', _share(sized, named_first), goal),
            Rate(f'{name}: named first, where visible',
                 _share([r for r in sized if visible(r)], named_first)),
            Rate(f'{name}: named first, or its special case that runs as well, where visible',
                 _share([r for r in sized if visible(r)], named_as_well)),
            Rate(f'{name}: strongest candidate', _share(sized, ranked_first)),
        ]  # fmt: skip
    unseen = [r for r in one if invisible(r.effects[0])]
    return [
        *found,
        Rate('one effect: exact set', _share(seen, _right)),
        Rate('one effect that no record shows: said to be complete', _share(unseen, _right)),
    ]


def _names(results: Sequence[Result]) -> list[Rate]:
    hidden = [r for r in results if r.effects and r.known]
    absent = [r for r in results if r.effects and not r.known]
    two = [r for r in hidden if r.category == 'pair']
    return [
        Rate('effects in the catalogue: a wrong name', _share(hidden, _wrong),
             Goal(highest=0.005)),
        Rate('effects in the catalogue: ambiguous, truth among them',
             _share(hidden, lambda r: r.outcome is Outcome.AMBIGUOUS)),
        Rate('two effects: exact set', _share(two, _right), Goal(lowest=0.9)),
        Rate('two effects: exact set, where both are visible',
             _share([r for r in two if both_visible(r)], _right)),
        Rate('two effects: exact set, or a part or special case that runs as well, both visible',
             _share([r for r in two if both_visible(r)], runs_as_well)),
        Rate('two effects: exact set, or ambiguous with both',
             _share(two, lambda r: r.outcome in (Outcome.RIGHT, Outcome.AMBIGUOUS))),
        Rate('effect not in the catalogue: a wrong neighbour named', _share(absent, _wrong),
             Goal(highest=0.1)),
        Rate('effect not in the catalogue: said to be unknown', _share(absent, _right)),
        Rate('effect not in the catalogue: said to be unknown, where visible',
             _share([r for r in absent if visible(r)], _right)),
    ]  # fmt: skip


def _numbers(results: Sequence[Result]) -> list[Rate]:
    added = [r for r in results if r.known and r.named and r.after and r.reference]
    return [
        Rate('after adding: held-out error within 5 % of the true structure',
             _share(added, _close), Goal(lowest=0.95)),
        Rate('effect parameters within their 95 % interval',
             covered(_all(r.sigmas for r in results)), Goal(0.93, 0.97)),
        Rate('the same, true structure fitted to the same data',
             covered(_all(r.reference_sigmas for r in results))),
    ]  # fmt: skip


def _all(each: Iterable[object]) -> list[float]:
    return [z for one in each if isinstance(one, dict) for z in one.values()]


def _right(r: Result) -> bool:
    return r.outcome is Outcome.RIGHT


def _wrong(r: Result) -> bool:
    return r.outcome in (Outcome.WRONG, Outcome.EXTRA)


def _close(r: Result) -> bool:
    return r.after is not None and r.reference is not None and r.after <= CLOSE * r.reference


def _share(results: Sequence[Result], happened: Callable[[Result], bool]) -> Share:
    return Share(sum(map(happened, results)), len(results))
