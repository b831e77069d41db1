"""Three-phase machines in closed loop: speed control, inner current control, sensors, records.

The inner loop runs at the control rate of the drive, in between the machine is simulated in steps
of a few microseconds; the speed loop runs once in a sample of the record.
"""

from collections.abc import Collection
from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.machine import Bridge, Machine
from motor_sysid.benchmark.three_phase import HEAT, LONGEST_STEP, OMEGA, span, STATES, THETA
from motor_sysid.control.foc import CurrentLoop, Foc
from motor_sysid.control.pid import Pid, PidGains
from motor_sysid.control.six_step import SixStep, SixStepLoop
from motor_sysid.errors import UserError
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.phases import electrical_angle, hall_sector, sector_at, to_dq
from motor_sysid.signals.record import Provenance, Record

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PhaseSensors:
    """What the drive measures, and with what errors.

    Attributes
    ----------
    counts:
        Encoder counts per turn; 0: an ideal encoder.
    noise:
        Standard deviation of each current sensor, A.
    offsets:
        Of the three current sensors, A.
    full_scale, bits:
        The converters cover plus and minus this, A, with 2**bits codes; 0 bits: no rounding.
    """

    counts: float = 4000.0
    noise: float = 0.01
    offsets: tuple[float, float, float] = (0.0, 0.0, 0.0)
    full_scale: float = 20.0
    bits: int = 12

    @property
    def current_step(self) -> float:
        """Resolution of the currents, A; 0 for none."""
        return 2 * self.full_scale / 2**self.bits if self.bits else 0.0


@dataclass(frozen=True)
class ThreePhaseDrive:
    """A drive.

    Attributes
    ----------
    bridge:
        Its inverter.
    loop:
        Gains of field-oriented control or of six-step commutation, which is chosen by them.
    speed:
        Gains of the speed loop; None: the reference is the current.
    control_dt:
        Period of the current loop, s.
    sensors:
        What it measures.
    computes:
        Whether a voltage waits for the next period, while the drive computes.
    ahead:
        Periods by which field-oriented control turns the angle on; see `Foc`.
    """

    bridge: Bridge
    loop: CurrentLoop | SixStepLoop
    speed: PidGains | None = None
    control_dt: float = 1e-4
    sensors: PhaseSensors = PhaseSensors()
    computes: bool = False
    ahead: float = 0.5


@dataclass(frozen=True)
class ThreePhaseRun:
    """What happened, and what the drive saw of it.

    Attributes
    ----------
    dt:
        Sample time, s.
    current, shown_current:
        (N, 3) phase currents at the samples, and as measured, A.
    speed, position, heat:
        (N,) at the samples, rad/s, rad, J.
    shown_speed, shown_position:
        (N,) as the encoder gives them.
    terminal:
        (N, 3) V, mean from each sample to the next: as commanded, or what an open terminal shows.
    command_dq:
        (N, 2) commanded voltage in the rotor's frame, mean, V; zero without such control.
    reference:
        (N,) as given.
    """

    dt: float
    current: Array
    shown_current: Array
    speed: Array
    position: Array
    heat: Array
    shown_speed: Array
    shown_position: Array
    terminal: Array
    command_dq: Array
    reference: Array


def run_drive(
    machine: Machine,
    drive: ThreePhaseDrive,
    reference: Array,
    dt: float,
    rng: np.random.Generator,
    reference_d: Array | None = None,
    longest_step: float = LONGEST_STEP,
) -> ThreePhaseRun:
    """Run a machine from rest.

    Parameters
    ----------
    reference:
        (N,) speed, rad/s, or without a speed loop current, A.
    dt:
        Sample time, s: a whole number of control periods.
    rng:
        Of the noise of the current sensors.
    reference_d:
        (N,) d current for field-oriented control, A; default zero.
    longest_step:
        Of the simulation, s.

    Raises
    ------
    UserError
        If a sample is not a whole number of control periods.
    """
    periods = round(dt / drive.control_dt)
    if periods < 1 or abs(periods * drive.control_dt / dt - 1) > 1e-9:
        raise UserError(
            f'a sample of {dt:g} s is not a whole number of control periods of '
            f'{drive.control_dt:g} s'
        )
    out = _empty(reference.size, dt, reference)
    wanted_d = np.zeros(reference.size) if reference_d is None else reference_d
    plant = _Plant(machine, drive, math.ceil(drive.control_dt / longest_step * (1 - 1e-9)), rng)
    speed_loop = Pid(drive.speed) if drive.speed else None
    before = 0.0
    for k in range(reference.size):
        x = plant.x
        out.current[k], out.heat[k] = x[:3], x[HEAT]
        out.speed[k], out.position[k] = x[OMEGA], x[THETA]
        angle = plant.counted()
        speed, before = (angle - before) / dt, angle
        out.shown_speed[k], out.shown_position[k] = speed, angle
        want = reference[k] if speed_loop is None else speed_loop.step(reference[k], speed, dt)
        for c in range(periods):
            seen = plant.period(speed, want, wanted_d[k])
            if c == 0:
                out.shown_current[k] = seen
            out.terminal[k] += plant.terminal / periods
            out.command_dq[k] += plant.command_dq / periods
    return out


class _Plant:
    """The machine with its bridge, sensors and inner controller, one control period at a time."""

    def __init__(
        self, machine: Machine, drive: ThreePhaseDrive, steps: int, rng: np.random.Generator
    ) -> None:
        self._machine, self._drive = Machine(*map(float, machine)), drive
        self._steps, self._rng, self._time = steps, rng, 0.0
        self.x, self._work = np.zeros(STATES), np.zeros((6, STATES))
        self._shown, self._offsets = np.zeros(3), np.array(drive.sensors.offsets)
        supply, period = drive.bridge.supply, drive.control_dt
        self._inner: Foc | SixStep
        if isinstance(drive.loop, CurrentLoop):
            self._inner = Foc(drive.loop, supply, period, drive.ahead)
        else:
            self._inner = SixStep(drive.loop, supply, period)
        self._legs_next = np.full(3, 0.5 * supply)
        self.terminal, self.command_dq = np.zeros(3), np.zeros(2)

    def counted(self) -> float:
        """Return the angle as the encoder shows it, rad."""
        counts, angle = self._drive.sensors.counts, float(self.x[THETA])
        if counts == 0:
            return angle
        step = 2 * math.pi / counts
        return step * math.floor(angle / step)

    def period(self, speed: float, want: float, want_d: float) -> Array:
        """Run one control period and return the (3,) currents that were measured before it."""
        sensors = self._drive.sensors
        seen = self.x[:3] + self._offsets + sensors.noise * self._rng.standard_normal(3)
        if sensors.bits:
            seen = sensors.current_step * np.round(seen / sensors.current_step)
        now = np.array(self._legs(seen.tolist(), speed, want, want_d))
        if self._drive.computes:
            now, self._legs_next = self._legs_next, now
        self._advance(now)
        return np.asarray(seen, dtype=np.float64)

    def _legs(
        self, seen: list[float], speed: float, want: float, want_d: float
    ) -> tuple[float, float, float]:
        pairs = self._machine.pole_pairs
        if isinstance(self._inner, SixStep):
            sector = sector_at(pairs * float(self.x[THETA]))
            return self._inner.step(seen, sector, speed, want)
        legs = self._inner.step(seen, pairs * self.counted(), pairs * speed, want, want_d)
        self.command_dq = np.array(self._inner.voltage_dq)
        return legs

    def _advance(self, v: Array) -> None:
        """Run the machine under leg voltages (3,), NaN for a leg that is off."""
        bridge, off = self._drive.bridge, np.isnan(v)
        low = np.where(off, -bridge.diode, v - bridge.dead)
        high = np.where(off, bridge.supply + bridge.diode, v + bridge.dead)
        h = self._drive.control_dt / self._steps
        span(
            self._machine, self.x, low, high, self._time, h, self._steps, self._work, self._shown
        )
        self._time += self._drive.control_dt
        self.terminal = np.where(off, self._shown, v)


def _empty(count: int, dt: float, reference: Array) -> ThreePhaseRun:
    one, two, three = ((count,), (count, 2), (count, 3))
    return ThreePhaseRun(
        dt, np.zeros(three), np.zeros(three), np.zeros(one), np.zeros(one), np.zeros(one),
        np.zeros(one), np.zeros(one), np.zeros(three), np.zeros(two), reference,
    )  # fmt: skip


def phase_record(run: ThreePhaseRun, pole_pairs: float, extra: Collection[str] = ()) -> Record:
    """Return the record of a run: phases, and for field-oriented control d and q.

    Parameters
    ----------
    extra:
        Optional signals: ``speed_reference``, ``hall_sector``.
    """
    signals = {f'voltage_{p}': run.terminal[:, k] for k, p in enumerate('abc')}
    signals |= {f'current_{p}': run.shown_current[:, k] for k, p in enumerate('abc')}
    if np.any(run.command_dq):
        angle = electrical_angle(run.shown_position, pole_pairs)
        current = to_dq(run.shown_current, angle)
        signals |= {f'voltage_{p}': run.command_dq[:, k] for k, p in enumerate('dq')}
        signals |= {f'current_{p}': current[:, k] for k, p in enumerate('dq')}
    signals |= {'speed': run.shown_speed, 'position': run.shown_position}
    if 'speed_reference' in extra:
        signals['speed_reference'] = run.reference
    if 'hall_sector' in extra:
        turned = electrical_angle(run.position, pole_pairs)
        signals['hall_sector'] = hall_sector(turned).astype(np.float64)
    time = run.dt * np.arange(run.speed.size, dtype=np.float64)
    units = {name: BY_NAME[name].units[0] for name in signals}
    return Record(time, signals, units, Provenance('benchmark'))
