"""Draw cases of three-phase motors: a machine on its drive with something hidden, and its records.

Two kinds, as users record them at 1 kHz:

* ``six_step``: a brushless motor with Hall sensors.  Both legs that drive chop complementarily,
  the third is off, and commutation follows the rotor, not the samples.  Recorded are the voltage
  across the pair, half the difference of its two currents, the phases, sector, position and speed.
* ``pmsm``: a synchronous motor under field-oriented control with one voltage vector a sample in
  the rotor's frame.  Recorded are both axes, position and speed.

The machine and its drive are simulated in `three_phase_rig`.
"""

from collections import Counter
from dataclasses import dataclass
import math

import numpy as np

from motor_sysid.benchmark.excitation import PROFILES
from motor_sysid.benchmark.machine import BLDC_SHEETS, Machine, MachineSheet, PMSM_SHEETS
from motor_sysid.benchmark.three_phase_hidden import HIDE, rated_torque
from motor_sysid.benchmark.three_phase_rig import DT, Hidden, pmsm, Rig, Sensors, six_step
from motor_sysid.errors import UserError
from motor_sysid.signals.record import Record

SIZES = (0.03, 0.1)
"""Sizes of what is hidden, as fractions."""

TOLERANCE = 0.12
"""Largest relative deviation of a true parameter from the data sheet."""


KINDS = {'six_step': ('bldc_six_step', BLDC_SHEETS), 'pmsm': ('pmsm', PMSM_SHEETS)}
"""Kind of a case to the motor kind of its model, and the data sheets it is drawn from."""

FOREIGN = {
    ('six_step', 'emf_harmonics'),
    ('six_step', 'rotor_angle_lag'),
    ('six_step', 'voltage_angle_lag'),
}
"""What a kind of motor does not have: a trapezoid is all harmonics, and six steps know no axes."""


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

    Each record lasts `seconds`; a step of the load comes after 3 to 7 s, whatever they are.

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
    run = six_step if kind == 'six_step' else pmsm
    profiles = tuple(str(p) for p in rng.permutation(list(PROFILES))[:3])
    closed = tuple(bool(c) for c in rng.random(3) < 0.5)
    sensors = _sensors(sheet, rng)
    time = DT * np.arange(round(seconds / DT), dtype=np.float64)
    records = tuple(
        run(Rig(hidden, sheet, sensors, rng), time, PROFILES[p], c, rng)
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


def _sensors(sheet: MachineSheet, rng: np.random.Generator) -> Sensors:
    return Sensors(
        2 * math.pi / float(rng.choice([2000, 4096, 10000])),
        float(rng.uniform(0.004, 0.01)) * sheet.current,
        4 * sheet.current / 2048,
        rng.uniform(-0.01, 0.01, 3) * sheet.current,
    )
