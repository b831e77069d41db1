"""A delay at the start of a record: what still acts there was told before, and is not known."""

import numpy as np
import pytest
from scipy.linalg import expm

from motor_sysid.diagnosis.where.compare import compare
from motor_sysid.estimation.batch import fit, make_chain, Problem
from motor_sysid.physics.drive import Drive, REACH
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor
from motor_sysid.signals.record import Record

INERTIA, FRICTION, DT, ROWS, LATE = 0.087, 0.084, 5e-3, 4000, 2.5
AXIS, OUTPUT, NOISE = motor('mechanical_axis'), ('speed',), 0.01
VALUES = {'J': INERTIA, 'b': FRICTION}


def recorded(held: bool) -> Record:
    """Return an axis that obeys 2.5 samples late; the truth is exact, in halves of a sample.

    The record begins with the first command, from rest; or that was `held` for long before.
    """
    rng = np.random.default_rng(21)
    time = DT * np.arange(ROWS)
    torque = 6.0 * np.cos(3.0 * time) + 3.0 * np.repeat(rng.normal(size=ROWS // 20), 20)
    before = torque[0] if held else 0.0
    rate = np.array([[-FRICTION / INERTIA, 1.0 / INERTIA], [0.0, 0.0]])
    decay, push = expm(0.5 * DT * rate)[0]
    speed, shown = (torque[0] / FRICTION if held else 0.0), np.empty(ROWS)
    for k in range(ROWS):
        shown[k] = speed
        for half in (0, 1):
            at = (2 * k + half - round(2 * LATE)) // 2
            speed = decay * speed + push * (torque[at] if at >= 0 else before)
    signals = {'torque': torque, 'speed': shown + NOISE * rng.normal(size=ROWS)}
    return Record(time, signals, {'torque': 'N m', 'speed': 'rad/s'})


def delayed(delay: float) -> Model:
    return Model.base('mechanical_axis', VALUES).with_effect('input_delay', {'delay': delay})


@pytest.mark.parametrize('held', [True, False])
@pytest.mark.parametrize('begun', [1.9, 3.1])
def test_a_delay_is_found_whatever_was_told_before_the_record(held, begun):
    chain = make_chain(recorded(held), AXIS, OUTPUT)
    found = fit(Problem(delayed(begun * DT), [chain], OUTPUT)).model
    assert found['input_delay.delay'] == pytest.approx(LATE * DT, abs=0.01 * DT)
    assert found['J'] == pytest.approx(INERTIA, rel=1e-3)


@pytest.mark.parametrize('held', [True, False])
def test_the_true_model_leaves_the_noise(held):
    record = recorded(held)
    left = compare(delayed(LATE * DT), [make_chain(record, AXIS, OUTPUT)], OUTPUT)
    size = float(np.sqrt(np.mean(record['speed'] ** 2)))
    assert left.error_percent == pytest.approx(100 * NOISE / size, rel=0.05)


def test_nothing_before_a_record_is_not_taken_for_its_middle():
    drive = Drive(np.ones((300, 1)), DT, position=np.arange(300.0))
    silent = drive.from_nothing().led_in()
    assert silent.inputs[:REACH].max() == 0.0
    assert silent.inputs[REACH:].min() == 1.0
    assert silent.position[0] == silent.position[REACH]
    assert silent.start == pytest.approx(-REACH * DT)
    middle = drive.part(150, 300)
    assert middle.from_nothing() is middle
