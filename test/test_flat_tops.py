"""A current that is cut off at the end of its sensor's range costs what lies beyond, no more."""

from bench_motor import records
import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.estimation.batch.chains import make_chain, thinned
from motor_sysid.estimation.batch.sampling import linear_of
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor
from motor_sysid.signals.flat_tops import common_limits, limits_of

NOISE = np.random.default_rng(3).normal(size=4000)
WAVE = 3.0 * np.sin(np.arange(4000) / 40) + 0.02 * NOISE
STEPPED = 0.02 * np.round(WAVE / 0.02)
FALLING = 3.1 * np.exp(-((np.arange(4000) + 200) % 400) / 10) + 0.02 * np.round(NOISE)
NOISY = 0.02 * np.round(50 * (FALLING + 0.1 * np.roll(NOISE, 9)))
INRUSH = np.append(np.minimum(FALLING + 0.1 * NOISE, 2.5), np.linspace(0.0, 2.6, 2))


def counted(most: int) -> np.ndarray:
    """Return inrushes in steps of a converter, one of which comes to a largest number of them."""
    return np.round(INRUSH * (most / 2.6)) / 256


NONE = (-np.inf, np.inf)


@pytest.mark.parametrize(
    ('values', 'expected'),
    [
        (np.clip(WAVE, -2.0, 2.5), (-2.0, 2.5)),
        (np.minimum(STEPPED, 2.0), (-np.inf, 2.0)),
        (np.where(np.arange(4000) < 200, np.minimum(WAVE, 2.9), 0.5 * WAVE), (-np.inf, 2.9)),
        (np.where(np.arange(4000) < 400, np.minimum(FALLING, 2.0), 0.3 * FALLING), (-np.inf, 2.0)),
        (np.minimum(FALLING, 2.6), (-np.inf, 2.6)),
        (np.minimum(FALLING, 3.0), NONE),
        (FALLING, NONE),
        (np.minimum(NOISY, 2.4), (-np.inf, 2.4)),
        (NOISY, NONE),
        (counted(2048), (-np.inf, 8.0)),
        (counted(1023), (-np.inf, 1023 / 256)),
        (np.append(counted(1023), [-1092 / 256, 0.0]), NONE),
        (counted(900), NONE),
        (WAVE, NONE),
        (STEPPED, NONE),
        (np.maximum(WAVE, 0.0), NONE),
        (np.repeat(WAVE[::10], 10), NONE),
        (np.round(WAVE), NONE),
        (np.concatenate((WAVE, np.full(50, 3.2), WAVE, np.full(50, 1.0))), NONE),
        (np.full(4000, 2.0), NONE),
        (np.where(np.arange(4000) == 7, np.nan, WAVE), NONE),
    ],
    ids=[
        'two ends', 'steps of a converter', 'once for long', 'one inrush', 'two samples of each',
        'one of each', 'inrushes', 'noise of many steps', 'the same within its range',
        'all steps of a sign', 'the same less one', 'further on the other side', 'some of them',
        'within its range', 'steps', 'one that shows no negative ones', 'read seldom', 'coarse',
        'two plateaus', 'stuck', 'not finite',
    ],
)  # fmt: skip
def test_only_what_is_cut_off_has_limits(values: np.ndarray, expected: tuple[float, float]):
    assert limits_of(values) == expected


@pytest.mark.parametrize(
    ('others', 'expected'),
    [
        ((0.5 * WAVE,), (-np.inf, 2.0)),
        ((np.clip(WAVE, -2.4, 1.0),), (-2.4, 2.0)),
        ((np.append(0.5 * WAVE, [-2.001, 2.0]),), (-2.001, 2.0)),
        ((0.9 * WAVE,), NONE),
    ],
    ids=['one end', 'both', 'as far on the other side', 'other ranges'],
)
def test_a_sensor_has_one_range_in_all_records(others, expected):
    cut = np.clip(0.75 * WAVE, 0.0, 2.0) + np.minimum(0.5 * WAVE, 0.0)
    assert common_limits([cut, *others]) == expected


def cut_off(limit: float, effects: dict[str, dict[str, float]]):
    """Return records whose current is cut off at a limit, A, at either end."""
    return [
        r.with_signal('current', np.clip(r['current'], -limit, limit), 'A')
        for r in records(effects)
    ]


def test_a_stretch_shows_what_its_sensor_can_and_windows_of_it_do_so_too():
    record = cut_off(1.0, {})[0]
    kind, outputs = motor('brushed_dc'), ('speed', 'current')
    (stretch,) = make_chain(record, kind, outputs)
    run = np.full((len(record), 2, 1), 5.0)
    model = Model.base('brushed_dc', {})
    values = {name: np.array([v]) for name, v in model.parameters.values().items()}
    linear = linear_of(model, values, outputs)
    assert np.all(stretch.shown(run, linear) == [[5.0], [1.0]])
    (window, *_), *_ = thinned([(stretch,)], kind, outputs, 2000)
    assert np.array_equal(window.limits, stretch.limits)
    (whole,) = make_chain(records({})[0], kind, outputs)
    assert whole.limits is None
    assert np.all(whole.shown(run, linear) == 5.0)


def test_parameters_are_those_of_the_motor_whatever_is_cut_off():
    """A sixth of the sensor's samples are at its limit; a fit that takes them for true is off."""
    data, motor_values = cut_off(1.0, {}), {'R': 2.1, 'k_t': 0.046, 'J': 2.6e-5}
    assert 0.05 < np.mean(data[0]['current'] == 1.0) < 0.4
    found = fit_model(data, motor='brushed_dc').model
    for name, value in motor_values.items():
        assert found[name] == pytest.approx(value, rel=5e-3), name


def test_what_is_missing_is_named_behind_a_current_that_is_cut_off():
    *train, held = cut_off(1.0, {'coulomb_friction': {'tau_c': 4e-3}})
    found = diagnose(train, [held])
    assert found.verdict is Verdict.EFFECT_MISSING
    assert found.model.effects == ('coulomb_friction',)
    low, high = (found.evidence[0].parameters['tau_c'][k] for k in (3, 4))
    assert low < 4e-3 < high
    assert found.steps[-1].validation_error_percent < 1.1 * found.noise_floor_percent
