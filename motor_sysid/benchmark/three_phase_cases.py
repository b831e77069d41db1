"""Draw cases of three-phase motors: a machine on its drive with something hidden, and its records.

Two kinds, as users record them at 1 kHz:

* ``six_step``: a brushless motor with Hall sensors.  Both legs that drive chop complementarily,
  the third is off, and commutation follows the rotor, not the samples.  Recorded are the voltage
  across the pair, half the difference of its two currents, the phases, sector, position and speed.
* ``pmsm``: a synchronous motor under field-oriented control with one voltage vector a sample in
  the rotor's frame.  Recorded are both axes, position and speed.

The machine is that of `three_phase`: phases, set-valued legs, steps of 20 us.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
import math
from typing import NamedTuple

from numba import njit
import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.excitation import Profile, PROFILES
from motor_sysid.benchmark.machine import BLDC_SHEETS, Machine, MachineSheet, PMSM_SHEETS
from motor_sysid.benchmark.three_phase import OMEGA, span, STATES, THETA
from motor_sysid.control.six_step import FORWARD
from motor_sysid.errors import UserError
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.phases import park, sector_at
from motor_sysid.signals.record import Provenance, Record

Array = NDArray[np.float64]

DT, STEPS, SIZES = 1e-3, 50, (0.03, 0.1)
"""Sample time, s, steps of the simulation in it, and sizes of what is hidden, as fractions."""

_DRIVEN, _DIODE, _SHORTEST = FORWARD, 0.7, 1e-8
"""Phases that drive, by sector; the voltage of a diode, V; and the shortest step, s."""

_BEARABLE = 2.5
"""Current at standstill under the largest voltage of an open-loop record, in rated ones."""

TOLERANCE = 0.12
"""Largest relative deviation of a true parameter from the data sheet."""


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
    """

    machine: Machine
    dead: float = 0.0
    band: float = 1.0
    delay: float = 0.0


Hide = Callable[[Hidden, float, MachineSheet, np.random.Generator], Hidden]


def _on(hidden: Hidden, **numbers: float) -> Hidden:
    return Hidden(hidden.machine._replace(**numbers), hidden.dead, hidden.band, hidden.delay)


def rated_torque(sheet: MachineSheet) -> float:
    """Return the torque of the rated current, N m."""
    return (2.0 if sheet.machine.corner else 1.5) * sheet.machine.k_e * sheet.current


def _coulomb(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, tau_c=size * rated_torque(s))


def _stribeck(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    tau = size * rated_torque(s)
    return _on(
        h, tau_c=tau, tau_s=rng.uniform(0.5, 1.0) * tau,
        omega_s=rng.uniform(0.02, 0.08) * s.top_speed,
    )  # fmt: skip


def _drag(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, drag=size * rated_torque(s) / s.top_speed**2)


def _load(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, tau_l=size * rated_torque(s) * rng.choice([-1.0, 1.0]))


def _cogging(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    order = float(rng.choice([2, 4, 6])) * s.machine.pole_pairs
    return _on(
        h, cogging=size * rated_torque(s), cogging_angle=rng.uniform(-np.pi, np.pi), order=order
    )


def _step(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    torque = size * rated_torque(s) * rng.choice([-1.0, 1.0])
    return _on(h, step_torque=torque, step_time=rng.uniform(3.0, 7.0))


def _soft(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, soft=5 * size, i_soft=rng.uniform(0.5, 2.0) * s.current)


def _dead(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    voltage = 0.5 * size * s.supply
    return Hidden(h.machine, voltage, rng.uniform(0.02, 0.1) * s.current, h.delay)


def _delay(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    low, high = (1e-3, 3e-3) if size < 0.06 else (3e-3, 12e-3)
    return Hidden(h.machine, h.dead, h.band, float(rng.uniform(low, high)))


def _harmonics(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, fifth=size, seventh=-rng.uniform(0.3, 1.0) * size)


HIDE: dict[str, Hide] = {
    'coulomb_friction': _coulomb,
    'stribeck_friction': _stribeck,
    'quadratic_drag': _drag,
    'constant_load_torque': _load,
    'cogging_torque': _cogging,
    'load_torque_step': _step,
    'inductance_saturation': _soft,
    'inverter_dead_time': _dead,
    'input_delay': _delay,
    'emf_harmonics': _harmonics,
}
"""Key to the function that hides an effect of a size in a machine; sizes as in `hidden`."""

KINDS = {'six_step': ('bldc_six_step', BLDC_SHEETS), 'pmsm': ('pmsm', PMSM_SHEETS)}
"""Kind of a case to the motor kind of its model, and the data sheets it is drawn from."""

FOREIGN = {('six_step', 'emf_harmonics')}
"""What a kind of motor does not have: a trapezoid is all harmonics."""


@dataclass(frozen=True)
class ThreePhaseCase:
    """A case.

    Attributes
    ----------
    name, kind, effect, size:
        Its name; of `KINDS`; key of what is hidden, or empty; and how large it is.
    sheet, hidden:
        Data sheet and true machine.
    profiles, closed:
        Excitation of each record, and whether a speed loop follows it.
    train, valid:
        Records.
    """

    name: str
    kind: str
    effect: str
    size: float
    sheet: MachineSheet
    hidden: Hidden
    profiles: tuple[str, ...]
    closed: tuple[bool, ...]
    train: tuple[Record, ...]
    valid: tuple[Record, ...]

    @property
    def nominal(self) -> dict[str, float]:
        """What the data sheet says that no record tells, for the model's kind."""
        m = self.sheet.machine
        known = {'pole_pairs': m.pole_pairs, 'rated_torque': rated_torque(self.sheet)}
        return known | ({'v_free': self.sheet.supply} if m.corner else {})

    @property
    def motor(self) -> str:
        """Key of the motor kind."""
        return KINDS[self.kind][0]


def schedule(count: int) -> list[str]:
    """Return the names of `count` cases: of both kinds in turn, a third of them complete."""
    singles = {
        kind: [(key, size) for size in SIZES for key in HIDE if (kind, key) not in FOREIGN]
        for kind in KINDS
    }
    found: list[str] = []
    taken: Counter[str] = Counter()
    for k in range(count):
        kind = list(KINDS)[k % 2]
        place = k // 2
        if place % 3 == 0:
            name = f'{kind}/complete'
        else:
            key, size = singles[kind][(place - place // 3 - 1) % len(singles[kind])]
            name = f'{kind}/{key}/{100 * size:g}'
        found.append(f'{name}/{taken[name]}')
        taken[name] += 1
    return found


def draw(name: str, seed: int, seconds: float = 10.0) -> ThreePhaseCase:
    """Draw a case, ``six_step/coulomb_friction/3/0`` or ``pmsm/complete/1``; always the same.

    Raises
    ------
    UserError
        If there is no such case.
    """
    kind, *middle, number = name.split('/')
    effect, percent, *_ = [*middle, '', '']
    hides = effect in HIDE and (kind, effect) not in FOREIGN and percent.isdigit()
    sound = kind in KINDS and number.isdigit() and (effect == 'complete' or hides)
    if not sound:
        raise UserError(
            f'no case `{name}`; names look like `six_step/coulomb_friction/3/0` or '
            '`pmsm/complete/1`'
        )
    rng = np.random.default_rng([seed, int(number), *'/'.join((kind, *middle)).encode()])
    sheets = KINDS[kind][1]
    sheet = sheets[rng.integers(len(sheets))]
    hidden, size = Hidden(_machine(sheet, rng)), 0.0
    if effect != 'complete':
        size = float(percent) / 100
        hidden = HIDE[effect](hidden, size, sheet, rng)
    run = _six_step if kind == 'six_step' else _pmsm
    profiles = tuple(str(p) for p in rng.permutation(list(PROFILES))[:3])
    closed = tuple(bool(c) for c in rng.random(3) < 0.5)
    sensors = _sensors(sheet, rng)
    time = DT * np.arange(round(seconds / DT), dtype=np.float64)
    records = tuple(
        run(_Rig(hidden, sheet, sensors, rng), time, PROFILES[p], c, rng)
        for p, c in zip(profiles, closed, strict=True)
    )
    return ThreePhaseCase(
        name, kind, '' if effect == 'complete' else effect, size, sheet, hidden, profiles, closed,
        records[:2], records[2:],
    )  # fmt: skip


def _machine(sheet: MachineSheet, rng: np.random.Generator) -> Machine:
    m, off = sheet.machine, 1 + TOLERANCE * rng.uniform(-1, 1, 6)
    inertia = m.J * rng.uniform(1.5, 6.0)
    viscous = rng.uniform(0.02, 0.06) * rated_torque(sheet) / sheet.top_speed
    return Machine(
        m.R * off[0], m.L_d * off[1], m.L_q * (off[1] if m.L_d == m.L_q else off[2]),
        m.k_e * off[3], m.pole_pairs, inertia * off[4], viscous * off[5],
        corner=1e-3 if m.corner else 0.0,
    )  # fmt: skip


class Sensors(NamedTuple):
    """Angle of an encoder's step, rad; noise, step and offsets (3,) of the currents, A."""

    angle: float
    noise: float
    step: float
    offsets: Array


def _sensors(sheet: MachineSheet, rng: np.random.Generator) -> Sensors:
    return Sensors(
        2 * math.pi / float(rng.choice([2000, 4096, 10000])),
        float(rng.uniform(0.004, 0.01)) * sheet.current,
        4 * sheet.current / 2048,
        rng.uniform(-0.01, 0.01, 3) * sheet.current,
    )


class _Rig:
    """The machine, its bridge with delay and dead time, and its sensors."""

    def __init__(
        self, hidden: Hidden, sheet: MachineSheet, sensors: Sensors, rng: np.random.Generator
    ) -> None:
        self.hidden, self.sheet, self.sensors, self.rng = hidden, sheet, sensors, rng
        self.machine = Machine(*map(float, hidden.machine))
        self.x, self._work = np.zeros(STATES), np.zeros((6, STATES))
        self._count = 0
        self._late: list[tuple[float, float]] = [(0.0, 0.0)] * (2 + int(hidden.delay / DT))

    def currents(self) -> Array:
        """Return the (3,) currents as measured, A."""
        own = self.sensors
        seen = self.x[:3] + own.offsets + own.noise * self.rng.standard_normal(3)
        return np.asarray(own.step * np.round(seen / own.step))

    def angle(self) -> float:
        """Return the angle as the encoder shows it, rad."""
        return self.sensors.angle * math.floor(float(self.x[THETA]) / self.sensors.angle)

    def advance(self, first: float, second: float = 0.0) -> None:
        """Run one sample under the commanded voltage: across the pair, or on both axes."""
        self._late.append((first, second))
        whole, part = divmod(self.hidden.delay / DT, 1.0)
        newer, older = self._late[-1 - int(whole)], self._late[-2 - int(whole)]
        bridge = self.sheet.supply, self.hidden.dead, self.hidden.band
        _sample(
            self.machine, self.x, older, newer, round(part * STEPS), bridge, self._count * DT,
            self._work,
        )  # fmt: skip
        self._count += 1


@njit(cache=True, error_model='numpy')
def _sample(machine, x, older, newer, late, bridge, t, work):  # type: ignore[no-untyped-def]
    """Advance the state (6,) by a sample, the first `late` steps under the older command.

    A machine with a trapezoid is driven in six steps, commutated wherever it is, any other by a
    vector that turns with the rotor.
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
                angle += 0.5 * h * machine.pole_pairs * x[OMEGA]  # as it is halfway
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


def _six_step(
    rig: _Rig, time: Array, profile: Profile, closed: bool, rng: np.random.Generator
) -> Record:
    """Return a record of a six-step drive: voltage as the profile says, or a PI speed loop."""
    m, sheet = rig.hidden.machine, rig.sheet
    slow = m.J * 2 * m.R / (2 * m.k_e) ** 2
    shape, level = profile(time, slow, rng), float(rng.uniform(0.25, 0.6))
    bearable = min(sheet.supply, _BEARABLE * sheet.current * 2 * m.R / 0.6)
    want = level * shape * (0.7 * sheet.top_speed if closed else bearable)
    faster = rng.uniform(1.5, 4.0)
    kp, total, before = 2 * m.k_e * (faster - 1), 0.0, 0.0
    ki = kp * faster / (3 * slow)
    columns: dict[str, list[float]] = {name: [] for name in (
        'voltage', 'current', 'speed', 'position', 'hall_sector', 'current_a', 'current_b',
        'current_c')}  # fmt: skip

    for k in range(time.size):
        seen, angle = rig.currents(), rig.angle()
        speed, before = (angle - before) / DT, angle
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


def _pmsm(
    rig: _Rig, time: Array, profile: Profile, closed: bool, rng: np.random.Generator
) -> Record:
    """Return a record under field-oriented control: speed, or without a speed loop torque."""
    m, sheet, hidden = rig.hidden.machine, rig.sheet, rig.hidden
    bandwidth = 0.25 / (DT + 2 * hidden.delay)
    inertial = m.J / (1.5 * m.k_e)
    shape, top = profile(time, 20.0 / bandwidth, rng), 0.4 * sheet.top_speed
    want, before, sums = rng.uniform(0.4, 0.9) * top * shape, 0.0, np.zeros(3)
    place = np.searchsorted(np.cumsum(rng.uniform(0.02, 0.1, 999)), time)
    pulses = 0.15 * sheet.current * rng.uniform(-1.0, 1.0, (2, 1000))[:, place]
    pulses[:, time < 0.5] = 0.0
    columns: dict[str, list[float]] = {name: [] for name in (
        'voltage_d', 'voltage_q', 'current_d', 'current_q', 'speed', 'position')}  # fmt: skip
    reach = sheet.supply / math.sqrt(3)

    for k in range(time.size):
        seen, angle = rig.currents(), rig.angle()
        speed, before = (angle - before) / DT, angle
        turned = m.pole_pairs * angle
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


