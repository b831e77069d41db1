"""Three-phase motors on their drives at 1 kHz: the machine, bridge, sensors and controllers.

The machine is that of `three_phase`: phases, set-valued legs, steps of 20 us.  A six-step drive
commutates where the rotor is, not at the samples; a field-oriented one gives one voltage vector a
sample in the rotor's frame.
"""

from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.excitation import Profile
from motor_sysid.benchmark.machine import Machine, MachineSheet
from motor_sysid.benchmark.three_phase import OMEGA, span, STATES, THETA
from motor_sysid.control.six_step import FORWARD
from motor_sysid.machine_code import kept
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.phases import park, sector_at
from motor_sysid.signals.record import Provenance, Record

Array = NDArray[np.float64]

DT, STEPS = 1e-3, 50
"""Sample time, s, and steps of the simulation in it."""

_DRIVEN, _DIODE, _SHORTEST = FORWARD, 0.7, 1e-8
"""Phases that drive, by sector; the voltage of a diode, V; and the shortest step, s."""

_BEARABLE = 2.5
"""Current at standstill under the largest voltage of an open-loop record, in rated ones."""


@dataclass(frozen=True)
class Hidden:
    """A machine with what is hidden in it and around it.

    Attributes
    ----------
    machine:
        The machine itself.
    dead:
        Voltage that dead time takes from a leg, V, in full beyond the current `band`, A.
    delay:
        Time from command to voltage, s.
    speed_lag:
        Time constant of a filter of the speed, s; 0 without one.
    angle_lag:
        Age of the angle that a field-oriented drive turns voltages and currents with, s.
    voltage_lag:
        How much older the angle is that it turns voltages with, s.
    """

    machine: Machine
    dead: float = 0.0
    band: float = 1.0
    delay: float = 0.0
    speed_lag: float = 0.0
    angle_lag: float = 0.0
    voltage_lag: float = 0.0


class Sensors(NamedTuple):
    """Angle of an encoder's step, rad; noise, step and offsets (3,) of the currents, A."""

    angle: float
    noise: float
    step: float
    offsets: Array


class Rig:
    """The machine, its bridge with delay and dead time, and its sensors."""

    def __init__(
        self, hidden: Hidden, sheet: MachineSheet, sensors: Sensors, rng: np.random.Generator
    ) -> None:
        self.hidden, self.sheet, self.sensors, self.rng = hidden, sheet, sensors, rng
        self.machine = Machine(*map(float, hidden.machine))
        self.x, self._work = np.zeros(STATES), np.zeros((6, STATES))
        self._count, self._angle, self._speed = 0, 0.0, 0.0
        self._late: list[tuple[float, float]] = [(0.0, 0.0)] * (2 + int(hidden.delay / DT))

    def currents(self) -> Array:
        """Return the (3,) currents as measured, A."""
        own = self.sensors
        seen = self.x[:3] + own.offsets + own.noise * self.rng.standard_normal(3)
        return np.asarray(own.step * np.round(seen / own.step))

    def angle(self) -> float:
        """Return the angle as the encoder shows it, rad."""
        return self.sensors.angle * math.floor(float(self.x[THETA]) / self.sensors.angle)

    def speed(self, angle: float) -> float:
        """Return the speed since the last sample, or what a filter makes of it, rad/s."""
        passed, self._angle = (angle - self._angle) / DT, angle
        lag = self.hidden.speed_lag
        self._speed += (passed - self._speed) * (-math.expm1(-DT / lag) if lag else 1.0)
        return self._speed

    def advance(self, first: float, second: float = 0.0) -> None:
        """Run one sample under the commanded voltage: across the pair, or on both axes."""
        self._late.append((first, second))
        hidden = self.hidden
        whole, part = divmod(hidden.delay / DT, 1.0)
        newer, older = self._late[-1 - int(whole)], self._late[-2 - int(whole)]
        bridge = self.sheet.supply, hidden.dead, hidden.band
        old = hidden.angle_lag + hidden.voltage_lag
        _sample(
            self.machine, self.x, older, newer, round(part * STEPS), old, bridge,
            self._count * DT, self._work,
        )  # fmt: skip
        self._count += 1


@kept(error_model='numpy')
def _sample(machine, x, older, newer, late, old, bridge, t, work):  # type: ignore[no-untyped-def]
    """Advance the state (8,) by a sample, the first `late` steps under the older command.

    A machine with a trapezoid is driven in six steps, commutated wherever it is, any other by a
    vector that turns with the rotor as it was `old` seconds ago.
    """
    supply, dead, band = bridge
    v, low, high, shown = np.empty((4, 3))
    h = DT / STEPS
    for k in range(STEPS):
        u, u_q = older if k < late else newer
        left = h
        while left > 0.0:
            part, off = left, -1
            angle = machine.pole_pairs * x[THETA]
            if machine.corner > 0.0:
                place, way = angle * 3.0 / math.pi - 0.5, machine.pole_pairs * x[OMEGA]
                sector = math.floor(place + (1e-9 if way >= 0.0 else -1e-9))
                edge = (sector + 1.0 if way > 0.0 else sector) - place
                if way != 0.0:  # a step ends where the next sector begins
                    part = min(left, max(edge * math.pi / 3.0 / way, _SHORTEST))
                into, out = _DRIVEN[int(sector) % 6]
                off = 3 - into - out
                v[into], v[out], v[off] = 0.5 * (supply + u), 0.5 * (supply - u), 0.0
            else:
                angle += (0.5 * h - old) * machine.pole_pairs * x[OMEGA]  # as it is halfway
                alpha = u * math.cos(angle) - u_q * math.sin(angle)
                side = 0.5 * math.sqrt(3.0) * (u * math.sin(angle) + u_q * math.cos(angle))
                v[0], v[1] = alpha + 0.5 * supply, side - 0.5 * alpha + 0.5 * supply
                v[2] = -side - 0.5 * alpha + 0.5 * supply
            for j in range(3):
                lost = dead * min(max(x[j] / band, -1.0), 1.0)
                low[j] = high[j] = v[j] - lost
            if off >= 0:
                low[off], high[off] = -_DIODE, supply + _DIODE
            span(machine, x, low, high, t + (k + 1) * h - left, part, 1, work, shown)
            left = left - part if part < left else 0.0


def six_step(
    rig: Rig, time: Array, profile: Profile, closed: bool, rng: np.random.Generator
) -> Record:
    """Return a record of a six-step drive: voltage as the profile says, or a PI speed loop."""
    m, sheet = rig.hidden.machine, rig.sheet
    slow = m.J * 2 * m.R / (2 * m.k_e) ** 2
    shape, level = profile(time, slow, rng), float(rng.uniform(0.25, 0.6))
    bearable = min(sheet.supply, _BEARABLE * sheet.current * 2 * m.R / 0.6)
    want = level * shape * (0.7 * sheet.top_speed if closed else bearable)
    faster = rng.uniform(1.5, 4.0)
    kp, total = 2 * m.k_e * (faster - 1), 0.0
    ki = kp * faster / (3 * slow)
    columns: dict[str, list[float]] = {name: [] for name in (
        'voltage', 'current', 'speed', 'position', 'hall_sector', 'current_a', 'current_b',
        'current_c')}  # fmt: skip

    for k in range(time.size):
        seen, angle = rig.currents(), rig.angle()
        speed = rig.speed(angle)
        sector = sector_at(m.pole_pairs * float(rig.x[THETA]))
        into, out = FORWARD[sector - 1]
        u = float(want[k])
        if closed:
            error = want[k] - speed
            induced, drop = 2 * m.k_e * speed, _BEARABLE * sheet.current * 2 * m.R
            low, high = max(induced - drop, -sheet.supply), min(induced + drop, sheet.supply)
            u = float(np.clip(kp * error + total, low, max(low, high)))
            total = float(np.clip(total + ki * DT * error, -sheet.supply, sheet.supply))
        row = (u, 0.5 * (seen[into] - seen[out]), speed, angle, sector, *seen)
        for column, value in zip(columns.values(), row, strict=True):
            column.append(float(value))
        rig.advance(u)
    return _record(time, columns)


def pmsm(
    rig: Rig, time: Array, profile: Profile, closed: bool, rng: np.random.Generator
) -> Record:
    """Return a record under field-oriented control: speed, or without a speed loop torque."""
    m, sheet, hidden = rig.hidden.machine, rig.sheet, rig.hidden
    bandwidth = 0.25 / (DT + 2 * hidden.delay)
    inertial = m.J / (1.5 * m.k_e)
    shape, top = profile(time, 20.0 / bandwidth, rng), 0.4 * sheet.top_speed
    want, sums = rng.uniform(0.4, 0.9) * top * shape, np.zeros(3)
    place = np.searchsorted(np.cumsum(rng.uniform(0.02, 0.1, 999)), time)
    pulses = 0.15 * sheet.current * rng.uniform(-1.0, 1.0, (2, 1000))[:, place]
    pulses[:, time < 0.5] = 0.0
    columns: dict[str, list[float]] = {name: [] for name in (
        'voltage_d', 'voltage_q', 'current_d', 'current_q', 'speed', 'position')}  # fmt: skip
    reach = sheet.supply / math.sqrt(3)

    for k in range(time.size):
        seen, angle = rig.currents(), rig.angle()
        speed = rig.speed(angle)
        turned = m.pole_pairs * (angle - hidden.angle_lag * float(rig.x[OMEGA]))
        i_d, i_q = park(
            float(seen[0]), float(seen[1]), float(seen[2]), math.cos(turned), math.sin(turned)
        )
        slower = bandwidth / (8.0 if closed else 30.0)
        error = want[k] - speed
        sums[2] = float(np.clip(sums[2] + 0.2 * slower * DT * error * inertial * slower,
                                -sheet.current, sheet.current))  # fmt: skip
        asked = inertial * slower * error + sums[2] + pulses[1, k]
        asked = float(np.clip(asked, -sheet.current, sheet.current))
        e_d, e_q = pulses[0, k] - i_d, asked - i_q
        speed_e = m.pole_pairs * speed if hidden.delay == 0.0 else 0.0  # late, it would swing
        u_d = bandwidth * m.L_d * e_d + sums[0] - speed_e * m.L_q * i_q
        u_q = bandwidth * m.L_q * e_q + sums[1] + speed_e * m.L_d * i_d + m.k_e * speed
        sums[:2] += bandwidth * m.R * DT * np.array([e_d, e_q])
        scale = min(1.0, reach / max(math.hypot(u_d, u_q), 1e-9))
        u_d, u_q = scale * u_d, scale * u_q
        for column, value in zip(
            columns.values(), (u_d, u_q, i_d, i_q, speed, angle), strict=True
        ):
            column.append(float(value))
        rig.advance(u_d, u_q)
    return _record(time, columns)


def _record(time: Array, columns: dict[str, list[float]]) -> Record:
    signals = {name: np.array(values) for name, values in columns.items()}
    units = {name: BY_NAME[name].units[0] for name in signals}
    return Record(time, signals, units, Provenance('benchmark'))
