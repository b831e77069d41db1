"""Two effects at once, where a climb by single ones has ended at something that is none of them.

What explains most alone may be neither of two that are missing, and lead to a place from which no
exchange of one effect leads back.  The best pairs of the first scores are fitted as they are; one
that leaves nothing but noise is where a second climb begins.  One of a pair may have but shown the
other a way out of a valley, and goes again.
"""

from collections.abc import Callable

from motor_sysid.diagnosis.candidates.score import Scored, Scores
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.gates import is_told
from motor_sysid.diagnosis.search.prune import pruned
from motor_sysid.diagnosis.search.refit import settled_pair, try_pair
from motor_sysid.diagnosis.search.rung import Rung
from motor_sysid.diagnosis.search.sense import is_nonsense
from motor_sysid.diagnosis.search.step_ahead import stands
from motor_sysid.diagnosis.search.trial import judged, Ladder, Level, Trial
from motor_sysid.threads import in_threads

TWO = 2
"""Effects that are added at once."""

MOSTLY = 0.5
"""Share of what is beyond noise that a pair must explain after a rough fit, to be fitted in full:
the truth leaves next to nothing of it."""

Pair = tuple[Scored, Scored]


def beginning(ladder: Ladder, bench: Bench) -> tuple[Ladder, tuple[Rung, list[Trial]]]:
    """Return where a second climb begins: at the last fit with no effect but what signals show.

    With it go the fits before it.
    """
    start = set(ladder[0][0].model.effects)
    shown = [
        all(key in start or bench.shows(key) for key in rung.model.effects) for rung, _ in ladder
    ]
    last = shown.index(False) - 1 if False in shown else len(ladder) - 1
    return ladder[:last], ladder[last]


def best_twosome(
    base: Rung, scores: Scores, bench: Bench, tell: Callable[[str], None]
) -> tuple[Rung, float, list[Trial]] | None:
    """Return the fit of the pair that explains most, if it is the truth.

    It must leave nothing but noise, lower the held-out error of `base` steadily and by much, and
    no effect of it may be nothing, impossible, or in the place of a parameter of the motor.  One
    that is superfluous beside the other goes.

    Returns
    -------
    The fit, its gain in BIC, and what is left of a pair alone, if one is, as a trial on `base`.
    """
    level = Level.of(base, bench, scores.weighting)
    enough = MOSTLY * (level.cost - level.rows)
    tell(f'beginning again with two effects at once: trying {len(scores.pairs)} pairs')

    def fitted(pair: Pair) -> tuple[Rung, float, Pair]:
        rough, gain = try_pair(pair, level, bench)
        if not gain > enough:
            return rough, gain, pair
        return (*settled_pair(rough, level, bench), pair)

    fits = in_threads(fitted, scores.pairs)
    rung, gain, pair = max(fits, key=lambda one: one[1], default=(base, 0.0, ()))
    if gain < bench.threshold or not stands(rung, base, (level.cost - gain) / level.rows):
        return None
    starts = {one.variant.effect.key: one for one in pair}
    slim = pruned(rung, bench, dict.fromkeys(starts, gain), tell, last=True)
    model, duration = slim.model, bench.scales.duration
    own = [key for key in model.effects if key not in base.model.effects]
    there = all(is_told(model, key) and not is_nonsense(model, key, duration) for key in own)
    if not own or not there:
        return None
    alone = [starts[key] for key in own if key in starts] if len(own) < TWO else []
    return slim, level.gain(slim, bench), [judged(one, slim, level, bench) for one in alone]
