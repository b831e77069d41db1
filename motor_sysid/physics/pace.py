"""How many steps a sample takes: what turns, swings or fades within one asks for more."""

from collections.abc import Sequence
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.effect import Effect
from motor_sysid.physics.motors.base import Motor
from motor_sysid.physics.workspace import graded

Array = NDArray[np.float64]

SWING, MOST_SWINGS = 0.5, 16
"""Angle in rad by which an own state may swing in one step that is not exact; and how many steps a
sample takes for that at most: what swings faster, samples do not show."""

MOST_PARTS = 8
"""Most parts that a sample is cut in unasked, where a law reads a rate that fades within it."""


class Pace:
    """What the laws of a motor and its effects ask of the steps of the integration.

    Parameters
    ----------
    kind, effects:
        Motor kind and its effects.
    names:
        Every parameter, motor first.
    rates:
        Numbers of the motor's forces whose laws read the rate of change of their own equation.
    """

    def __init__(
        self, kind: Motor, effects: Sequence[Effect], names: Sequence[str], rates: Sequence[int]
    ) -> None:
        self._kind, self._names = kind, tuple(names)
        self._fading = [kind.states.index(kind.forces[j].own_state) for j in dict.fromkeys(rates)]
        self._swinging = [
            (f'{one.key}.{one.card.pace}', f'{one.key}.{one.card.amplitudes[0].name}')
            for one in effects
            if one.card.pace
        ]

    def parts(self, table: Array, dt: float) -> int:
        """Return in how many parts (see `graded`) a sample of `dt` s is cut at least.

        A law that reads its own equation's rate of change sees at the start of a sample what the
        jump of the input makes; one step would take that for the whole of a sample in which it
        fades.  `table` is (K, P) parameters.
        """
        if not self._fading:
            return 1
        with np.errstate(all='ignore'):
            a = self._kind.matrices(dict(zip(self._names, table, strict=True)))[0]
        faded = np.abs(a[:, self._fading, self._fading]) * dt
        most = np.max(faded[np.isfinite(faded)], initial=1.0)
        return min(math.ceil(most), MOST_PARTS)

    def steps(self, column: Array, speed: float, dt: float, parts: int = 1) -> int:
        """Return how many steps a part takes with parameters (K,) at a speed in rad/s.

        A sample of `dt` s is cut in `parts`; own states swing as far in the longest as they may.
        """
        values: dict[str, float] = dict(zip(self._names, column.tolist(), strict=True))
        steps = max(self._kind.substeps(values, speed, dt), 1)
        if not self._swinging:
            return steps
        longest = float(np.max(graded(np.ones((1, 1)), parts, even=bool(self._kind.wave))))
        swings = [
            values[rate] * math.sqrt(1.0 + values[load]) * dt for rate, load in self._swinging
        ]
        asked = [math.ceil(min(angle / SWING, MOST_SWINGS) * longest) for angle in swings]
        return max(steps, *asked)

    def most_steps(self, table: Array, speed: float, dt: float, parts: int) -> int:
        """Return the most `steps` that any of the parameters (K, P) that are finite ask for."""
        columns = table.T[np.all(np.isfinite(table), axis=0)] if self._swinging else table.T[:1]
        return max((self.steps(one, speed, dt, parts) for one in columns), default=1)
