"""From which variants of an effect fits begin."""

from collections.abc import Sequence

from motor_sysid.diagnosis.candidates.score import Scored
from motor_sysid.physics.effects import effect

MANY, STARTS = 4, 3
"""Variants above which an effect is refitted from several of them, and how many at most."""


def best_per_effect(scores: Sequence[Scored], limit: int) -> list[list[Scored]]:
    """Return the best variants of each effect, at most `limit` effects, best first.

    Effects with many variants have many local minima: three starts are kept of them.  With an
    effect come its special cases, whatever their score: nothing may be named that is more than the
    data ask for.  What generalises an effect of the model comes along, too: where its law is far
    from the special one, no derivative tells what it is worth.
    """
    best: dict[str, list[Scored]] = {}
    for one in scores:
        best.setdefault(one.variant.effect.key, []).append(one)
    chosen = list(best)[:limit]
    special = [s for key in chosen for s in effect(key).card.generalises]
    special += [key for key, found in best.items() if found[0].variant.inherits]
    chosen += [key for key in dict.fromkeys(special) if key in best and key not in chosen]
    return [best[key][: STARTS if _has_valleys(best[key]) else 1] for key in chosen]


def _has_valleys(variants: Sequence[Scored]) -> bool:
    """Whether a fit may end in a valley beside the deepest one: many shapes, or finite trials."""
    one = variants[0].variant
    return len(variants) > MANY or not one.model.parameters.free
