"""When did the model stop holding: the search for the moment, and the fits that confirm it."""

from bench_motor import a_motor, measure, MOTOR, voltage_profile
import numpy as np
import pytest
from scipy.signal import lfilter

from motor_sysid.diagnosis.change.change_point import BLOCKS, change_point
from motor_sysid.diagnosis.change.until_when import change_in_words, Held, held_until
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.signals.record import Record

RUNS = 400
ALPHA = 0.05


def errors(rng: np.random.Generator, colour: float = 0.0) -> np.ndarray:
    return lfilter([1], [1, -colour], rng.standard_normal((3000, 2)), axis=0)


@pytest.mark.parametrize('colour', [0.0, 0.6])
def test_without_a_change_one_is_reported_as_often_as_asked_for(colour: float) -> None:
    rng = np.random.default_rng(7)
    false = sum(change_point(errors(rng, colour), ALPHA, rng) is not None for _ in range(RUNS))
    # 99.9 % of binomial counts with the rate asked for lie below this
    assert false <= ALPHA * RUNS + 3.1 * np.sqrt(RUNS * ALPHA * (1 - ALPHA))
    assert false > 0.2 * ALPHA * RUNS, 'a test that never fires has another rate'


@pytest.mark.parametrize('factor', [1.3, 1 / 1.3])
def test_a_change_is_found_where_it_is(factor: float) -> None:
    rng, misses = np.random.default_rng(3), []
    for _ in range(50):
        e = errors(rng)
        e[1800:] *= factor
        found = change_point(e, 0.01, rng)
        assert found is not None
        assert found.ratio == pytest.approx(factor, rel=0.1)
        misses.append(abs(found.index - 1800))
    assert np.median(misses) < 30
    assert max(misses) < 2 * 3000 / BLOCKS


def test_too_little_says_nothing() -> None:
    assert change_point(np.ones((50, 1)), 0.5, np.random.default_rng(0)) is None


def record(seed: int, kind: str, effects: dict[str, dict[str, float]]) -> Record:
    rng = np.random.default_rng(seed)
    return measure(a_motor(effects), voltage_profile(kind, 10.0, rng), rng)


def datasheet() -> Model:
    return Model.base('brushed_dc', MOTOR, speed_sensor=SpeedSensor.DIFFERENCE)


@pytest.mark.parametrize(('when', 'kind'), [(6.2, 'steps'), (3.1, 'sines'), (5.0, 'triangle')])
def test_an_inertia_that_grows_is_dated_and_measured(when: float, kind: str) -> None:
    change = {'inertia_change': {'g': 0.5, 't_on': when, 'rise': 0.002}}
    held = held_until(datasheet(), record(2, kind, change))
    assert held is not None
    assert held.time == pytest.approx(when, abs=0.1)
    before, after = held.changed['J']
    assert (before, after) == pytest.approx((MOTOR['J'], 1.5 * MOTOR['J']), rel=0.05)
    told = change_in_words(datasheet(), held, offset=8.0)
    assert told.startswith(f'The model held until {held.time + 8:.1f} s, then J (')
    assert ' +5' in told or ' +4' in told


@pytest.mark.parametrize('effects', [{}, {'coulomb_friction': {'tau_c': 0.003}}])
def test_a_motor_that_stays_the_same_is_said_to_hold(
    effects: dict[str, dict[str, float]],
) -> None:
    """With and without an effect that the model lacks."""
    for seed, kind in enumerate(('steps', 'sines', 'triangle', 'steps', 'sines', 'triangle')):
        assert held_until(datasheet(), record(seed, kind, effects)) is None, (seed, kind)


def one_after_another(*effects: dict[str, dict[str, float]]) -> Record:
    """Return what is measured while a motor changes at 5 s, at rest."""
    rng = np.random.default_rng(7)
    volts = [voltage_profile('steps', 5.0, rng) for _ in effects]
    parts = [
        measure(a_motor(one), np.where(np.arange(v.size) > v.size - 400, 0.0, v), rng)
        for one, v in zip(effects, volts, strict=True)
    ]
    first, second = ({name: part[name] for name in part} for part in parts)
    second['position'] = second['position'] + first['position'][-1] - second['position'][0]
    joined = {name: np.concatenate((first[name], second[name])) for name in first}
    time = parts[0].dt * np.arange(joined['speed'].size)
    return Record(time, joined, {name: parts[0].units[name] for name in joined})


DRY = {'coulomb_friction': {'tau_c': 6e-3}}


@pytest.mark.parametrize(
    ('effects', 'told'),
    [
        (({}, DRY), 'then Coulomb friction came (tau_c = 0.00'),
        ((DRY, {}), 'then Coulomb friction went (tau_c = 0.00'),
    ],
    ids=['a brake binds', 'a brake lets go'],
)
def test_dry_friction_that_comes_is_no_viscous_friction_many_times_as_large(
    effects: tuple[dict[str, dict[str, float]], ...], told: str
) -> None:
    held = held_until(datasheet(), one_after_another(*effects))
    assert held is not None
    assert 4.6 - 0.05 < held.time < 5.3 + 0.05  # the motor rests there
    assert next(iter(held.changed)) == 'coulomb_friction.tau_c'
    assert max(held.changed['coulomb_friction.tau_c']) == pytest.approx(6e-3, rel=0.02)
    assert told in change_in_words(datasheet(), held)
    assert 'b (' not in change_in_words(datasheet(), held)


def test_dry_friction_that_grows_is_told_by_how_much() -> None:
    effects = DRY, {'coulomb_friction': {'tau_c': 9e-3}}
    model = datasheet().with_effect('coulomb_friction', {'tau_c': 6e-3})
    held = held_until(model, one_after_another(*effects))
    assert held is not None
    told = change_in_words(model, held)
    assert 'coulomb_friction.tau_c (Coulomb torque)' in told
    assert ' came' not in told


def test_an_effect_that_sets_in_says_itself_when() -> None:
    values = {'g': 0.5, 't_on': 6.2, 'rise': 0.002}
    model = datasheet().with_effect('inertia_change', values)
    told = change_in_words(model, None, offset=8.0)
    assert told == 'The model held until 14.2 s, then inertia change +50 %.'
    assert held_until(model, record(2, 'steps', {})) is None
    assert change_in_words(datasheet(), None) == ''
    assert 'error was 3 times' in change_in_words(datasheet(), Held(1.0, 3.0, 99.0))
