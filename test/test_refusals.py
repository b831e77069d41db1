"""What is refused before it is fitted, and what short or resting records come to."""

import math

import numpy as np
import pytest
from simulated_axis import AXIS, axis

from motor_sysid.diagnosis import diagnose, Settings, Verdict
from motor_sysid.diagnosis.ceiling import ceiling, words
from motor_sysid.diagnosis.fitting import add_effect, compare_model, fit_model
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import coloured
from motor_sysid.signals.record import Record


def changed(record, **signals):
    return Record(record.time, {**record.signals, **signals}, record.units)


def test_a_record_of_some_samples_beside_a_long_one_is_no_crash():
    """The noise of 60 s is read from windows; of 60 ms there would be 12 rows."""
    train = [axis(60.0, dry=0.05), axis(0.06, seed=2, dry=0.05)]
    found = diagnose(train, effects=['coulomb_friction'], settings=Settings(max_effects=1))
    assert found.effects == ('coulomb_friction',)


def test_a_noise_model_takes_no_more_than_stretches_have():
    rng = np.random.default_rng(3)
    short = [rng.normal(size=(12, 1)) for _ in range(40)]
    assert coloured(short, 12).order == 0
    long = rng.normal(size=(4000, 1))
    assert np.allclose(coloured([*short, long], 12).sigma, coloured([long], 12).sigma)


@pytest.mark.parametrize('zero', [0.0, 100.0])
def test_where_an_encoder_begins_to_count_does_not_matter(zero):
    """Percents of 100 rad would call 15 % of the torque a trifle."""
    train = [axis(20.0, dry=0.05, names=('torque', 'position'), zero=zero)]
    found = diagnose(train, effects=['quadratic_drag'])
    assert found.verdict is Verdict.UNKNOWN_EFFECT


@pytest.mark.parametrize(
    ('name', 'value'), [('position', 1.0), ('position', 0.0), ('speed', 0.0)]
)
def test_an_axis_whose_brake_is_on_is_refused(name, value):
    record = axis(3.0, names=('torque', name))
    still = changed(record, **{name: np.full(len(record), value)})
    with pytest.raises(UserError, match='stands still in these data'):
        diagnose([still])
    with pytest.raises(UserError, match='release its brake'):
        fit_model([still], motor='mechanical_axis')


@pytest.mark.parametrize('rows', [2, 5, 19])
def test_a_fit_of_a_few_rows_is_refused(rows):
    few = axis(1.0).slice(0, rows)
    with pytest.raises(UserError, match=f'{rows} samples; a fit needs at least 20'):
        fit_model([few], motor='mechanical_axis')
    with pytest.raises(UserError, match=f'{rows} samples; a fit needs at least 20'):
        add_effect(AXIS, 'coulomb_friction', [few])


@pytest.mark.parametrize('bad', [np.nan, np.inf])
def test_what_is_no_number_is_refused_by_a_comparison_too(bad):
    record = axis(2.0)
    speed = np.array(record['speed'])
    speed[700] = bad
    with pytest.raises(UserError, match='`speed` of a record has 1 values of 2000'):
        compare_model(AXIS, [changed(record, speed=speed)])


def test_the_ceiling_of_a_signal_that_rests_is_told():
    record = axis(2.0)
    still = changed(record, speed=np.zeros(len(record)))
    assert 'times smaller' not in ''.join(words(ceiling(AXIS, [still], kinds=['arx'])))
    for share in (0.0, 1.0, math.nan):
        with pytest.raises(UserError, match='between 0 and 1'):
            ceiling(AXIS, [record], kinds=['arx'], hold_back=share)


@pytest.mark.parametrize(
    ('chosen', 'says'),
    [
        ({'max_effects': -1}, 'max_effects -1 is less than 0'),
        ({'refits': 0}, 'refits 0 is less than 1'),
        ({'validation_fraction': 1.0}, 'validation_fraction 1 is not between'),
        ({'alpha': 0.0}, 'alpha 0 is not between'),
        ({'effort': math.nan}, 'effort nan is not above 0'),
    ],
)
def test_settings_out_of_their_range_are_refused(chosen, says):
    with pytest.raises(UserError, match=says):
        Settings(**chosen)
