"""A twin of a recording: the same motor, complete, with fresh noise and the same input or loop."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.calibration.controller import Controller
from motor_sysid.diagnosis.calibration.noise import Noise, rounded
from motor_sysid.estimation.batch import make_chain, observed_outputs, starts_of
from motor_sysid.physics.drive import Drive, input_signals
from motor_sysid.physics.lanes import LANES
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.rollout import Program
from motor_sysid.signals.lattice import lattice
from motor_sysid.signals.record import Provenance, Record

Array = NDArray[np.float64]

SUBSTEPS = 8
"""Integration steps per sample: finer than any fit's, so that integration error counts."""

_HISTORY = 2


@dataclass(frozen=True)
class Twin:
    """One recording that can be made again.

    Attributes
    ----------
    model:
        The motor, which lacks nothing.
    record:
        The recording: uniform.
    controller:
        Its speed controller; without one the recorded input is applied again.
    """

    model: Model
    record: Record
    controller: Controller | None = None

    def make(self, noise: Noise, rng: np.random.Generator) -> Record:
        """Return a record with fresh noise, of the same signals and length."""
        record, dt = self.record, self.record.dt
        count = len(record)
        names = input_signals(record, self.model.kind)
        errors = noise.errors(count, dt, rng)
        push = self._push(noise.forces(count, dt, rng), count)
        phase = float(rng.uniform()) * noise.steps.get('position', 0.0)
        inputs = np.column_stack([record[name] for name in names])
        start = self._start()
        if self.controller:
            inputs = _Loop(self, noise, errors, phase, push, start).run()[:, np.newaxis]
        outputs = self._outputs(inputs, push, start)
        signals = {name: inputs[:, j] for j, name in enumerate(names)}
        for name in record:
            if name in outputs:
                signals[name] = outputs[name] + errors.get(name, 0.0)
            elif name not in signals:
                signals[name] = record[name]
        self._round(signals, outputs, errors, noise, phase)
        return Record(record.time, signals, record.units, Provenance('complete-model run'))

    def _round(
        self,
        signals: dict[str, Array],
        outputs: dict[str, Array],
        errors: dict[str, Array],
        noise: Noise,
        phase: float,
    ) -> None:
        """Put what converters and encoders do into the signals."""
        for name, step in noise.steps.items():
            if name in signals:
                signals[name] = rounded(signals[name], step)
        if 'position' not in outputs:
            return  # the motion is given
        angle = outputs['position'] + errors.get('position', 0.0)
        counts = rounded(angle + phase, noise.steps.get('position', 0.0)) - phase
        if 'position' in signals:
            signals['position'] = counts
        if 'speed' in signals and noise.counted:
            speed = np.diff(counts, prepend=counts[:1]) / self.record.dt
            speed[0] = signals['speed'][0]
            signals['speed'] = speed + errors.get('speed', 0.0)

    def _start(self) -> Array:
        kind = self.model.kind
        outputs = observed_outputs(kind, [self.record])
        first = make_chain(self.record, kind, outputs)[0]
        start: Array = np.atleast_2d(starts_of(self.model, _table(self.model), [first])[0])[0]
        return start

    def _push(self, forces: dict[str, Array], count: int) -> Array:
        """Return (N, 2, m, 1) disturbing forces at the ends of each sample; or none."""
        kind = self.model.kind
        if not forces:
            return np.empty((0, 2, len(kind.forces), 1))
        push = np.zeros((count, 2, len(kind.forces), 1))
        for j, force in enumerate(kind.forces):
            if force.name in forces:
                push[:, 0, j, 0] = forces[force.name][:-1]
                push[:, 1, j, 0] = forces[force.name][1:]
        return push

    def _outputs(self, inputs: Array, push: Array, start: Array) -> dict[str, Array]:
        """Return signal to (N,) noiseless values of everything that the motor kind predicts."""
        program = Program.of(self.model, [o.signal for o in self.model.kind.outputs])
        drive = Drive(np.ascontiguousarray(inputs), self.record.dt)
        run = program.run_chain(
            _table(self.model), [drive], [start], pushes=[push], substeps=SUBSTEPS
        )[0][:, :, 0]
        return {name: run[:, j] for j, name in enumerate(program.outputs)}


class _Loop:
    """A run under the controller, sample by sample."""

    def __init__(
        self,
        twin: Twin,
        noise: Noise,
        errors: dict[str, Array],
        phase: float,
        push: Array,
        start: Array,
    ) -> None:
        self.twin, self.push, self.phase = twin, push, phase
        self.errors, self.noise = errors, noise
        model = twin.model
        self.program = Program.of(model, ['speed'])
        values = _table(model)
        table = np.array([values[name] for name in self.program.names])
        self.dt = twin.record.dt
        self.workspace = self.program.workspace(table, self.dt, SUBSTEPS)
        self.state = np.repeat(start[:, np.newaxis], LANES, axis=1)
        self.program.begin(self.workspace, self.state)
        self.state = self.state[: len(model.kind.states)]
        self.omega, self.theta = (model.kind.states.index(n) for n in ('omega', 'theta'))

    def run(self) -> Array:
        """Return the (N,) input that the controller gives."""
        twin, c = self.twin, self.twin.controller
        assert c is not None
        reference, dt = twin.record['speed_reference'], self.dt
        speeds, given = np.zeros(reference.size), np.zeros(reference.size)
        integral, constant = 0.0, c.constant
        late = int(self.workspace.late[0]) + _HISTORY if self.workspace.late.size else 1
        speed_error = self.errors.get('speed', np.zeros(reference.size))
        before = self._counts(0)
        for k in range(reference.size):
            counts = self._counts(k)
            if self.noise.counted and k:
                speeds[k] = (counts - before) / dt + speed_error[k]
            else:
                step = 0.0 if self.noise.counted else self.noise.steps.get('speed', 0.0)
                value = self.state[self.omega, 0] + speed_error[k]
                speeds[k] = step * round(value / step) if step else value
            before = counts
            seen = speeds[max(k - c.delay, 0)]
            slope = (seen - speeds[max(k - c.delay - 1, 0)]) / dt
            error = reference[k] - seen
            wanted = c.kp * error + c.ki * integral - c.kd * slope + constant
            u = min(max(wanted, c.lower), c.upper)
            if u == wanted or (wanted > u) != (error > 0):
                integral += error * dt
            given[k] = c.resolution * round(u / c.resolution) if c.resolution else u
            self._advance(given, k, late)
        return given

    def _counts(self, k: int) -> float:
        errors = self.errors.get('position')
        angle = self.state[self.theta, 0] + (errors[k] if errors is not None else 0.0)
        step = self.noise.steps.get('position', 0.0)
        if not step:
            return float(angle)
        return float(step * round((angle + self.phase) / step) - self.phase)

    def _advance(self, given: Array, k: int, late: int) -> None:
        first = max(k + 1 - late, 0)
        inputs = np.zeros((late, 1))
        inputs[late - (k + 1 - first) :, 0] = given[first : k + 1]
        start = (k + 1 - late) * self.dt
        push = None
        if self.push.size:
            push = np.zeros((late, *self.push.shape[1:3], LANES))
            push[-1] = self.push[k]
        self.program.advance(
            self.workspace, self.state, Drive(inputs, self.dt, start), SUBSTEPS,
            np.empty((late, 1, LANES)), late - 1, push,
        )  # fmt: skip


def _table(model: Model) -> dict[str, Array]:
    return {name: np.array([value]) for name, value in model.parameters.values().items()}


def is_counted(model: Model, record: Record) -> bool:
    """Tell whether the speed of a record is the difference of its encoder's counts."""
    if 'speed' not in record or model.speed_sensor is not SpeedSensor.DIFFERENCE:
        return False
    if 'position' not in record:
        return lattice(record['speed']) is not None
    backward = np.diff(record['position']) / record.dt
    off = np.std(backward - record['speed'][1:])
    return bool(off < 0.05 * np.std(np.diff(record['speed'])))
