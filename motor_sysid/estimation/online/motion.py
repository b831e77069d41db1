"""One sample of a model from any state, with derivatives: all in one call of the simulator."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.coordinates import Coordinates
from motor_sysid.machine_code import kept
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.effect import arguments
from motor_sysid.physics.lanes import LANES
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import paced
from motor_sysid.physics.rollout import Program
from motor_sysid.physics.workspace import Workspace

Array = NDArray[np.float64]

_EMPTY = np.empty(0)
_NO_OUTPUTS = np.empty((1, 0, LANES))
_SAME = 1e-9
_NEAR = 10.0
_PER_BLOCK = (LANES - 1) // 2


class Move(NamedTuple):
    """Where one sample leads; the arrays are written anew by the next one.

    A state is that of the motor, followed by the own states of its effects.

    Attributes
    ----------
    state:
        (n,) state after it.
    slope:
        (n, n + p) derivatives of that state by the state before and by the parameters.
    by_force:
        (n, m) change of that state by a constant torque or voltage of 1 SI unit; own states
        follow a sample later.
    curve:
        (n, k) standard deviations that the slope does not tell of, each column one.
    """

    state: Array
    slope: Array
    by_force: Array
    curve: Array


class Motion:
    """The exact discrete step of a model and its Jacobian by central differences.

    A block of 32 simulations holds the base and 15 differences; more take further blocks.  The
    matrices of the block are kept as long as the parameters stay within ten of their steps: what
    they moved since is accounted for to first order, which leaves an error of their square.  What
    rates of own states read (the time constant of a filter) is never taken beyond its lower bound.

    Parameters
    ----------
    model:
        The model; its input delay is left to the caller.
    moved:
        Parameters that the derivative is taken by.

    Attributes
    ----------
    states:
        Number of states: those of the motor, then own states of effects (a twist, heat).
    angle:
        Number of the state that is the angle of the shaft.
    """

    def __init__(self, model: Model, moved: Coordinates) -> None:
        self._program = Program.of(model, ())
        self._moved = moved
        values = model.parameters.values()
        self._values = np.array([values[name] for name in self._program.names])
        self._rows = np.array([self._program.names.index(n) for n in moved.names], dtype=np.intp)
        self._core, self._p = len(model.kind.states), len(moved.names)
        self._own_rows = np.array(self._program.memory_offsets, dtype=np.intp) // LANES
        cards = [one.card for one in self._program.effects]
        begins = [card.begins.get(own) for card in cards for own in card.states]
        self._begins = [model.kind.states.index(name) if name else -1 for name in begins]
        rates = [(one.key, law) for one in self._program.effects for law in one.rates.values()]
        read = {f'{key}.{name}' for key, law in rates for name in arguments(law)}
        self._floor = np.where([name in read for name in moved.names], moved.lower, -np.inf)
        self.states = self._n = self._core + self._own_rows.size
        self._blocks: list[_Block] = []
        self._center, self._length, self._substeps = np.zeros(self._p), 0.0, 1
        self._omega = model.kind.states.index('omega')
        self.angle = model.kind.states.index('theta')
        self._used = np.zeros(self._n + self._p)
        self._slope = np.zeros((self._n, self._n + self._p))
        self._straight = np.zeros((self._n, 0))

    def set_values(self, values: Mapping[str, float]) -> None:
        """Change parameters that no derivative is taken by."""
        for name, value in values.items():
            self._values[self._program.names.index(name)] = value
        self._blocks = []

    def beginning(self, motor: Array) -> Array:
        """Return (n,) for the motor's states: own states begin at one of these, or at zero."""
        return np.append(motor, [motor[k] if k >= 0 else 0.0 for k in self._begins])

    def advance(
        self, x: Array, z: Array, steps: Array, u: Array, time: float, h: float,
        position: Array = _EMPTY,
    ) -> Move:  # fmt: skip
        """Advance one sample.

        Parameters
        ----------
        x, z:
            (n,) state and (p,) coordinates of the moved parameters.
        steps:
            (n + p,) step of the central differences.
        u:
            (n_u,) held input.
        time, h:
            Time at the start and length of the sample in s.
        position:
            (2,) angle of the shaft at both ends that laws see, or empty for the simulated one.
        """
        n = self._n
        far = abs(h - self._length) >= _SAME or _is_far(z, self._center, steps[n:])
        wanted = self._program.pace.steps(self._values, float(x[self._omega]), h)
        substeps = paced(self._substeps, wanted)
        if far or not self._blocks or substeps != self._substeps:
            self._substeps = substeps
            self._prepare(z, steps[n:], h)
        self._used[:n] = steps[:n]
        drive = Drive(u[np.newaxis, :], h, time, position)
        for block in self._blocks:
            self._run(block, x, drive)
        state = _at(block.lanes, self._slope, z, self._center)
        return Move(state, self._slope, self._by_force(block), self._straight)

    def scatter(self, x: Array, z: Array, u: Array, time: float, h: float) -> tuple[Array, Array]:
        """Advance a cloud of points by one sample.

        Parameters
        ----------
        x, z:
            (K, n) states and (K, p) coordinates of the moved parameters.
        u:
            (n_u,) held input.
        time, h:
            Time at the start and length of the sample in s.

        Returns
        -------
        (K, n) states after it, and (n, m) change of the first one by constant forces of one.
        """
        after, by_force = np.empty_like(x), None
        drive = Drive(u[np.newaxis, :], h, time)
        wanted = self._program.pace.steps(self._values, float(x[0, self._omega]), h)
        self._substeps = paced(self._substeps, wanted)
        for first in range(0, len(x), LANES):
            part = slice(first, min(first + LANES, len(x)))
            block = self._block_of(np.maximum(z[part], self._floor).T, h)
            block.lanes[:] = x[part][0][:, np.newaxis]
            block.lanes[:, : len(x[part])] = x[part].T
            self._simulate(block, drive)
            after[part] = block.lanes[:, : len(x[part])].T
            if by_force is None:
                by_force = self._by_force(block)
        self._blocks = []
        assert by_force is not None
        return after, by_force

    def _prepare(self, z: Array, steps: Array, h: float) -> None:
        """Make the matrices of every block around the coordinates (p,)."""
        n, p = self._n, self._p
        self._center, self._length, self._blocks = z.copy(), h, []
        self._used[n:] = steps
        for first in range(0, max(n + p, 1), _PER_BLOCK):
            last = min(first + _PER_BLOCK, n + p)
            cloud = np.repeat(z[:, np.newaxis], 1 + 2 * (last - first), axis=1)
            for k in range(max(first, n), last):
                at = 1 + 2 * (k - first)
                cloud[k - n, at] += steps[k - n]
                cloud[k - n, at + 1] = max(z[k - n] - steps[k - n], self._floor[k - n])
                self._used[k] = 0.5 * (cloud[k - n, at] - cloud[k - n, at + 1])
            self._blocks.append(self._block_of(cloud, h, first, last))

    def _block_of(self, cloud: Array, h: float, first: int = 0, last: int = 0) -> '_Block':
        """Return simulations with coordinates (p, K)."""
        table = np.repeat(self._values[:, np.newaxis], cloud.shape[1], axis=1)
        table[self._rows] = self._moved.values(cloud.T).T
        # finer pieces where a sign turns would be nine sets of matrices for every sample
        workspace = self._program.workspace(
            table, h, self._substeps, delayed=False, turning=False
        )
        return _Block(first, last, np.empty((self._n, LANES)), workspace)

    def _run(self, block: '_Block', x: Array, drive: Drive) -> None:
        """Simulate the base and the differences of one block."""
        _set_lanes(block.lanes, x, self._used, block.first, block.last)
        self._simulate(block, drive)
        _set_slopes(block.lanes, self._used, block.first, block.last, self._slope)

    def _by_force(self, block: '_Block') -> Array:
        """Return the change of the state by constant forces of one; see `Move`."""
        change = np.zeros((self._n, len(self._program.kind.forces)))
        change[: self._core] = block.workspace.by_force[: self._core] * self._substeps
        return change

    def _simulate(self, block: '_Block', drive: Drive) -> None:
        """Advance the lanes of a block."""
        motor, own = block.lanes[: self._core], block.lanes[self._core :]
        rows = block.workspace.buffer.reshape(-1, LANES)
        rows[self._own_rows] = own
        self._program.advance(block.workspace, motor, drive, self._substeps, _NO_OUTPUTS)
        own[:] = rows[self._own_rows]


@dataclass(frozen=True)
class _Block:
    """Simulations of the base (lane 0) and of differences, up and down, by directions.

    Directions `first` to `last` (exclusive) are states, then parameters; `lanes` (n, 32) are the
    states.
    """

    first: int
    last: int
    lanes: Array
    workspace: Workspace


@kept()
def _is_far(z, center, steps):  # type: ignore[no-untyped-def]
    far = False
    for k in range(z.size):
        far = far or abs(z[k] - center[k]) > _NEAR * steps[k]
    return far


@kept()
def _set_lanes(lanes, x, steps, first, last):  # type: ignore[no-untyped-def]
    """Begin every lane at the state (n,), those that differ by a state a step away."""
    for j in range(lanes.shape[0]):
        for k in range(lanes.shape[1]):
            lanes[j, k] = x[j]
    for j in range(first, min(last, lanes.shape[0])):
        lanes[j, 1 + 2 * (j - first)] += steps[j]
        lanes[j, 2 + 2 * (j - first)] -= steps[j]


@kept()
def _set_slopes(lanes, steps, first, last, slope):  # type: ignore[no-untyped-def]
    """Write the central differences of one block to `slope` (n, n + p)."""
    for j in range(lanes.shape[0]):
        for k in range(first, last):
            at = 1 + 2 * (k - first)
            slope[j, k] = (lanes[j, at] - lanes[j, at + 1]) / (2 * steps[k])


@kept()
def _at(lanes, slope, z, center):  # type: ignore[no-untyped-def]
    """Return the state (n,) of the base, moved from the center to the coordinates (p,)."""
    n = lanes.shape[0]
    state = lanes[:, 0].copy()
    for j in range(n):
        for k in range(z.size):
            state[j] += slope[j, n + k] * (z[k] - center[k])
    return state
