"""Standard errors where the cost around a fit is flatter than its derivatives say."""

from types import SimpleNamespace

import numpy as np
import pytest

from motor_sysid.diagnosis.search.valleys import Around, less_known
from motor_sysid.estimation.batch import Linearization, white

SIZES = np.array([1e-3, 1.0, 20.0, 5.0])


def told_by(slope, rise):
    """Return factors of standard errors: derivatives (N, d), and what the cost really does.

    `rise` takes (K, d) moves from the fit.
    """
    size = slope.shape[1]
    problem = SimpleNamespace(
        free=tuple(SimpleNamespace(name=f'p{k}', logarithmic=False) for k in range(size)),
        precision=np.zeros((size, size)), vector=lambda: np.ones(size),
        box=lambda: (np.full(size, -np.inf), np.full(size, np.inf)),
        costs=lambda z, weighting, near: 100.0 + rise(z - 1.0),
    )  # fmt: skip
    residual = np.zeros((len(slope), 1))
    near = [Linearization(residual, slope[:, np.newaxis, :], np.empty((len(slope), 1, 0)),
                          np.empty(0))]  # fmt: skip
    return less_known(Around(problem, white([np.array([[1.0], [-1.0]])]), near))


def a_slope(seed: int):
    """Return derivatives (60, 4), parameters of very different size, some of them alike."""
    rng = np.random.default_rng(seed)
    slope = rng.standard_normal((60, SIZES.size))
    slope[:, 1] += 3.0 * slope[:, 0]
    return slope / SIZES


def parabola(slope):
    return lambda moves: np.sum((moves @ slope.T) ** 2, axis=1)


def errors(slope):
    return np.sqrt(np.diag(np.linalg.inv(slope.T @ slope)))


@pytest.mark.parametrize('seed', range(5))
def test_standard_errors_stay_where_derivatives_are_right(seed):
    slope = a_slope(seed)
    np.testing.assert_array_equal(told_by(slope, parabola(slope)), 1.0)


@pytest.mark.parametrize('jumps', [10.0, 30.0, 300.0])
def test_a_combination_that_only_some_samples_that_jump_tell_of_is_not_known(jumps):
    """Of the derivatives of three further samples, the cost a little farther on knows nothing."""
    slope = a_slope(0)
    jumping = jumps * np.random.default_rng(1).standard_normal((3, 1)) * [0.5, 1, -1, 2] / SIZES
    found = told_by(np.concatenate((slope, jumping)), parabola(slope))
    expected = errors(slope) / errors(np.concatenate((slope, jumping)))
    assert np.max(expected) > 1.3
    np.testing.assert_allclose(found, expected, rtol=0.1)


def test_a_valley_on_one_side_counts_and_a_wall_on_the_other_does_not():
    slope = np.diag(1 / SIZES)

    def rise(moves):
        x = moves / SIZES
        x[:, 2] = np.where(x[:, 2] < 0.0, 0.2, 50.0) * x[:, 2]
        return np.sum(x**2, axis=1)

    np.testing.assert_allclose(told_by(slope, rise), [1, 1, 5, 1], rtol=0.1)


def test_what_is_steeper_on_both_sides_does_not_make_others_less_known():
    slope = np.diag(1 / SIZES)

    def rise(moves):
        x = moves / SIZES
        x[:, 1] *= 10.0
        return np.sum(x**2, axis=1)

    np.testing.assert_array_equal(told_by(slope, rise), 1.0)


def test_a_model_that_cannot_be_simulated_beside_the_fit_keeps_its_standard_errors():
    slope = a_slope(2)

    def rise(moves):
        return np.where(np.any(moves != 0.0, axis=1), np.nan, 0.0)

    np.testing.assert_array_equal(told_by(slope, rise), 1.0)


def test_what_nothing_tells_of_is_infinitely_unknown_and_makes_no_warning(recwarn):
    """Its root overflows when squared; that is no reason to call it known, nor not a number."""
    slope = a_slope(3)
    slope[:, 2] *= 1e-160
    found = told_by(slope, parabola(slope))
    assert np.all(np.isfinite(found))
    assert not recwarn.list


def test_derivatives_that_overflow_tell_nothing_and_do_not_end_it():
    slope = a_slope(0)
    slope[3, 1] = np.inf
    with np.errstate(invalid='ignore'):
        assert np.all(told_by(slope, parabola(a_slope(0))) == 1.0)
