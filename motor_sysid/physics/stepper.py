"""A model that runs one sample at a time: the plant of a live simulation."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.lanes import LANES
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import paced
from motor_sysid.physics.rollout import Program


class Stepper:
    """A model that runs one sample at a time: the plant of a live simulation.

    Parameters
    ----------
    model:
        The model.
    dt:
        Sample time in s.
    substeps:
        Integration steps per sample, times those that the motor's speed asks for.

    Raises
    ------
    UserError
        If the model takes its motion as given.
    """

    def __init__(self, model: Model, dt: float, substeps: int = 1) -> None:
        if 'omega' not in model.kind.states:
            raise UserError(
                f'a {model.kind.title} has no motion of its own to be simulated: it tells the '
                'current that a recorded motion takes; choose another motor kind'
            )
        self.model, self.dt = model, dt
        self._substeps = substeps
        self._program = Program.of(model, tuple(o.signal for o in model.kind.outputs))
        self._outputs = np.empty((1, len(self._program.outputs), LANES))
        self._omega = model.kind.states.index('omega')
        self.reset()

    def reset(self, **state: float) -> None:
        """Start again at rest, or at the given state (``omega=...``, ``theta=...``)."""
        values = self.model.parameters.values()
        self._table = np.array([[values[name]] for name in self._program.names])
        self._steps = self._substeps
        self._workspace = self._program.workspace(self._table, self.dt, self._steps)
        depth = int(self._workspace.late[0]) + 2 if self._workspace.late.size else 1
        self._history = np.zeros((depth, len(self.model.kind.arguments)))
        start = [state.get(name, 0.0) for name in self.model.kind.states]
        self._x = np.repeat(np.array(start)[:, np.newaxis], LANES, axis=1)
        self._program.begin(self._workspace, self._x)
        self._count = 0

    def step(self, u: float | Sequence[float]) -> None:
        """Advance one sample under the held input `u` (n_u values, or one number)."""
        self._history[:-1] = self._history[1:]
        self._history[-1] = u
        start = (self._count - len(self._history) + 1) * self.dt
        drive = Drive(self._history, self.dt, start)
        last = len(self._history) - 1
        self._keep_pace()
        self._program.advance(self._workspace, self._x, drive, self._steps, self._outputs, last)
        self._count += 1

    def _keep_pace(self) -> None:
        """Take as many substeps as the speed asks for."""
        speed = float(self._x[self._omega, 0])
        wanted = self._program.pace.steps(self._table[:, 0], speed, self.dt)
        fresh = self._substeps * paced(self._steps // self._substeps, wanted)
        if fresh != self._steps:
            self._steps, before = fresh, self._workspace
            self._workspace = self._program.workspace(self._table, self.dt, fresh)
            self._workspace.buffer[:] = before.buffer

    @cached_property
    def _biases(self) -> dict[str, float]:
        return {o.signal: self.model[o.bias] if o.bias else 0.0 for o in self.model.kind.outputs}

    @property
    def state(self) -> dict[str, float]:
        """State name to value, now."""
        return {name: float(self._x[j, 0]) for j, name in enumerate(self.model.kind.states)}

    @property
    def outputs(self) -> dict[str, float]:
        """Signal to value, now: sensor offsets included, without noise and differencing."""
        state = self.state
        return {o.signal: state[o.state] + self._biases[o.signal] for o in self.model.kind.outputs}
