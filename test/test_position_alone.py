"""A robot's joint that tells its torque and counts of its position: an arm under gravity."""

import numpy as np
import pytest

from motor_sysid.diagnosis.where.compare import compare
from motor_sysid.estimation.batch import fit, make_chain, Problem
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

INERTIA, FRICTION, WEIGHT, COUNT = 0.022, 0.04, 0.47, 2 * np.pi / 4096
RATE, FINER, SECONDS, LEVEL = 500, 10, 12.0, 0.8
AXIS = motor('mechanical_axis')
OUTPUT = ('position',)


@pytest.fixture(scope='module')
def arm() -> Record:
    """Return an arm that a PD controller moves about where it hangs.

    Truth is Runge and Kutta's in a tenth of the sample.
    """
    rng = np.random.default_rng(11)
    rows = round(SECONDS * RATE)
    aims = np.repeat(rng.uniform(-1.2, 1.2, round(SECONDS / LEVEL)), round(LEVEL * RATE))
    state, step = np.zeros(2), 1.0 / RATE / FINER
    torque, position = np.empty(rows), np.empty(rows)
    for k in range(rows):
        position[k] = COUNT * np.round(state[0] / COUNT)
        time = k / RATE
        shaken = 0.05 * np.sin(2 * np.pi * (0.5 + 0.4 * time) * time)
        torque[k] = 2.0 * (aims[k] - position[k]) - 0.25 * state[1] + shaken
        for _ in range(FINER):
            state = _next(state, torque[k], step)
    signals = {'torque': torque, 'position': position}
    return Record(np.arange(rows) / RATE, signals, {'torque': 'N m', 'position': 'rad'})


def _next(state, torque, step):
    """Return the state (angle, speed) a step later."""

    def rate(at):
        left = torque - FRICTION * at[1] - WEIGHT * np.sin(at[0])
        return np.array([at[1], left / INERTIA])

    first = rate(state)
    second = rate(state + 0.5 * step * first)
    third = rate(state + 0.5 * step * second)
    fourth = rate(state + step * third)
    return state + step / 6 * (first + 2 * second + 2 * third + fourth)


def truth() -> Model:
    """Return the model of the arm, with parameters of its own."""
    model = Model.base('mechanical_axis', {'J': INERTIA, 'b': FRICTION})
    return model.with_effect('gravity_load', {'tau_sin': WEIGHT, 'tau_cos': 0.0})


def test_a_load_that_pulls_back_is_no_negative_inertia():
    """Over windows of a fiftieth of the record gravity outweighs the inertia of a slow arm."""
    time = np.arange(30 * RATE) / RATE
    angle, speed, acceleration = np.zeros((3, time.size))
    for size, pace in ((0.8, 2.0), (0.3, 3.7), (0.15, 9.0)):
        angle += size * np.sin(pace * time)
        speed += size * pace * np.cos(pace * time)
        acceleration -= size * pace**2 * np.sin(pace * time)
    torque = INERTIA * acceleration + FRICTION * speed + WEIGHT * np.sin(angle)
    signals = {'torque': torque, 'position': COUNT * np.round(angle / COUNT)}
    record = Record(time, signals, {'torque': 'N m', 'position': 'rad'})
    assert 0.3 * INERTIA < AXIS.start([record], {})['J'] < 1.5 * INERTIA


def test_counts_that_stay_for_a_moment_are_no_rest():
    """A shaft that takes 77 ms from count to count is not at rest where a window begins."""
    time = np.arange(2000) / RATE
    angle = np.where(time < 2.0, 2.0 * time, 4.0 + 0.02 * (time - 2.0))
    signals = {'torque': np.ones(time.size), 'position': COUNT * np.round(angle / COUNT)}
    record = Record(time, signals, {'torque': 'N m', 'position': 'rad'})
    _, *others = make_chain(record, AXIS, OUTPUT, horizon=0.25)
    assert any(np.ptp(stretch.record['position'][:10]) == 0.0 for stretch in others)
    assert all(AXIS.states.index('omega') in stretch.open_states for stretch in others)


def test_a_true_model_leaves_the_noise_of_counts_and_is_found(arm):
    chains = [make_chain(arm, AXIS, OUTPUT, horizon=0.7)]
    left = np.concatenate(compare(truth(), chains, OUTPUT).residuals)
    assert np.sqrt(np.mean(left**2)) < 1.1 * COUNT / np.sqrt(12)
    begun = truth().with_values({'J': 0.03, 'b': 0.06, 'gravity_load.tau_sin': 0.4})
    found = fit(Problem(begun, chains, OUTPUT)).model
    assert found['gravity_load.tau_sin'] == pytest.approx(WEIGHT, rel=1e-3)
    assert found['J'] == pytest.approx(INERTIA, rel=1e-3)
    assert found['b'] == pytest.approx(FRICTION, rel=1e-2)


def test_a_current_that_jumps_where_a_look_begins_is_no_evidence():
    """What shows a fifth of the current is the same motor with other parameters, exactly.

    It begins with another current, though, unless that is sought.
    """
    rng, time = np.random.default_rng(3), np.arange(3000) / 1000
    volts = np.repeat(rng.uniform(-10, 10, 60), 50)
    own = {'R': 4.0, 'L': 5.5e-4, 'k_t': 0.035, 'J': 1.4e-5, 'b': 8e-6}
    model = Model.base('brushed_dc', own)
    run = simulate(model, Record(time, {'voltage': volts}, {'voltage': 'V'})).outputs
    signals = {
        'voltage': volts, 'current': run['current'] + rng.normal(scale=0.05, size=time.size),
        'position': COUNT * np.round(run['position'] / COUNT),
    }  # fmt: skip
    record = Record(time, signals, {'voltage': 'V', 'current': 'A', 'position': 'rad'})
    outputs = ('current', 'position')
    chains = [make_chain(record, model.kind, outputs, horizon=0.1)]
    scaled = model.with_effect('current_sensor_scale', {'g': -0.8}).with_values(
        {'R': 0.2 * own['R'], 'L': 0.2 * own['L'], 'J': 5 * own['J'], 'b': 5 * own['b']}
    )

    def error(one: Model) -> float:
        return compare(one, chains, outputs).error_percent

    assert error(scaled) == pytest.approx(error(model), rel=1e-3)
