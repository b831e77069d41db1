"""A signal that is held between updates is compared with the model as it was when it was new."""

from dataclasses import replace

from bench_motor import records
import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.estimation.batch import linear_of, make_chain, sensors_of, thinned
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor
from motor_sysid.signals.doctor import seen_by_fits
from motor_sysid.signals.record import Record
from motor_sysid.signals.slow_updates import (
    news_of,
    periods_of,
    told_slow,
    with_moving_positions,
)

KIND, OUTPUTS = motor('brushed_dc'), ('speed', 'current')
EVERY = 10
MODEL = Model.base('brushed_dc', {})
VALUES = {name: np.array([v]) for name, v in MODEL.parameters.values().items()}
LINEAR = linear_of(MODEL, VALUES, OUTPUTS)


def held(record: Record, *names: str, first: int = 3) -> Record:
    """Return a record of which some signals are new in one sample of ten only."""
    rows = np.arange(len(record))
    last = np.maximum((rows - first) // EVERY * EVERY + first, 0)
    for name in names:
        record = record.with_signal(name, record[name][last], record.units[name])
    return record


def test_what_a_signal_shows_is_told_by_when_it_changes():
    record = held(records({}, kinds=('steps',))[0], 'current')
    news = news_of(record, 'current', periods_of([record])['current'])
    assert news is not None
    assert np.array_equal(news, [0, *range(3, len(record), EVERY)])
    assert news_of(record, 'speed', 1) is None
    assert news_of(record, 'voltage', 5) is None


def test_what_is_new_at_times_of_its_own_is_taken_as_it_is_and_said_to_be_late():
    record = records({}, kinds=('steps',))[0]
    new = np.cumsum(np.random.default_rng(1).integers(6, 13, 600))
    new = new[new < len(record)]
    last = np.concatenate(([0], new))[np.searchsorted(new, np.arange(len(record)), side='right')]
    late = record.with_signal('current', record['current'][last], 'A')
    assert periods_of([late]) == {}
    (told,) = told_slow([late])
    assert told.startswith('current is new in about one sample of')
    assert 'late by half' in told
    (even,) = told_slow([held(record, 'current')])
    assert 'as it was then' in even
    time = record.time + 2e-4 * np.random.default_rng(2).uniform(-1, 1, len(record))
    (jittered,) = told_slow([replace(held(record, 'current'), time=time)])
    assert 'late by half' in jittered


def test_one_record_tells_of_the_sensor_in_all_and_windows_keep_it():
    """In the other the motor rests, and its current changes too seldom to tell."""
    moving = held(records({}, kinds=('steps',))[0], 'current')
    still = np.where(np.arange(len(moving)) < 3003, 0.0, 0.5)
    resting = moving.with_signal('current', still, 'A')
    sensors = sensors_of([moving, resting], KIND)
    assert sensors.periods == {'current': EVERY}
    (stretch,) = make_chain(resting, KIND, OUTPUTS, sensors=sensors)
    run = np.arange(len(resting))[:, np.newaxis, np.newaxis] * np.ones((1, 2, 1))
    shown = stretch.shown(run, LINEAR)[:, :, 0]
    assert np.array_equal(shown[:, 0], np.arange(len(resting)))
    assert np.array_equal(np.unique(shown[:, 1])[1:], np.arange(3, len(resting), EVERY))
    windows = thinned([(stretch,)], KIND, OUTPUTS, 2000)
    for window in (stretch for chain in windows for stretch in chain if stretch.scored):
        some = np.arange(len(window.record))[:, np.newaxis, np.newaxis] * np.ones((1, 2, 1))
        lag = (some[window.scored_from :] - window.shown(some, LINEAR))[:, 1, 0]
        assert 0 <= np.min(lag) <= np.max(lag) < EVERY
    (plain,) = make_chain(resting, KIND, OUTPUTS)
    assert not any(plain.sampling)


def test_a_position_that_is_held_moves_on_smoothly():
    clean = records({}, kinds=('sines',))[0]
    late = held(clean, 'position', 'speed')
    (moved,) = with_moving_positions([late])
    inside = slice(EVERY, -EVERY)
    off, before = (
        np.max(np.abs(r['position'] - clean['position'])[inside]) for r in (moved, late)
    )
    assert off < 0.02 * before
    alone = held(clean, 'position').select(['voltage', 'position'])
    assert with_moving_positions([alone]) == [alone]


@pytest.mark.parametrize(
    'names', [pytest.param(('current',), marks=pytest.mark.slow), ('speed', 'position')]
)
def test_what_is_held_is_no_missing_physics(names):
    *train, valid = (held(one, *names) for one in records({'coulomb_friction': {'tau_c': 4e-3}}))
    assert 'as it was then' in ' '.join(seen_by_fits(train))
    found = diagnose(train, [valid])
    assert found.verdict is Verdict.EFFECT_MISSING
    assert found.model.effects == ('coulomb_friction',)
    assert found.model['coulomb_friction.tau_c'] == pytest.approx(4e-3, rel=0.02)
