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

    A block of 32 simulations holds the base and 15 differences; more take further blocks.  Own
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
        self._memory = np.zeros(len(self._program.memory_offsets))
        self._last: Workspace | None = None

    def set_values(self, values: Mapping[str, float]) -> None:
        """Change parameters that no derivative is taken by."""
        for name, value in values.items():
            self._values[self._program.names.index(name)] = value
        self._last = None

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
        drive = Drive(u[np.newaxis, :], h, time)
        base, ends, force = np.empty(n), np.empty((n, n + p, 2)), np.empty((n, 0))
        per_block = (LANES - 1) // 2
        memory = self._memory
        for first in range(0, max(n + p, 1), per_block):
            which = np.arange(first, min(first + per_block, n + p))
            lanes, workspace = self._block(x, z, steps, which, drive, memory)
            base, force = lanes[:, 0], workspace.matrices[2][0, :, :, 0]
            ends[:, which, :] = lanes[:, 1 : 1 + 2 * which.size].reshape(n, which.size, 2)
            self._memory = self._read_memory(workspace)
        slope = (ends[:, :, 0] - ends[:, :, 1]) / (2 * steps)
        return Move(base.copy(), slope[:, :n], slope[:, n:], force)

    def _block(
        self,
        x: Array,
        z: Array,
        steps: Array,
        which: NDArray[np.intp],
        drive: Drive,
        memory: Array,
    ) -> tuple[Array, Workspace]:
        """Simulate the base and the differences of the chosen directions."""
        n = self._n
        start = np.repeat(np.concatenate([x, z])[:, np.newaxis], LANES, axis=1)
        lane = 1 + 2 * np.arange(which.size)
        start[which, lane] += steps[which]
        start[which, lane + 1] -= steps[which]
        workspace = self._workspace(start[n:], drive.dt)
        rows = workspace.buffer.reshape(-1, LANES)
        for offset, value in zip(self._program.memory_offsets, memory, strict=True):
            rows[offset // LANES] = value
        lanes = np.ascontiguousarray(start[:n])
        self._program.advance(workspace, lanes, drive, 1, _NO_OUTPUTS)
        return lanes, workspace

    def _workspace(self, z: Array, h: float) -> Workspace:
        """Return the matrices of (p, W) coordinates; the last ones where nothing has changed."""
        last = self._last
        if not self._p and last is not None and abs(last.width[0, 0] - h) < _SAME:
            return last
        table = np.repeat(self._values[:, np.newaxis], LANES, axis=1)
        if self._p:
            table[self._rows] = self._moved.values(z.T).T
        self._last = self._program.workspace(table, h, delayed=False)
        return self._last

    def _read_memory(self, workspace: Workspace) -> Array:
        return np.array([workspace.buffer[offset] for offset in self._program.memory_offsets])
