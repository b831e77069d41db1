"""Draw cases: a motor with something hidden in it, and its records."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.datasheets import DATA_SHEETS, DataSheet
from motor_sysid.benchmark.excitation import PROFILES
from motor_sysid.benchmark.hidden import HIDE, Situation
from motor_sysid.benchmark.hidden_sensors import HIDE_SENSOR
from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.scenarios import Scenario
from motor_sysid.benchmark.sensors import clean, measure, Sensors
from motor_sysid.benchmark.truth import Control, run, Truth
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

TOLERANCE = 0.15
"""Largest relative deviation of a true parameter from the data sheet."""


@dataclass(frozen=True)
class Setting:
    """One motor on one bench: everything that is drawn by chance.

    Attributes
    ----------
    sheet, plant, sensors:
        Data sheet, true motor, sensors.
    dt, duration:
        Sample time and length of a record, s.
    profiles:
        Excitation of each record, the last one for validation.
    closed:
        For each record whether a PI controller follows the profile.
    process:
        Standard deviation (N m) and correlation time (s) of a random torque.
    """

    sheet: DataSheet
    plant: Plant
    sensors: Sensors
    dt: float
    duration: float
    profiles: tuple[str, ...]
    closed: tuple[bool, ...]
    process: tuple[float, float]


@dataclass(frozen=True)
class Case:
    """A motor with its records and what is true about it.

    Attributes
    ----------
    scenario, setting:
        What was asked for and what was drawn; ``setting.plant`` holds the hidden effects.
    train, valid:
        Records.
    floor_percent:
        Signal to the error that the sensors alone make in the validation record, in percent of
        the RMS of the measured signal.
    number:
        Which of the cases of the scenario.
    """

    scenario: Scenario
    setting: Setting
    train: tuple[Record, ...]
    valid: tuple[Record, ...]
    floor_percent: dict[str, float]
    number: int = 0


def draw(scenario: Scenario, seed: int, number: int) -> Case:
    """Draw a case; the same arguments give the same case, whatever else is drawn."""
    rng = np.random.default_rng([seed, number, *scenario.key.encode()])
    setting = _hidden(_setting(rng), scenario, rng)
    start = _settled(setting.plant, rng)
    runs = [_record(setting, k, start, rng) for k in range(len(setting.profiles))]
    records = tuple(record for record, _ in runs)
    floor = _floor(records[-1], clean(runs[-1][1], setting.sensors, setting.dt))
    return Case(scenario, setting, records[:-1], records[-1:], floor, number)


def _setting(rng: np.random.Generator) -> Setting:
    sheet = DATA_SHEETS[rng.integers(len(DATA_SHEETS))]
    plant = _plant(sheet, rng)
    profiles = rng.permutation(list(PROFILES))[:3]
    return Setting(
        sheet=sheet,
        plant=plant,
        sensors=_sensors(sheet, rng),
        dt=1.0 / float(rng.choice(sheet.rates)),
        duration=float(rng.integers(10, 16)),
        profiles=tuple(profiles.tolist()),
        closed=tuple((rng.random(3) < [0.2, 0.2, 0.4]).tolist()),
        process=_process(sheet, rng),
    )


def _plant(sheet: DataSheet, rng: np.random.Generator) -> Plant:
    off = 1 + TOLERANCE * rng.uniform(-1, 1, 5)
    inertia = sheet.J * (1 + rng.uniform(*sheet.load))
    viscous = rng.uniform(0.02, 0.06) * sheet.torque / sheet.top_speed
    return Plant(
        sheet.R * off[0], sheet.L * off[1], sheet.k * off[2], inertia * off[3], viscous * off[4]
    )


def _sensors(sheet: DataSheet, rng: np.random.Generator) -> Sensors:
    stall = sheet.voltage / sheet.R
    reach = min(stall, 10 * sheet.current)
    tacho = rng.random() < 0.15
    counts = float(rng.choice(sheet.counts))
    return Sensors(
        counts=0.0 if tacho else counts,
        tacho_noise=float(rng.uniform(0.5e-3, 2e-3)) * sheet.top_speed,
        current_noise=float(rng.uniform(0.004, 0.01)) * sheet.current,
        current_step=2 * reach / 4096,
        current_offset=float(rng.uniform(-0.015, 0.015)) * sheet.current,
        position=bool(rng.random() < 0.75),
    )


def _process(sheet: DataSheet, rng: np.random.Generator) -> tuple[float, float]:
    if rng.random() > 0.2:
        return 0.0, 1.0
    return float(rng.uniform(0.002, 0.01)) * sheet.torque, float(rng.uniform(0.02, 0.1))


def _hidden(setting: Setting, scenario: Scenario, rng: np.random.Generator) -> Setting:
    """Hide the effects of a scenario; the losses are those of the motor without them."""
    plant, sensors = setting.plant, setting.sensors
    loss = 1.0
    if 'armature_heating' in scenario.effects:
        loss = _loss(setting)
    situation = Situation(setting.sheet, setting.duration, loss)
    for key in scenario.effects:
        if key in HIDE_SENSOR:
            sensors = HIDE_SENSOR[key](sensors, scenario.size, situation, rng)
        else:
            plant = HIDE[key](plant, scenario.size, situation, rng)
    return replace(setting, plant=plant, sensors=sensors)


def _loss(setting: Setting) -> float:
    """Mean loss in the winding over the records, W."""
    losses = []
    for k in range(len(setting.profiles)):
        control, _ = _control(setting, k, np.random.default_rng(k))
        truth = run(setting.plant, control, setting.dt)
        losses.append(setting.plant.R * float(np.mean(truth.current**2)))
    return max(float(np.mean(losses)), 1e-9)


def slow_time(plant: Plant) -> float:
    """Mechanical time constant, s."""
    return plant.J * plant.R / (plant.k**2 + plant.b * plant.R)


def _control(
    setting: Setting, k: int, rng: np.random.Generator
) -> tuple[Control, Array | None]:
    """Return what drives record `k`, and its speed reference if there is one."""
    plant, sheet = setting.plant, setting.sheet
    count = round(setting.duration / setting.dt)
    time = setting.dt * np.arange(count, dtype=np.float64)
    slow = slow_time(plant)
    shape = PROFILES[setting.profiles[k]](time, slow, rng)
    supply = sheet.voltage
    resolution = supply / float(rng.choice([500, 1000, 2000]))
    if not setting.closed[k]:
        level = rng.uniform(0.25, 0.7) * supply
        return Control(level * shape, limit=supply, resolution=resolution), None
    reference = rng.uniform(0.2, 0.5) * sheet.top_speed * shape
    faster = min(rng.uniform(1.5, 4.0), 0.1 * slow / setting.dt + 1.0)
    kp = plant.k * max(faster - 1, 0.2)
    ki = kp * faster / (3 * slow)
    control = Control(reference, kp, ki, supply, resolution, setting.sensors.counts)
    return control, reference


def _settled(plant: Plant, rng: np.random.Generator) -> Array:
    """Return the state at rest: a free rotor turns to where position-dependent torques hold it."""
    state = np.zeros(6)
    if plant.gravity == 0.0 and plant.cogging == 0.0:
        return state
    angle = np.linspace(-np.pi, np.pi, 20001)
    torque = (
        plant.cogging * np.sin(plant.order * angle + plant.cogging_angle)
        + plant.second * np.sin(2 * plant.order * angle + plant.second_angle)
        - plant.gravity * np.sin(angle - plant.gravity_angle)
    )
    stable = np.flatnonzero((torque[:-1] > 0) & (torque[1:] <= 0))
    state[2] = state[4] = angle[rng.choice(stable)]
    return state


def _record(
    setting: Setting, k: int, start: Array, rng: np.random.Generator
) -> tuple[Record, Truth]:
    control, reference = _control(setting, k, rng)
    truth = run(
        setting.plant, control, setting.dt, _random_torque(setting, control.reference.size, rng),
        start,
    )  # fmt: skip
    return measure(truth, setting.sensors, setting.dt, rng, reference), truth


def _random_torque(setting: Setting, count: int, rng: np.random.Generator) -> Array | None:
    sigma, memory = setting.process
    if sigma == 0.0:
        return None
    keep = np.exp(-setting.dt / memory)
    white = sigma * np.sqrt(1 - keep**2) * rng.standard_normal(count)
    torque = np.zeros(count)
    for j in range(1, count):
        torque[j] = keep * torque[j - 1] + white[j]
    return torque


def _floor(record: Record, exact: dict[str, Array]) -> dict[str, float]:
    return {
        name: 100 * float(np.std(record[name] - values) / np.sqrt(np.mean(record[name] ** 2)))
        for name, values in exact.items()
    }
