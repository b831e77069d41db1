"""An input that is written down a row late is found, and told as what it is: no physics."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import expm

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.early_input import run_earlier, with_early_input
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

INERTIA, FRICTION, DT, ROWS = 0.087, 0.084, 5e-3, 2400
MODEL = Model.base('mechanical_axis', {'J': INERTIA, 'b': FRICTION})


def recorded(seed: int, late: float) -> Record:
    """Return an axis whose torque is written so many rows late; the truth is exact.

    It is the mean over the row before, where that is one; half of that, where it is half a row.
    """
    rng = np.random.default_rng(seed)
    time = DT * np.arange(ROWS + 1)
    steps = np.repeat(rng.normal(size=ROWS // 40 + 1), 40)[: ROWS + 1]
    torque = 6.0 * np.cos((2.0 + seed) * time) + 3.0 * steps
    rate = np.array([[-FRICTION / INERTIA, 1.0 / INERTIA], [0.0, 0.0]])
    decay, push = expm(DT * rate)[0]
    speed = np.zeros(ROWS + 1)
    for k in range(ROWS):
        speed[k + 1] = decay * speed[k] + push * torque[k]
    written = torque[1:] * (1.0 - late) + torque[:-1] * late
    signals = {'torque': written, 'speed': speed[1:] + 0.01 * rng.normal(size=ROWS)}
    return Record(time[1:], signals, {'torque': 'N m', 'speed': 'rad/s'})


@pytest.mark.parametrize('late', [1.0, 0.5])
def test_the_rows_by_which_an_input_is_late_are_found(late):
    early = run_earlier(MODEL, [recorded(1, late)], [recorded(2, late)], 0.2, {})
    assert early.rows == pytest.approx(late, abs=0.05)
    assert early.error_percent < 0.5


def test_a_diagnosis_says_that_the_data_may_be_to_blame():
    train, valid = [recorded(1, 1.0), recorded(3, 1.0)], [recorded(2, 1.0)]
    found = diagnose(train, valid, effects=('coulomb_friction', 'quadratic_drag'))
    assert found.verdict is Verdict.UNKNOWN_EFFECT
    assert 'the motor answers torque 1 rows before that is written' in found.reasons[0]
    assert '`shift: -1`' in found.reasons[0]


def test_what_is_explained_and_what_is_delayed_is_not_asked():
    def found(verdict, model, error):
        step = SimpleNamespace(model=model, validation_error_percent=error)
        return SimpleNamespace(verdict=verdict, steps=[step], noise_floor_percent=1.0)

    delayed = MODEL.with_effect('input_delay', {'delay': 0.01})
    for one in (
        found(Verdict.COMPLETE, MODEL, 5.0),
        found(Verdict.UNKNOWN_EFFECT, MODEL, 1.4),
        found(Verdict.EFFECT_MISSING, delayed, 5.0),
    ):
        assert with_early_input(one, 0.2, {}, pytest.fail) is one
