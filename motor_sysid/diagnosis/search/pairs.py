"""Two effects at once, where a climb by single ones has ended at something that is none of them.

What explains most alone may be neither of two that are missing, and lead to a place from which no
exchange of one effect leads back.  The best pairs of the first scores are fitted as they are; one
that leaves nothing but noise is where a second climb begins.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from motor_sysid.diagnosis.candidates.score import Scored, Scores
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.gates import is_impossible, is_told
from motor_sysid.diagnosis.search.prune import pruned
from motor_sysid.diagnosis.search.refit import settled_pair, try_pair
from motor_sysid.diagnosis.search.rounds import WORKERS
from motor_sysid.diagnosis.search.rung import Rung
from motor_sysid.diagnosis.search.step_ahead import stands
from motor_sysid.diagnosis.search.trial import Level

TWO = 2
"""Effects that are added at once."""

MOSTLY = 0.5
"""Share of what is beyond noise that a pair must explain after a rough fit, to be fitted in full:
the truth leaves next to nothing of it."""

Pair = tuple[Scored, Scored]


def best_twosome(
    base: Rung, scores: Scores, bench: Bench, tell: Callable[[str], None]
) -> tuple[Rung, float] | None:
    """Return the fit of the pair that explains most, and its gain in BIC, if it is the truth.

    It must leave nothing but noise, lower the held-out error of `base` steadily and by much, and
    neither of the two may be nothing, impossible, in the place of a parameter of the motor, or
    superfluous beside the other.
    """
    level = Level.of(base, bench, scores.weighting)
    enough = MOSTLY * (level.cost - level.rows)
    tell(f'beginning again with two effects at once: trying {len(scores.pairs)} pairs')

    def fitted(pair: Pair) -> tuple[Rung, float, Pair]:
        rough, gain = try_pair(pair, level, bench)
        if not gain > enough:
            return rough, gain, pair
        return (*settled_pair(rough, level, bench), pair)

    with ThreadPoolExecutor(WORKERS) as pool:
        fits = list(pool.map(fitted, scores.pairs))
    rung, gain, pair = max(fits, key=lambda one: one[1], default=(base, 0.0, ()))
    excess = (level.cost - gain) / level.rows
    if gain < bench.threshold or not stands(rung, base, excess):
        return None
    keys, duration = [one.variant.effect.key for one in pair], bench.scales.duration
    model = rung.model
    there = all(is_told(model, key) and not is_impossible(model, key, duration) for key in keys)
    if not there:
        return None
    slim = pruned(rung, bench, dict.fromkeys(keys, gain), tell, last=True)
    return (slim, gain) if len(slim.model.effects) == len(model.effects) else None
