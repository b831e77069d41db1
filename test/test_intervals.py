"""Stated standard errors against the spread of estimates, for noise that is long correlated."""

import numpy as np
import pytest

from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.estimation.batch.information import information
from motor_sysid.estimation.batch.problem import Linearization
from motor_sysid.estimation.batch.stationary import stationary_scores
from motor_sysid.estimation.batch.steps import difference_steps
from motor_sysid.estimation.batch.weighting import Weighting
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

COUNT, RUNS = 3000, 120
WHITE = Weighting(np.ones(2))


def regressors() -> np.ndarray:
    """Return (N, 2, 3) derivatives: a constant, what happens at one moment, and a fast wave."""
    t = np.arange(COUNT)
    pulse = np.where(t > 1200, np.exp(-np.maximum(t - 1200, 0) / 30), 0.0)
    columns = np.column_stack((np.ones(COUNT), pulse, np.sin(t)))
    return np.stack((columns, 0.5 * columns), axis=1)


def errors(rng: np.random.Generator, memory: float) -> np.ndarray:
    """Return (N, 2) errors: noise of a memory in samples that both outputs show, and white."""
    keep = np.exp(-1 / memory)
    common = rng.normal(size=COUNT) * np.sqrt(1 - keep**2)
    for k in range(1, COUNT):
        common[k] += keep * common[k - 1]
    return np.column_stack((common, -common)) + 0.3 * rng.normal(size=(COUNT, 2))


def scatter(memory: float) -> np.ndarray:
    """Return (RUNS, 3) errors of least squares in units of their stated standard errors."""
    rng, slope = np.random.default_rng(8), regressors()
    flat, found = slope.reshape(-1, 3), []
    inverse = np.linalg.inv(flat.T @ flat)
    for _ in range(RUNS):
        error = errors(rng, memory)
        off = inverse @ flat.T @ error.ravel()
        near = Linearization(error - slope @ off, slope, np.empty((COUNT, 2, 0)), np.ones(3))
        spread = inverse @ stationary_scores([near], WHITE) @ inverse
        found.append(off / np.sqrt(np.diag(spread)))
    return np.array(found)


@pytest.mark.parametrize('memory', [0.1, 30.0])
def test_standard_errors_hold_for_noise_that_is_correlated_for_long(memory):
    """The seed is fixed; by chance one of six means would be outside once in 200 draws."""
    z = scatter(memory)
    assert np.all(np.abs(np.mean(z**2, axis=0) - 1) < 0.45)
    assert np.all(np.mean(np.abs(z) < 1.96, axis=0) > 0.88)


def test_the_sum_over_lags_is_what_it_says():
    rng = np.random.default_rng(2)
    error, slope = rng.normal(size=(60, 2)), rng.normal(size=(60, 2, 2))
    error[:, 1] += np.roll(error[:, 0], 2)
    near = Linearization(error, slope, np.empty((60, 2, 0)), np.ones(2))
    found = stationary_scores([near], WHITE)
    most = 6
    x = np.abs(np.arange(-most, most + 1)) / most
    window = np.where(x < 0.5, 1 - 6 * x**2 * (1 - x), 2 * (1 - x) ** 3)

    def product(lag: int) -> np.ndarray:
        early, late = error[max(-lag, 0) : 60 - max(lag, 0)], error[max(lag, 0) : 60 + min(lag, 0)]
        return early.T @ late / 60 * window[lag + most]

    expected = sum(
        slope[t].T @ product(s - t) @ slope[s]
        for t in range(60) for s in range(60) if abs(s - t) <= most
    )  # fmt: skip
    ratio = found / (0.5 * (expected + expected.T))
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-9)
    assert 1.0 < ratio[0, 0] < 1.1


@pytest.mark.parametrize('begun', [0.0, 2e-8, 5e-7])
def test_standard_errors_do_not_depend_on_where_a_fit_began(begun):
    """A coordinate is as large as the value that its problem began with; boxes are wide open."""
    rng = np.random.default_rng(4)
    t = 2e-3 * np.arange(4000)
    volts = np.repeat(rng.uniform(-12, 12, 80), 50)
    motor = {'R': 1.2, 'L': 1.5e-3, 'k_t': 0.055, 'J': 8e-5, 'b': 3e-5}
    truth = Model.base('brushed_dc', motor).with_effect('quadratic_drag', {'k_d': 3e-7})
    drive = Record(t, {'voltage': volts}, {'voltage': 'V'})
    shown = simulate(truth, drive).outputs
    columns = {
        'voltage': volts,
        'current': shown['current'] + 0.02 * rng.standard_normal(t.size),
        'speed': shown['speed'] + 0.3 * rng.standard_normal(t.size),
    }
    record = Record(t, columns, {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'})
    start = Model.base('brushed_dc', motor).with_effect('quadratic_drag', {'k_d': begun})
    found = {p.name: p for p in fit_model([record], model=start).model.parameters}
    k_d = found['quadratic_drag.k_d']
    assert abs(k_d.value - 3e-7) < 4 * k_d.sigma
    assert k_d.sigma == pytest.approx(3.48e-9, rel=0.05)
    assert all(np.isfinite(found[name].sigma) for name in motor)


def test_a_scale_that_nothing_fixes_has_no_standard_error():
    """Three torques over one inertia: every one of them is seen in units of the others only."""
    rng = np.random.default_rng(5)
    columns = rng.normal(size=(500, 3)) * [1.0, 0.02, 300.0]
    scale = columns.sum(axis=1, keepdims=True)
    told = information(np.concatenate((columns, scale), axis=1), ('k_t', 'b', 'tau_l', 'J'))
    assert told.rank == 3
    assert all(name in told.words()[0] for name in told.names)
    assert np.all(np.isinf(told.bound))
    free = information(columns, ('k_t', 'b', 'tau_l'))
    assert not free.words()
    assert np.all(np.isfinite(free.bound))


@pytest.mark.parametrize(('delay', 'expected'), [(2.4e-3, 0.05), (2.02e-3, 0.01), (2e-3, 1e-3)])
def test_the_derivative_by_a_delay_does_not_reach_over_a_sample(delay, expected):
    """Beyond it a current that settles within a sample is seen on its way: another derivative."""
    model = Model.base('brushed_dc').with_effect('input_delay', {'delay': delay})
    late = model.parameters['input_delay.delay']
    size = 2e-3
    found = difference_steps(
        [(late, size)], [effect('input_delay')], {late.name: delay}, dt=1e-3, end=10.0
    )
    assert found[0] * size == pytest.approx(expected * 1e-3)


def test_derivatives_are_taken_over_a_hundredth_where_a_model_strikes():
    """Below that, outputs are rough in every parameter, the motor's own as well."""
    model = Model.base('brushed_dc').with_effect('backlash', {'r': 1.0})
    sized = [(model.parameters[name], 1.0) for name in ('J', 'backlash.r')]
    values = model.parameters.values()
    found = difference_steps(sized, [effect('backlash')], values, dt=1e-3, end=10.0)
    assert found == pytest.approx([1e-2, 1e-2])
    smooth = difference_steps(sized, [effect('flexible_shaft')], values, dt=1e-3, end=10.0)
    assert smooth == pytest.approx([1e-4, 1e-4])
