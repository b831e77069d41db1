"""One sample of a model from any state, with derivatives: all in one call of the simulator."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.coordinates import Coordinates
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.lanes import LANES
from motor_sysid.physics.model import Model
from motor_sysid.physics.rollout import Program, Workspace

Array = NDArray[np.float64]

_NO_OUTPUTS = np.empty((1, 0, LANES))
_SAME = 1e-9
_NEAR = 10.0
_PER_BLOCK = (LANES - 1) // 2


@dataclass(frozen=True)
class Move:
    """Where one sample leads.

    Attributes
    ----------
    state:
        (n,) state after it.
    by_state, by_parameter:
        (n, n) and (n, p) derivatives of that state.
    by_force:
        (n, m) change of that state by a constant torque or voltage of 1 SI unit.
    """

    state: Array
    by_state: Array
    by_parameter: Array
    by_force: Array


class Motion:
    """The exact discrete step of a model and its Jacobian by central differences.

    A block of 32 simulations holds the base and 15 differences; more take further blocks.  The
    matrices of the block are kept as long as the parameters stay within ten of their steps: what
    they moved since is accounted for to first order, which leaves an error of their square.  Own
    states of effects (heat, say) are carried along, without derivatives.

    Parameters
    ----------
    model:
        The model; its input delay is left to the caller.
    moved:
        Parameters that the derivative is taken by.
    """

    def __init__(self, model: Model, moved: Coordinates) -> None:
        self._program = Program.of(model, ())
        self._moved = moved
        values = model.parameters.values()
        self._values = np.array([values[name] for name in self._program.names])
        self._rows = np.array([self._program.names.index(n) for n in moved.names], dtype=np.intp)
        self._n, self._p = len(model.kind.states), len(moved.names)
        self._memory_rows = np.array(self._program.memory_offsets, dtype=np.intp) // LANES
        self._memory = np.zeros(self._memory_rows.size)
        self._blocks: list[_Block] = []
        self._center, self._length = np.zeros(self._p), 0.0

    def set_values(self, values: Mapping[str, float]) -> None:
        """Change parameters that no derivative is taken by."""
        for name, value in values.items():
            self._values[self._program.names.index(name)] = value
        self._blocks = []

    def forget(self) -> None:
        """Set the own states of effects to zero."""
        self._memory[:] = 0.0

    def advance(
        self, x: Array, z: Array, steps: Array, u: Array, time: float, h: float
    ) -> Move:
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
        """
        n, p = self._n, self._p
        away = z - self._center
        near = abs(h - self._length) < _SAME and not (np.abs(away) > _NEAR * steps[n:]).any()
        if not self._blocks or not near:
            self._prepare(z, steps[n:], h)
            away = np.zeros(p)
        drive = Drive(u[np.newaxis, :], h, time)
        ends, memory = np.empty((n, n + p, 2)), self._memory
        for block in self._blocks:
            lanes = self._run(block, x, steps, drive, memory)
            which = block.which
            ends[:, which, :] = lanes[:, 1 : 1 + 2 * which.size].reshape(n, which.size, 2)
        if memory.size:
            rows = self._blocks[0].workspace.buffer.reshape(-1, LANES)
            self._memory = rows[self._memory_rows, 0]
        slope = (ends[:, :, 0] - ends[:, :, 1]) / (2 * self._used)
        state = lanes[:, 0] + slope[:, n:] @ away
        by_state, by_parameter = slope[:, :n].copy(), slope[:, n:].copy()
        return Move(state, by_state, by_parameter, block.workspace.matrices[2][0, :, :, 0].copy())

    def _prepare(self, z: Array, steps: Array, h: float) -> None:
        """Make the matrices of every block around the coordinates (p,)."""
        n, p = self._n, self._p
        self._center, self._length, self._blocks = z.copy(), h, []
        self._used = np.concatenate((np.empty(n), steps))
        for first in range(0, max(n + p, 1), _PER_BLOCK):
            which = np.arange(first, min(first + _PER_BLOCK, n + p))
            cloud = np.repeat(z[:, np.newaxis], LANES, axis=1)
            for k in np.flatnonzero(which >= n):
                cloud[which[k] - n, 1 + 2 * k] += steps[which[k] - n]
                cloud[which[k] - n, 2 + 2 * k] -= steps[which[k] - n]
            table = np.repeat(self._values[:, np.newaxis], LANES, axis=1)
            table[self._rows] = self._moved.values(cloud.T).T
            workspace = self._program.workspace(table, h, delayed=False)
            states = which[which < n]
            self._blocks.append(_Block(which, states, 1 + 2 * np.arange(states.size), workspace))

    def _run(
        self, block: '_Block', x: Array, steps: Array, drive: Drive, memory: Array
    ) -> Array:
        """Simulate the base and the differences of one block; returns (n, W) states."""
        n = self._n
        lanes = np.repeat(x[:, np.newaxis], LANES, axis=1)
        k, state = block.moved, block.states
        lanes[state, k] += steps[state]
        lanes[state, k + 1] -= steps[state]
        self._used[:n] = steps[:n]
        if memory.size:
            block.workspace.buffer.reshape(-1, LANES)[self._memory_rows] = memory[:, np.newaxis]
        self._program.advance(block.workspace, lanes, drive, 1, _NO_OUTPUTS)
        return lanes


@dataclass(frozen=True)
class _Block:
    """32 simulations: the directions (states, then parameters) of its differences, and memory.

    The states among the directions are moved up in the columns `moved`, down in the next ones.
    """

    which: NDArray[np.intp]
    states: NDArray[np.intp]
    moved: NDArray[np.intp]
    workspace: Workspace
