"""Steps of the central differences that sensitivities are made of."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.effect import Effect
from motor_sysid.physics.parameters import Parameter

Array = NDArray[np.float64]

DIFFERENCE_STEP = 1e-4
"""Step in scaled coordinates: error below 4e-6 with measured position."""

STRIKING_STEP = 1e-2
"""The same where a model strikes: outputs are rough on a finer scale, and derivatives over it tell
of nothing but the roughness."""

_PART, _LEAST = 0.05, 1e-3
_PHASE = 0.1


def difference_steps(
    sized: Sequence[tuple[Parameter, float]],
    effects: Sequence[Effect],
    values: Mapping[str, float],
    dt: float,
    end: float,
    stride: float | None = None,
) -> Array:
    """Return (d,) steps in scaled coordinates.

    An input delay bends the outputs wherever an edge of the input passes a sample; its step is a
    twentieth of a sample, and does not reach over such a bend, beyond which a current that settles
    within a sample is seen on its way.  That of a frequency moves the phase by a tenth of a radian
    at most.

    Parameters
    ----------
    sized:
        Free parameters and the sizes of their coordinates.
    effects:
        Effects of the model.
    values:
        Where the derivatives are taken.
    dt, end:
        Longest sample and longest time since the start of a record, s.
    stride:
        Step of all others than delays and frequencies, where outputs are rough on a finer scale.
    """
    late = {f'{e.key}.{e.card.delay}' for e in effects if e.card.delay}
    waves = {f'{e.key}.{e.card.frequency}' for e in effects if e.card.frequency}
    strikes = any(e.card.strikes for e in effects)
    steps = np.full(len(sized), stride or (STRIKING_STEP if strikes else DIFFERENCE_STEP))
    for k, (p, size) in enumerate(sized):
        if p.name in late:
            away = abs(values[p.name] / dt - round(values[p.name] / dt))
            steps[k] = np.clip(0.5 * away, _LEAST, _PART) * dt / size
        elif p.name in waves:
            turn = 2 * np.pi * p.value * end
            steps[k] = min(DIFFERENCE_STEP, _PHASE / max(turn, 1e-12))
    return steps
