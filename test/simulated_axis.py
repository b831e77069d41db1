"""An axis that is simulated in steps finer than those of the models."""

import math

import numpy as np

from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

AXIS = Model.base('mechanical_axis', {'J': 0.02, 'b': 0.667})
UNITS = {'torque': 'N m', 'speed': 'rad/s', 'position': 'rad'}
EXACT = 8
"""Steps a sample of what is simulated here."""


def axis(seconds, seed=1, *, dry=0.0, names=('torque', 'speed'), zero=0.0):
    """Return a record of an axis at 1 kHz with steps of its torque, and dry friction."""
    rng, rows, dt = np.random.default_rng(seed), round(1000 * seconds), 1e-3 / EXACT
    torque = np.repeat(rng.uniform(-1.0, 1.0, rows // 50 + 1), 50)[:rows]
    angle, speed, x, w = np.empty(rows), np.empty(rows), zero, 0.0
    for k in range(rows):
        angle[k], speed[k] = x, w
        for _ in range(EXACT):
            rate = (torque[k] - 0.667 * w - dry * math.tanh(w / 0.02)) / 0.02
            x, w = x + dt * w + 0.5 * dt * dt * rate, w + dt * rate
    signals = {
        'torque': torque, 'speed': speed + 0.01 * rng.normal(size=rows),
        'position': angle + 2e-4 * rng.normal(size=rows),
    }  # fmt: skip
    time = 1e-3 * np.arange(rows)
    return Record(time, {n: signals[n] for n in names}, {n: UNITS[n] for n in names})
