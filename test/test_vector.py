"""Vectors of compiled code against numpy: what laws may be written in."""

import math

from numba import njit
import numpy as np
import pytest

from motor_sysid.physics.native import data_of
from motor_sysid.physics.vector import get, put, some, where, WIDTH

X = np.array([-2.5, -1.0, -0.3, -0.0, 0.0, 0.4, 1.0, 3.5])
Y = np.array([0.5, -1.0, 2.0, 1.0, -3.0, 0.4, 1.5, -0.1])

FUNCTIONS = {
    'sum': lambda x, y: x + y + 1.0 + 2,
    'difference': lambda x, y: 1.0 - x - y - 3,
    'product': lambda x, y: 2.0 * x * y * 3,
    'quotient': lambda x, y: 1.0 / (x + 7.0) / y / 2,
    'negative': lambda x, y: -x,
    'abs': lambda x, y: abs(x) + np.abs(y) + np.fabs(x) + math.fabs(y),
    'roots': lambda x, y: np.sqrt(x * x) + math.sqrt(y * y),
    'floor': lambda x, y: np.floor(x) + 10.0 * np.ceil(y),
    'sign': lambda x, y: np.sign(x) + 10.0 * np.sign(y),
    'numpy limits': lambda x, y: np.minimum(x, y) + 10.0 * np.maximum(x, 0.2),
    'limits': lambda x, y: 10.0 * min(max(x, -1.0), y + 2.0),
    'squares': lambda x, y: x**2 + y**3 + x**1,
    'powers': lambda x, y: abs(x) ** 0.5 + 2.0**y + abs(x) ** abs(y),
    'exponentials': lambda x, y: np.exp(x) + math.exp(y) + np.expm1(x) + np.tanh(y) + math.tanh(x),
    'logarithms': lambda x, y: np.log(abs(x) + 1.0) + np.log1p(abs(y)) + math.log(abs(y)),
    'waves': lambda x, y: np.sin(x) + np.cos(y) + np.arctan(x) + math.sin(y),
    'angles': lambda x, y: np.arctan2(x, y) + np.hypot(x, y),
    'comparisons': lambda x, y: (
        (x < y) * 1.0 + 2.0 * (x <= y) + (x > y) * 4.0 + (x >= y) * 8 + (x == y) * 16
        + 32 * (x != y)
    ),
    'both and either': lambda x, y: ((x > 0.0) & (y > 0.0)) * 1.0 + ((x > 0.0) | (y > 0.0)) * 2.0,
    'where': lambda x, y: np.where(x > y, x, 0.5),
}  # fmt: skip


def on_vectors(law):
    """Return a function of two arrays of eight that works on vectors."""
    law = njit(law)

    @njit
    def call(x, y, out):
        put(data_of(out), 0, law(get(data_of(x), 0), get(data_of(y), 0)))

    def called(x, y):
        out = np.empty(WIDTH)
        call(x, y, out)
        return out

    return called


@pytest.mark.parametrize('name', FUNCTIONS)
def test_a_function_of_vectors_is_that_of_arrays(name):
    law = FUNCTIONS[name]
    if name == 'limits':
        expected = np.array([law(x, y) for x, y in zip(X, Y, strict=True)])
    elif name in ('abs', 'roots', 'exponentials', 'logarithms', 'waves'):  # math takes numbers
        expected = np.array([law(float(x), float(y)) for x, y in zip(X, Y, strict=True)])
    else:
        expected = law(X, Y)
    np.testing.assert_allclose(on_vectors(law)(X, Y), expected, rtol=1e-14)


def test_what_is_no_number_stays_so_in_its_lane_alone():
    """... in the limits of numpy, and as Python has it in its own: the first one stays."""
    x, y = np.where(np.arange(8) == 2, np.nan, X), np.where(np.arange(8) == 5, np.nan, Y)
    for law in (lambda a, b: np.minimum(a, b), lambda a, b: np.maximum(a, b)):
        np.testing.assert_array_equal(on_vectors(law)(x, y), law(x, y))
    for law in (lambda a, b: min(a, b), lambda a, b: max(a, b)):
        expected = [law(a, b) for a, b in zip(x, y, strict=True)]
        np.testing.assert_array_equal(on_vectors(law)(x, y), expected)


def test_a_number_that_a_loop_makes_a_vector_is_one_from_the_outset():
    def series(x, y):
        total = 1.0
        for k in range(1, 5):
            total = total * x / k + y
        return total

    np.testing.assert_allclose(on_vectors(series)(X, Y), series(X, Y), rtol=1e-14)


def test_a_choice_and_a_question_about_all():
    @njit
    def largest(x, out):
        values = get(data_of(x), 0)
        put(data_of(out), 0, where(values > 1.0, 1.0, values))
        return some(values > 3.0), some(values > 4.0)

    out = np.empty(WIDTH)
    assert largest(X, out) == (True, False)
    np.testing.assert_array_equal(out, np.minimum(X, 1.0))


def test_memory_that_is_not_in_one_piece_has_no_place():
    @njit
    def first(x):
        return data_of(x)[0]

    assert first(X) == X[0]
    for other in (np.zeros((4, 4))[:, ::2], np.zeros(3, dtype=np.float32)):
        with pytest.raises(Exception, match='in one piece has a place'):
            first(other)
