"""The eleven perturbations of motors (P1 to P11) as records of a truth that is known.

The list is that of Wee and Ahmad 2025, doi:10.32604/cmes.2025.063611, Figures 28 to 32.  What each
stands for is an entry of the catalogue of effects, a sensor, or how the motor is driven; the motor
is that of the independent simulator, in closed loop, with dry friction.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.cases import slow_time
from motor_sysid.benchmark.datasheets import DATA_SHEETS, DataSheet
from motor_sysid.benchmark.excitation import random_steps
from motor_sysid.benchmark.hidden import HIDE, Situation
from motor_sysid.benchmark.hidden_sensors import HIDE_SENSOR
from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.sensors import measure, Sensors
from motor_sysid.benchmark.truth import Control, run, Truth
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

DT = 1e-3
MOTORS = ('maxon RE 35 30 V', 'Faulhaber 3863H024CR', 'Faulhaber 1524T012SR')
COUNTS = 4096.0

_FRICTION, _VISCOUS = 0.03, 0.03
_MEMORY = 0.05


@dataclass(frozen=True)
class Perturbation:
    """One way to perturb a motor.

    Attributes
    ----------
    code, title:
        Its number in the paper's list, and in words.
    effects, size:
        Keys of the effects that are hidden, and their size; see `motor_sysid.benchmark.hidden`.
    speed:
        Largest speed reference over the no-load speed.
    noise:
        Factor of the current sensor's noise, by which the encoder is coarser, too.
    torque:
        Standard deviation of a random torque over the rated one.
    eccentricity:
        Largest error of the encoder's angle, once a turn, rad.
    """

    code: str
    title: str
    effects: tuple[str, ...] = ()
    size: float = 0.1
    speed: float = 0.4
    noise: float = 1.0
    torque: float = 0.0
    eccentricity: float = 0.0


PERTURBATIONS = (
    Perturbation('P0', 'none'),
    Perturbation('P1', 'speed: to 80 % of no-load, with drag', ('quadratic_drag',), speed=0.8),
    Perturbation('P2', 'load: a step of 30 %', ('load_torque_step',), 0.3),
    Perturbation('P3', 'noise: eightfold, coarse encoder', noise=8.0),
    Perturbation('P4', 'friction: Stribeck', ('stribeck_friction',)),
    Perturbation('P5', 'voltage: a supply that sags', ('supply_sag',)),
    Perturbation('P6', 'disturbance: random torque of 5 %', torque=0.05),
    Perturbation('P7', 'current: sensor gain off by 5 %', ('current_sensor_scale',), 0.05),
    Perturbation('P8', 'position: encoder off centre by 0.3 degrees', eccentricity=5e-3),
    Perturbation('P9', 'heat: resistance rises by a quarter', ('armature_heating',)),
    Perturbation('P10a', 'discontinuity: inertia steps by 50 %', ('inertia_change',)),
    Perturbation('P10b', 'discontinuity: backlash of 2 degrees', ('backlash',)),
    Perturbation('P11', 'hysteresis: bristle friction (LuGre)', ('lugre_friction',)),
)
"""In the order of the paper, after an unperturbed motor."""


@dataclass(frozen=True)
class Run:
    """A record and what is true at each of its samples.

    Attributes
    ----------
    sheet, record:
        Data sheet and record.
    true:
        Parameter to (N,) true values: R, L, k_t, J, b, and the load torque.
    """

    sheet: DataSheet
    record: Record
    true: Mapping[str, Array]


def perturbed_run(perturbation: Perturbation, motor: int, seconds: float, seed: int) -> Run:
    """Return the run of one motor; the same arguments give the same run."""
    rng = np.random.default_rng([seed, motor, *perturbation.code.encode()])
    sheet = next(s for s in DATA_SHEETS if s.name == MOTORS[motor % len(MOTORS)])
    plant, sensors = _plant(sheet, rng), _sensors(sheet, perturbation)
    count = round(seconds / DT)
    control = _control(sheet, plant, perturbation.speed, count, rng)
    loss = plant.R * float(np.mean(run(plant, control, DT).current ** 2))
    situation = Situation(sheet, seconds, loss)
    for key in perturbation.effects:
        if key in HIDE_SENSOR:
            sensors = HIDE_SENSOR[key](sensors, perturbation.size, situation, rng)
        else:
            plant = HIDE[key](plant, perturbation.size, situation, rng)
    torque = _random_torque(perturbation.torque * sheet.torque, count, rng)
    truth = run(plant, control, DT, torque)
    turned = truth.position + perturbation.eccentricity * np.sin(truth.position)
    record = measure(replace(truth, position=turned), sensors, DT, rng, control.reference)
    return Run(sheet, record, _true(plant, truth))


def _plant(sheet: DataSheet, rng: np.random.Generator) -> Plant:
    inertia = sheet.J * (1 + 0.5 * sum(sheet.load))
    viscous = _VISCOUS * sheet.torque / sheet.top_speed
    off = np.exp(0.1 * rng.standard_normal(5))
    tau = _FRICTION * sheet.torque
    return Plant(
        sheet.R * off[0], sheet.L * off[1], sheet.k * off[2], inertia * off[3], viscous * off[4],
        tau_plus=tau, tau_minus=tau,
    )  # fmt: skip


def _sensors(sheet: DataSheet, perturbation: Perturbation) -> Sensors:
    reach = min(sheet.voltage / sheet.R, 10 * sheet.current)
    return Sensors(
        counts=COUNTS / perturbation.noise,
        tacho_noise=0.0,
        current_noise=0.005 * perturbation.noise * sheet.current,
        current_step=2 * reach / 4096,
        current_offset=0.01 * sheet.current,
        position=False,
    )


def _control(
    sheet: DataSheet, plant: Plant, speed: float, count: int, rng: np.random.Generator
) -> Control:
    """Return a PI speed controller and its reference: random steps both ways."""
    time, slow = DT * np.arange(count, dtype=np.float64), slow_time(plant)
    reference = speed * sheet.top_speed * random_steps(time, slow, rng)
    faster = min(3.0, 0.1 * slow / DT + 1.0)
    kp = plant.k * max(faster - 1, 0.2)
    resolution = sheet.voltage / 1000
    return Control(
        reference, kp, kp / (3 * slow) + plant.k / (3 * slow), sheet.voltage, resolution, COUNTS
    )


def _random_torque(sigma: float, count: int, rng: np.random.Generator) -> Array | None:
    if sigma == 0.0:
        return None
    keep, torque = np.exp(-DT / _MEMORY), np.zeros(count)
    white = sigma * np.sqrt(1 - keep**2) * rng.standard_normal(count)
    for j in range(1, count):
        torque[j] = keep * torque[j - 1] + white[j]
    return torque


def _true(plant: Plant, truth: Truth) -> dict[str, Array]:
    """Return parameter to (N,) values, those that change as they do."""
    time = DT * np.arange(truth.voltage.size, dtype=np.float64)
    one = np.ones_like(time)
    after = np.asarray(time >= plant.inertia_time, dtype=np.float64)
    load = np.asarray(time >= plant.step_time, dtype=np.float64)
    return {
        'R': plant.R * (1 + plant.heat * truth.energy),
        'L': plant.L * one,
        'k_t': plant.k * one,
        'J': plant.J * (1 + plant.inertia_gain * after),
        'b': plant.b * one,
        'constant_load_torque.tau_l': plant.tau_l + plant.step_torque * load,
    }
