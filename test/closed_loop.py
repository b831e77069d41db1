"""Samples of a known motor under a speed controller, with reversals and real sensors."""

from functools import cache

import numpy as np

from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.stepper import Stepper

DT = 1e-3
TRUE = {'R': 1.2, 'L': 1.5e-3, 'k_t': 0.055, 'J': 8e-5, 'b': 3e-5, 'current_offset': 0.08}
WRONG = {'R': 2.0, 'L': 1e-3, 'k_t': 0.08, 'J': 1.6e-4, 'b': 6e-5}
FRICTION = 0.012
LEVELS = (1, -1, 0.5, -0.3, 1, 0.2, -1, 0.7, -0.6, 0.1)


def true_motor(**changes: float) -> Model:
    """Return the motor with Coulomb friction."""
    model = Model.base('brushed_dc', {**TRUE, **changes})
    return model.with_effect('coulomb_friction', {'tau_c': FRICTION})


def wrong_motor() -> Model:
    """Return a start that is up to a factor of two off and knows no friction."""
    model = Model.base('brushed_dc', WRONG, speed_sensor=SpeedSensor.DIFFERENCE)
    return model.with_effect('coulomb_friction')


def drive(truth: Model, seconds: float, seed: int, counts: int) -> np.ndarray:
    """Return (N, 5) time, voltage, current, speed, position; see `samples`."""
    rng = np.random.default_rng(seed)
    plant, quantum = Stepper(truth, DT, substeps=8), 2 * np.pi / counts
    rows, integral, before = np.zeros((round(seconds / DT), 5)), 0.0, 0.0
    for k, row in enumerate(rows):
        t, state = k * DT, plant.state
        angle = np.floor(state['theta'] / quantum) * quantum
        speed, before = (angle - before) / DT, angle
        level = 60 * LEVELS[int(t / 0.5) % len(LEVELS)]
        error = level * (0.5 + 0.5 * np.sin(2 * np.pi * 0.9 * t) ** 2) - speed
        integral = np.clip(integral + 1.0 * error * DT, -24, 24)
        volts = float(np.clip(0.15 * error + integral, -24, 24))
        current = state['i'] + truth['current_offset'] + 0.02 * rng.standard_normal()
        row[:] = t, volts, current, speed, angle
        plant.step(volts)
    return rows


@cache
def samples(seconds: float = 5.0, seed: int = 0, counts: int = 4096) -> np.ndarray:
    """Return samples of the true motor.

    The encoder has that many counts, the speed is their difference over the last sample, the
    current has 0.02 A of noise and an offset; the plant is integrated in eight parts a sample.
    """
    return drive(true_motor(), seconds, seed, counts)
