"""The compiled laws of a model, sorted by what the kernel does with them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.effect import Effect, JUMPS, SUM
from motor_sysid.physics.lanes import Lane
from motor_sysid.physics.motors.base import Motor

Integers = NDArray[np.int64]


class Calls:
    """The compiled laws of a model, sorted by what the kernel does with them.

    Parameters
    ----------
    kind:
        The motor kind, which says what equations there are.

    Attributes
    ----------
    fades:
        For each own state whether its rate depends on itself.
    """

    def __init__(self, kind: Motor) -> None:
        self._equation = {force.name: j for j, force in enumerate(kind.forces)}
        self._states = kind.states
        self._own_state = {force.name: force.own_state for force in kind.forces}
        self._stiff: list[tuple[int, Lane, int, int]] = []
        self._plain: list[tuple[int, Lane, int, int]] = []
        self._slopes: list[tuple[int, Lane, int, int]] = []
        self._rates: list[tuple[Lane, int, int]] = []
        self._sensors: list[tuple[Lane, int, int]] = []
        self._jumps: list[tuple[Lane, int, int]] = []
        self._sums: list[tuple[Lane, int, int]] = []
        self.fades: list[bool] = []

    def add(self, lane: Lane, own: int, state: int, *, in_core: bool = False) -> None:
        """Take up a law; `own` and `state` are the offsets of its effect's numbers.

        Equations and rates of effects that are solved `in_core` are not called.
        """
        reads = lane.arguments
        if lane.target == SUM:
            self._sums.append((lane, own, state))
            return
        if in_core and not lane.target.endswith('_sensor'):
            return
        if lane.target in self._equation:
            moved = self._own_state[lane.target]
            stiff = self._stiff if moved in reads else self._plain
            kind = self._slopes if f'd{moved}' in reads else stiff
            kind.append((self._equation[lane.target], lane, own, state))
        elif lane.target in JUMPS:
            self._jumps.append((lane, own, state))
        elif lane.target.endswith('_sensor'):
            self._sensors.append((lane, own, state))
        elif lane.own_state:
            self._rates.append((lane, own, state))
            self.fades.append(lane.target in reads)

    @property
    def laws(self) -> Integers:
        """Laws of the equations, stiff ones first."""
        return _table([call[1:] for call in (*self._stiff, *self._plain)])

    @property
    def stiff_count(self) -> int:
        """How many laws are stiff in their own state."""
        return len(self._stiff)

    @property
    def stiff_force(self) -> Integers:
        """Equation of each law."""
        return integers([call[0] for call in (*self._stiff, *self._plain)])

    @property
    def slopes(self) -> tuple[Integers, Integers]:
        """Laws that read the rate of change of their own equation, and the equation of each."""
        laws = _table([call[1:] for call in self._slopes])
        return laws, integers([call[0] for call in self._slopes])

    @property
    def rates(self) -> Integers:
        """Rates of the own states, in their order."""
        return _table(self._rates)

    @property
    def sensors(self) -> Integers:
        """Laws of sensors."""
        return _table(self._sensors)

    @property
    def sums(self) -> Integers:
        """Laws of what the sum of the shown speed has beyond the angle."""
        return _table(self._sums)

    @property
    def jumps(self) -> tuple[Integers, Integers]:
        """Laws that move states at once, and the states that they move, each once."""
        moved = dict.fromkeys(call[0].target.removeprefix('jump_') for call in self._jumps)
        return _table(self._jumps), integers([self._states.index(name) for name in moved])

    @property
    def keep(self) -> list[Lane]:
        """Everything whose address is in a table."""
        equations = [call[1] for call in (*self._stiff, *self._plain, *self._slopes)]
        others = (*self._rates, *self._sensors, *self._jumps, *self._sums)
        return equations + [call[0] for call in others]


def _table(calls: Sequence[tuple[Lane, int, int]]) -> Integers:
    """Return (N, 3) addresses, offsets of own parameters, and offsets of own states."""
    return integers([(lane.address, own, state) for lane, own, state in calls]).reshape(-1, 3)


def begins(one: Effect, kind: Motor) -> list[tuple[int, int]]:
    """Return own states that begin elsewhere than at zero, with the state that each follows.

    They are numbers among the states of the effect and of the motor; -1 where it is told.
    """
    own = one.card.states.index
    follow = [(own(s), kind.states.index(core)) for s, core in one.card.begins.items()]
    return follow + [(own(s), -1) for s in one.starts]


def integers(values: Sequence[int] | Sequence[tuple[int, ...]]) -> Integers:
    """Return an array of integers."""
    return np.array(values, dtype=np.int64)
