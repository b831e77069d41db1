"""Records of three-phase motors in closed loop, from the independent simulator."""

import numpy as np

from motor_sysid.benchmark.machine import BLDC_SHEETS, Bridge, Machine, PMSM_SHEETS
from motor_sysid.benchmark.three_phase_drive import (
    phase_record,
    PhaseSensors,
    run_drive,
    ThreePhaseDrive,
)
from motor_sysid.control.foc import CurrentLoop
from motor_sysid.control.six_step import SixStepLoop
from motor_sysid.control.tuning import current_pi
from motor_sysid.signals.record import Record

PMSM = PMSM_SHEETS[1].machine._replace(L_q=1.5 * PMSM_SHEETS[1].machine.L_d)
BLDC = BLDC_SHEETS[2].machine
SENSORS = PhaseSensors(
    counts=4096, noise=0.02, offsets=(0.03, -0.02, 0.01), full_scale=10.0, bits=12
)
IDEAL = PhaseSensors(counts=0, noise=0.0, bits=0)


def speeds(seconds: float, dt: float, rng: np.random.Generator, top: float) -> np.ndarray:
    """Return random levels, and slow swings through zero in the last fifth of 2.5 s."""
    time = dt * np.arange(round(seconds / dt))
    levels, edges = rng.uniform(-top, top, 200), np.cumsum(rng.uniform(0.1, 0.4, 199))
    slow = 0.25 * top * np.sin(2 * np.pi * 0.7 * time)
    reference = np.where(time % 2.5 > 2.0, slow, levels[np.searchsorted(edges, time)])
    return np.where(time < 0.1, 0.0, reference)


def pmsm_record(
    seconds: float = 5.0, dt: float = 5e-4, *, seed: int = 1, dead: float = 0.0,
    sensors: PhaseSensors = SENSORS, push_d: float = 1.0, top: float = 250.0,
    machine: Machine = PMSM, supply: float = 24.0, most: float = 5.0, computes: bool = False,
    ahead: float = 0.5, **hidden: float,
) -> tuple[Machine, Record]:  # fmt: skip
    """Return a salient motor under field-oriented control, with pulses of d current."""
    m, rng = machine._replace(**hidden), np.random.default_rng(seed)
    loop = CurrentLoop(m.R, m.L_d, m.L_q, m.k_e / m.pole_pairs, 1500.0)
    speed = current_pi(m.J, 1.5 * m.k_e, 60.0, most)
    reference = speeds(seconds, dt, rng, top)
    time = dt * np.arange(reference.size)
    place = np.searchsorted(np.cumsum(rng.uniform(0.02, 0.1, 399)), time)
    pulses = push_d * rng.choice([-1.0, 0.0, 1.0], 400)[place]
    drive = ThreePhaseDrive(Bridge(supply, dead), loop, speed, 1e-4, sensors, computes, ahead)
    run = run_drive(m, drive, reference, dt, rng, pulses)
    return m, phase_record(run, m.pole_pairs)


def traction_record(seconds: float, seed: int = 1) -> tuple[Machine, Record]:
    """Return a traction machine with inner magnets at a third of its current."""
    sheet = PMSM_SHEETS[2]
    sensors = PhaseSensors(counts=4096, noise=0.3, offsets=(0.6, -0.4, 0.2), full_scale=200.0)
    return pmsm_record(
        seconds, seed=seed, sensors=sensors, push_d=0.3 * sheet.current, top=160.0,
        machine=sheet.machine, supply=sheet.supply, most=sheet.current,
    )  # fmt: skip


def bldc_record(
    seconds: float = 2.5, dt: float = 1e-4, *, seed: int = 1, dead: float = 0.0,
    sensors: PhaseSensors = SENSORS, top: float = 150.0, **hidden: float,
) -> tuple[Machine, Record]:  # fmt: skip
    """Return a motor under six-step commutation with its floating phase."""
    m, rng = BLDC._replace(**hidden), np.random.default_rng(seed)
    loop = SixStepLoop(m.R, m.L_d, m.k_e, 1500.0, 3.5)
    speed = current_pi(m.J, 2 * m.k_e, 60.0, 3.5)
    drive = ThreePhaseDrive(Bridge(24.0, dead), loop, speed, min(dt, 1e-4), sensors)
    run = run_drive(m, drive, speeds(seconds, dt, rng, top), dt, rng)
    return m, phase_record(run, m.pole_pairs)
