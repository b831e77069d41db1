"""A model that runs one sample at a time: the plant of a live simulation."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.lanes import LANES
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors.base import paced
from motor_sysid.physics.rollout import Program

Array = NDArray[np.float64]


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
        ideal = model.with_speed_sensor(SpeedSensor.IDEAL)
        self._program = Program.of(ideal, tuple(o.signal for o in model.kind.outputs))
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
        self._shown: dict[str, float] = {}

    def step(self, u: float | Sequence[float]) -> None:
        """Advance one sample under the held input `u` (n_u values, or one number)."""
        self._history[:-1] = self._history[1:]
        self._history[-1] = u
        self._keep_pace()
        self._advance(self._history, self._x, self._steps)
        self._count += 1
        self._shown = {}

    def _advance(self, history: Array, x: Array, steps: int) -> None:
        """Run `steps` on from the state `x` (n, 32) and note what was shown at their start."""
        start = (self._count - len(history) + 1) * self.dt
        drive, last = Drive(history, self.dt, start), len(history) - 1
        self._program.advance(self._workspace, x, drive, steps, self._outputs, last)

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
        """Signal to value, now, as sensors without noise show it: with their offset, gain, lag.

        A speed is that of the moment, not differenced; its sensor takes the last input to go on.
        """
        if not self._program.has_sensors:
            state, told = self.state, self.model.kind.outputs
            return {o.signal: state[o.state] + self._biases[o.signal] for o in told}
        if not self._shown:
            kept = self._workspace.buffer.copy()
            history = np.concatenate((self._history[1:], self._history[-1:]))
            self._advance(history, self._x.copy(), 1)
            self._workspace.buffer[:] = kept
            shown = self._outputs[0, :, 0].tolist()
            self._shown = dict(zip(self._program.outputs, shown, strict=True))
        return dict(self._shown)
