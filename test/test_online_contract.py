"""What every online estimator keeps to, whatever comes."""

import os
from pathlib import Path
import random
import subprocess
import sys

from closed_loop import DT, samples, TRUE, WRONG, wrong_motor
import numpy as np
from online_tools import (
    BY_REGRESSION,
    feed,
    identifier,
    KINDS,
    RECOMMENDED,
    start_model,
    truth,
)
import pytest

from motor_sysid.errors import UserError
from motor_sysid.estimation.online import ESTIMATORS, OnlineIdentifier, Tuning
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.model import Model, SpeedSensor

OBSERVER = 'sliding_mode'
EFFECTS = dict(catalogue())
"""Those that come with the package, in their order, whatever other tests add."""


def is_sound(online):
    covariance = online.estimator.covariance()
    assert np.all(np.isfinite(covariance))
    assert np.all(np.diag(covariance) >= 0)
    size = np.sqrt(np.diag(covariance))
    active = size > 0
    scaled = (covariance / np.outer(size, size).clip(1e-300))[np.ix_(active, active)]
    assert np.all(np.linalg.eigvalsh(scaled) > -1e-9)
    for name, found in online.estimate().items():
        p = online.model.parameters[name]
        slack = 1e-9 * abs(found.value) + 1e-15
        inside = p.lower - slack <= found.value <= p.upper + slack
        assert inside or found.value == p.value
        assert found.sigma > 0
        assert np.isfinite(found.sigma) or not found.identifiable


@pytest.mark.parametrize('key', ESTIMATORS)
def test_same_bits_however_samples_are_bunched(key):
    rows = samples()[:700]
    whole, single, ragged = (identifier(key) for _ in range(3))
    feed(whole, rows)
    for k in range(len(rows)):
        feed(single, rows[k : k + 1])
        if k % 7 == 0:  # and to ask changes nothing
            single.estimate()
    for part in np.array_split(rows, 23):
        feed(ragged, part)
    for other in (single, ragged):
        assert other.estimate() == whole.estimate()
        assert other.prediction() == whole.prediction()
        assert other.errors() == whole.errors()
        assert np.array_equal(other.estimator.covariance(), whole.estimator.covariance())


def gap(rows):
    return np.concatenate([rows[:800], rows[1100:]])


def dropouts(rows):
    """Lose more and more: 5, 15, 35 and 50 % of the values, or of the samples altogether."""
    rng = np.random.default_rng(0)
    share = np.repeat([0.05, 0.15, 0.35, 0.5], -(-len(rows) // 4))[: len(rows)]
    lost = rng.random((len(rows), 3)) < share[:, np.newaxis]
    rows[lost[:, 0], 2] = np.nan
    rows[lost[:, 1], 3] = np.inf
    rows[1000:1050, 2:4] = np.nan
    return rows[~(lost[:, 2] & (np.arange(len(rows)) % 200 < 100))]


def outliers(rows):
    hit = np.random.default_rng(1).random(len(rows)) < 0.005
    rows[hit, 2] += 50.0
    rows[np.roll(hit, 7), 3] -= 3000.0
    return rows


def jitter(rows):
    rows[:, 0] += np.random.default_rng(2).uniform(-2e-5, 2e-5, len(rows))
    return rows


def no_motion(rows):
    rows[1200:, 1:4] = [0.0, 0.08, 0.0]
    return rows


def constant_speed(rows):
    rows[1200:, 1:4] = rows[1100, 1:4]
    return rows


def stamps_fall_back(rows):
    return np.concatenate([rows[:900], rows[850:]])


def stuck_input(rows):
    rows[500:, 1] = 24.0
    return rows


def huge_values(rows):
    rows[700:720, 1:4] = [1e6, -1e9, 1e12]
    return rows


TROUBLES = (
    gap, dropouts, outliers, jitter, no_motion, constant_speed, stamps_fall_back, stuck_input,
    huge_values,
)  # fmt: skip


RARE = (gap, no_motion, constant_speed, stamps_fall_back, stuck_input)
SOUND = [
    pytest.param(key, trouble, id=f'{key}-{trouble.__name__}',
                 marks=[pytest.mark.slow] if key not in RECOMMENDED and trouble in RARE else [])
    for key in ESTIMATORS
    for trouble in TROUBLES
]  # fmt: skip


@pytest.mark.parametrize(('key', 'trouble'), SOUND)
def test_stays_sound(key, trouble):
    online = feed(identifier(key), trouble(samples()[:1700].copy()))
    is_sound(online)


@pytest.mark.parametrize('key', ESTIMATORS)
def test_the_covariance_stays_bounded_without_excitation(key):
    """Half a minute of rest after a second of motion, which the memory does not reach back to."""
    rows = samples()[:1200]
    still = np.zeros((3000, 5))
    still[:, 0] = rows[-1, 0] + 1e-2 * np.arange(1, 3001)
    still[:, 2] = 0.08 + 0.02 * np.random.default_rng(0).standard_normal(3000)
    online = feed(identifier(key, tuning=Tuning(memory=0.5, gap=12.0)), rows)
    found = feed(online, still).estimate()
    is_sound(online)
    for name in ('L', 'k_t', 'J'):  # the prior is good to a factor of two
        assert found[name].sigma < 1.5 * max(WRONG[name], found[name].value) or key == OBSERVER


@pytest.mark.parametrize('trouble', [gap, outliers, jitter], ids=lambda f: f.__name__)
@pytest.mark.parametrize('key', RECOMMENDED)
def test_finds_the_motor_all_the_same(key, trouble):
    online = feed(identifier(key), trouble(samples()[:3000].copy()))
    found = online.estimate()
    for name in ('R', 'k_t', 'J'):
        assert found[name].value == pytest.approx(truth(name), rel=0.05)


@pytest.mark.parametrize('key', ESTIMATORS)
def test_nothing_is_identifiable_without_motion(key):
    rows = samples()[:1500].copy()
    rows[:, 1:4] = [0.0, 0.08, 0.0]
    online = feed(identifier(key), rows)
    is_sound(online)
    found = online.estimate()
    assert not any(found[name].identifiable for name in ('L', 'k_t', 'J', 'b'))


@pytest.mark.parametrize('missing', ['speed', 'position'])
@pytest.mark.parametrize('key', ESTIMATORS)
def test_one_of_speed_and_position_that_is_never_measured_is_as_if_not_named(key, missing):
    rows = samples()[:1500].copy()
    columns = {'current': 2, 'speed': 3, 'position': 4}
    rows[:, columns[missing]] = np.nan
    named = feed(identifier(key, outputs=tuple(columns)), rows, outputs=columns.values())
    del columns[missing]
    plain = feed(identifier(key, outputs=tuple(columns)), rows, outputs=columns.values())
    assert named.estimate() == plain.estimate()
    assert key == OBSERVER or named.estimate()['J'].identifiable
    assert np.isnan(named.prediction()[missing])
    assert named.prediction()['current'] == plain.prediction()['current']


@pytest.mark.parametrize('key', RECOMMENDED)
def test_a_position_that_comes_later_is_taken_from_there_on(key):
    rows = samples()[:2500].copy()
    rows[:700, 4] = np.nan
    late = feed(identifier(key, outputs=('current', 'speed', 'position')), rows, outputs=(2, 3, 4))
    assert (late.samples, late.gaps) == (2500, 0)
    assert np.isfinite(late.prediction()['position'])
    assert late.estimate()['J'].value == pytest.approx(TRUE['J'], rel=0.05)


@pytest.mark.parametrize('key', RECOMMENDED)
def test_information_is_lost_slowly_without_excitation(key):
    online = feed(identifier(key), no_motion(samples()[:4000].copy()))
    found = online.estimate()
    assert found['k_t'].value == pytest.approx(TRUE['k_t'], rel=0.1)


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('key', ESTIMATORS)
def test_every_kind_and_effect_runs(key, kind):
    runs_with(EFFECTS, key, kind)


@pytest.mark.parametrize('seed', [0, 1])
@pytest.mark.parametrize('key', ['ekf', 'ukf'])
def test_and_so_it_does_in_any_order(key, seed):
    """More effects take part, and rounding left a direction of the covariance below nothing."""
    names = list(EFFECTS)
    random.Random(seed).shuffle(names)
    runs_with({name: EFFECTS[name] for name in names}, key, 'mechanical_axis')


def runs_with(effects, key, kind):
    model = start_model(key, Model.base(kind, speed_sensor=SpeedSensor.DIFFERENCE))
    for name, effect in effects.items():
        try:
            values = {'n': 6.0} if name == 'cogging_torque' else None
            more = model.with_effect(name, values)
        except UserError:
            continue
        rates = effect.needs() & {'di', 'domega'}
        if key == OBSERVER and (rates or 'constant_load_torque' not in more.effects):
            continue
        if key in BY_REGRESSION and rates:
            with pytest.raises(UserError, match='use the estimator `ekf`'):
                online_of(more, key)
        else:
            model = more
    online = online_of(model, key)
    columns = {'current': 2, 'speed': 3, 'position': 4}
    feed(online, samples()[:400], outputs=[columns[name] for name in online.outputs])
    is_sound(online)
    assert set(online.estimate()) == {p.name for p in model.parameters.free}


def online_of(model, key):
    outputs = [o.signal for o in model.kind.outputs]
    return OnlineIdentifier(model, key, DT, list(model.kind.inputs[0]), outputs)


FRESH = """
import gc
import sys
import numpy as np
from numba.core.dispatcher import Dispatcher
from closed_loop import DT, samples, wrong_motor
from motor_sysid.estimation.online import OnlineIdentifier
from online_tools import start_model

rows = samples(1.6).copy()
rows[700, 2] = rows[720:730, 3] = rows[650, 1] = rows[:900, 4] = float('nan')
model = wrong_motor().with_effect('armature_heating').with_effect('cogging_torque', {'n': 6.0})
for key in sys.argv[1:]:
    model_of = start_model(key, model)
    outputs = ['current', 'speed', 'position']
    online = OnlineIdentifier(model_of, key, DT, ['voltage'], outputs)
    compiled = [found for found in gc.get_objects() if isinstance(found, Dispatcher)]
    before = [len(one.overloads) for one in compiled]
    for part in (rows[:50], *np.split(rows[50:800], 250), rows[1000:]):
        online.update(part[:, 0], part[:, 1:2], part[:, 2:5])
        online.estimate()
    late = [one.py_func for one, n in zip(compiled, before) if len(one.overloads) > n]
    assert not late, (key, late)
"""


@pytest.mark.parametrize(
    'keys', [('rls',), ('ekf',), ('ukf', OBSERVER, 'mhe', 'dual_ekf', *BY_REGRESSION[1:])]
)
def test_nothing_is_left_to_compile_when_samples_come(keys):
    here = str(Path(__file__).parent)
    done = subprocess.run(
        [sys.executable, '-c', FRESH, *keys], env={**os.environ, 'PYTHONPATH': here},
        cwd=Path(__file__).parent.parent, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_counts_gaps_and_refused_samples():
    online = feed(identifier('ekf'), gap(samples()[:1500].copy()))
    feed(online, samples()[:10])
    assert (online.samples, online.gaps, online.dropped) == (1200, 1, 10)


def test_bad_questions():
    for arguments, message in (
        (('kalman', ['voltage'], ['speed']), 'known are rls, rls_directional'),
        (('ekf', ['torque'], ['speed']), 'driven by voltage'),
        (('ekf', ['voltage'], ['temperature']), 'current, speed, position'),
        (('ekf', ['voltage'], []), 'got none'),
        (('rls', ['voltage'], ['speed']), 'use the estimator `ekf`'),
        ((OBSERVER, ['voltage'], ['speed']), 'add the effect `constant_load_torque`'),
    ):
        key, inputs, outputs = arguments
        with pytest.raises(UserError, match=message):
            OnlineIdentifier(wrong_motor(), key, DT, inputs, outputs)
    with pytest.raises(UserError, match='not positive'):
        OnlineIdentifier(wrong_motor(), 'ekf', 0.0, ['voltage'], ['speed'])
    with pytest.raises(UserError, match='memory'):
        Tuning(memory=0.0)


def test_current_model_is_a_model():
    online = feed(identifier('ekf'), samples()[:2000])
    model = online.current_model()
    assert model['R'] == pytest.approx(online.estimate()['R'].value)
    assert model.parameters['R'].sigma == pytest.approx(online.estimate()['R'].sigma)


