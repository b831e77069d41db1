"""Where a run begins in motion and its sensor filters: it shows what was a time constant ago."""

import numpy as np
import pytest
from scipy.linalg import expm

from motor_sysid.diagnosis.where.compare import compare
from motor_sysid.estimation.batch import fit, make_chain, Problem, starts_of
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.signals.record import Record

INERTIA, FRICTION, LAG, DT, ROWS, BEFORE = 0.24, 0.17, 0.03, 0.01, 3000, 200
AXIS, OUTPUT = motor('mechanical_axis'), ('speed',)
VALUES = {'J': INERTIA, 'b': FRICTION}


def recorded(stepwise: bool) -> tuple[Record, float]:
    """Return a record that begins in motion, and the speed there; the truth is exact.

    The filter takes the speed itself, or sample by sample its mean over the last sample.
    """
    rate = np.array([[0.0, 1.0, 0.0], [0.0, -FRICTION / INERTIA, 0.0], [0.0, 1 / LAG, -1 / LAG]])
    push = np.array([[0.0], [1 / INERTIA], [0.0]])
    step = expm(DT * np.block([[rate, push], [np.zeros((1, 4))]]))
    time = DT * np.arange(ROWS)
    torque = 6.0 * np.sin(4.0 * time) + 3.0 * np.sin(11.0 * time + 0.2 * time**2 / 5)
    x, states = np.zeros(3), np.empty((ROWS, 3))
    for k in range(ROWS):
        states[k] = x
        x = step[:3, :3] @ x + step[:3, 3] * torque[k]
    angle, shown = states[:, 0], states[:, 2]
    if stepwise:
        shown = np.zeros(ROWS)
        for k in range(1, ROWS):
            mean = (angle[k] - angle[k - 1]) / DT
            shown[k] = shown[k - 1] - np.expm1(-DT / LAG) * (mean - shown[k - 1])
    signals = {'torque': torque, 'position': angle, 'speed': shown}
    units = {'torque': 'N m', 'position': 'rad', 'speed': 'rad/s'}
    kept = {name: values[BEFORE:] for name, values in signals.items()}
    return Record(time[BEFORE:], kept, units), float(states[BEFORE, 1])


@pytest.mark.parametrize('sensor', [SpeedSensor.IDEAL, SpeedSensor.DIFFERENCE])
def test_a_run_begins_at_the_speed_behind_a_filter(sensor):
    record, speed = recorded(sensor is SpeedSensor.DIFFERENCE)
    base = Model.base('mechanical_axis', VALUES).with_speed_sensor(sensor)
    model = base.with_effect('speed_sensor_lag', {'lag': LAG})
    chain = make_chain(record, AXIS, OUTPUT)
    table = {name: np.array([value]) for name, value in model.parameters.values().items()}
    (start,) = starts_of(model, table, chain)
    shown = float(record['speed'][0])
    assert abs(shown - speed) > 0.1 * abs(speed)
    omega = AXIS.states.index('omega')
    assert start[0, omega] == pytest.approx(speed, rel=0.02)
    assert start[0, -1] == pytest.approx(shown, abs=1.05 * abs(chain[0].rate[omega]) * DT)
    assert compare(model, [chain], OUTPUT).error_percent < 0.15
    (plain,) = starts_of(base, {k: table[k] for k in base.parameters.values()}, chain)
    assert plain.shape == (2,)


def test_a_fit_finds_the_lag_of_a_record_that_begins_in_motion():
    record, _ = recorded(stepwise=False)
    start = Model.base('mechanical_axis', {'J': 0.3, 'b': 0.1}).with_effect(
        'speed_sensor_lag', {'lag': 0.01}
    )
    found = fit(Problem(start, [make_chain(record, AXIS, OUTPUT)], OUTPUT)).model
    assert found['speed_sensor_lag.lag'] == pytest.approx(LAG, rel=2e-3)
    assert found['J'] == pytest.approx(INERTIA, rel=2e-3)
