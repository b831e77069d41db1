"""Two effects at once, where a climb by single ones has ended at something that is none of them.

What explains most alone may be neither of two that are missing, and lead to a place from which no
exchange of one effect leads back.  The best pairs of the first scores are fitted as they are; one
that leaves nothing but noise is where a second climb begins.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from motor_sysid.diagnosis.gate import (
    combined_error,
    feeds,
    gone,
    is_told,
    MIN_FURTHER_GAIN_PERCENT,
    MIN_STEADY,
    steadiness,
)
from motor_sysid.diagnosis.refit import settled_pair, try_pair
from motor_sysid.diagnosis.rounds import WORKERS
from motor_sysid.diagnosis.rung import Rung, vanished
from motor_sysid.diagnosis.score import Scored, Scores
from motor_sysid.diagnosis.setup import Bench
from motor_sysid.diagnosis.trial import Level
from motor_sysid.diagnosis.verdict import AT_NOISE

TWO = 2
"""Effects that are added at once."""

Pair = tuple[Scored, Scored]


def best_twosome(
    base: Rung, scores: Scores, bench: Bench, tell: Callable[[str], None]
) -> tuple[Rung, float] | None:
    """Return the fit of the pair that explains most, and its gain in BIC, if it is the truth.

    It must leave nothing but noise, lower the held-out error of `base` steadily and by much, and
    neither of the two may be nothing, impossible, or in the place of a parameter of the motor.
    """
    level = Level.of(base, bench, scores.weighting)
    tell(f'beginning again with two effects at once: trying {len(scores.pairs)} pairs')

    def fitted(pair: Pair) -> tuple[Rung, float, Pair]:
        rough, _ = try_pair(pair, level, bench)
        return (*settled_pair(rough, level, bench), pair)

    with ThreadPoolExecutor(WORKERS) as pool:
        fits = list(pool.map(fitted, scores.pairs))
    rung, gain, pair = max(fits, key=lambda one: one[1], default=(base, 0.0, None))
    if pair is None or level.cost - gain > AT_NOISE * level.rows:
        return None
    if gain < bench.threshold or not _stands(rung, base):
        return None
    keys = [one.variant.effect.key for one in pair]
    if not all(_is_there(rung, key, bench) for key in keys):
        return None
    return rung, gain


def _stands(rung: Rung, base: Rung) -> bool:
    """Whether a fit lowers the held-out error enough and steadily, and no parameter goes."""
    gain = 100 * (1 - combined_error(rung.held, base.held))
    steady = steadiness(base.held, rung.held) > MIN_STEADY
    return gain > MIN_FURTHER_GAIN_PERCENT and steady and not gone(rung.model, base.model)


def _is_there(rung: Rung, key: str, bench: Bench) -> bool:
    """Whether an effect of a fit is told from nothing, and possible."""
    impossible = vanished(rung.model, key) or feeds(rung.model, key, bench.scales.duration)
    return is_told(rung.model, key) and not impossible
