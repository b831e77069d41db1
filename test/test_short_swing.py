"""An arm that swings by a few degrees: most of its weight is never held, and yet found."""

import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.signals.record import Record

INERTIA, FRICTION, WEIGHT, DT, FINER = 0.16, 0.13, 4.7, 4e-3, 10
COUNT = 2 * np.pi / 65536


def rate(state, torque):
    angle, speed = state
    return np.array([speed, (torque - FRICTION * speed - WEIGHT * np.sin(angle)) / INERTIA])


def swung(seed: int) -> Record:
    """Return an arm that hangs and is moved by up to 0.1 rad; truth is Runge and Kutta's."""
    rows, step = 2500, DT / FINER
    time = DT * np.arange(rows)
    torque = 0.1 * np.sin(2 * np.pi * (0.2 + 0.1 * seed + 0.03 * time) * time)
    torque += 0.05 * np.repeat(np.random.default_rng(seed).choice([-1.0, 1.0], 5), 500)
    state, angles = np.zeros(2), np.empty(rows)
    for k in range(rows):
        angles[k] = state[0]
        for _ in range(FINER):
            first = rate(state, torque[k])
            second = rate(state + 0.5 * step * first, torque[k])
            third = rate(state + 0.5 * step * second, torque[k])
            fourth = rate(state + step * third, torque[k])
            state = state + step / 6 * (first + 2 * second + 2 * third + fourth)
    position = COUNT * np.floor(angles / COUNT)
    speed = np.diff(position, prepend=position[0]) / DT
    signals = {'torque': torque, 'position': position, 'speed': speed}
    return Record(time, signals, {'torque': 'N m', 'position': 'rad', 'speed': 'rad/s'})


def test_a_weight_that_is_never_held_is_found():
    train, held = [swung(1), swung(2)], [swung(3)]
    assert max(np.abs(r['position']).max() for r in train) < 0.15
    assert 10.0 * max(np.sqrt(np.mean(r['torque'] ** 2)) for r in train) < WEIGHT
    candidates = 'gravity_load', 'coulomb_friction', 'input_delay', 'flexible_shaft'
    found = diagnose(train, held, effects=candidates)
    assert (found.verdict, found.effects) == (Verdict.EFFECT_MISSING, ('gravity_load',))
    model = found.steps[-1].model
    assert model['gravity_load.tau_sin'] == pytest.approx(WEIGHT, rel=5e-3)
    assert model['J'] == pytest.approx(INERTIA, rel=5e-3)
    assert 'the motor can swing it, not hold it' in found.evidence[0].words
