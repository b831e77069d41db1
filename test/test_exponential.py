"""The matrix exponential and its integrals against scipy, over twelve decades of stiffness."""

import numpy as np
import pytest
from scipy.linalg import expm

from motor_sysid.physics.exponential import in_vectors, step_matrices
from motor_sysid.physics.motors import motor


def reference(a, b, g, h):
    n = a.shape[0]
    block = np.zeros((3 * n, 3 * n))
    block[:n, :n], block[:n, n : 2 * n] = a * h, h * np.eye(n)
    block[n : 2 * n, 2 * n :] = np.eye(n)
    whole = expm(block)
    phi1, phi2 = whole[:n, n : 2 * n], whole[:n, 2 * n :]
    return whole[:n, :n], phi1 @ b, phi1 @ g, phi2 @ g


def matrices_of(a, b, g, h):
    """Return E, h phi1 B, h phi1 G and h phi2 G of steps `h` (S,) with step and lane first."""
    wide, n, k = len(a) - len(a) % -8, a.shape[1], b.shape[2]
    a, b, g = (np.concatenate((x, np.repeat(x[:1], wide - len(a), axis=0))) for x in (a, b, g))
    width = np.repeat(h[:, np.newaxis], wide, axis=1)
    found = step_matrices(in_vectors(a), in_vectors(b), in_vectors(g), width)
    whole, phi1, phi2 = (np.moveaxis(x, 4, 1).reshape(wide, *x.shape[1:4]) for x in found)
    np.testing.assert_array_equal(whole[..., n + k : n + k + phi1.shape[3]], phi1)
    assert np.all(whole[..., n + k + phi1.shape[3] :] == 0.0)
    return [np.moveaxis(x, 1, 0) for x in (whole[..., :n], whole[..., n : n + k], phi1, phi2)]


@pytest.mark.parametrize('inductance', [1e-7, 1e-5, 1e-3, 1.0])
def test_motor_matrices_match_scipy(inductance):
    kind = motor('brushed_dc')
    values = {p.name: np.array([p.value, 2 * p.value]) for p in kind.parameters}
    values['L'] = np.array([inductance, 3 * inductance])
    a, b, g = kind.matrices(values)
    steps = np.array([1e-3, 3e-5])
    ours = matrices_of(a, b, g, steps)
    for lane in range(2):
        for step, h in enumerate(steps):
            for one, other in zip(ours, reference(a[lane], b[lane], g[lane], h), strict=True):
                close = {'rtol': 1e-11, 'atol': 1e-12 * np.abs(other).max()}
                assert np.allclose(one[step, lane], other, **close)


def test_a_lane_that_is_no_motor_is_nan_and_leaves_the_others_alone():
    a = np.zeros((11, 2, 2))
    a[0, 0, 0], a[1, 0, 0], a[2:, 0, 0] = np.nan, -1e30, -1.0
    b = g = np.ones((11, 2, 1))
    whole, *rest = matrices_of(a, b, g, np.full(1, 0.1))
    assert np.all(np.isnan(whole[0, :2]))
    assert all(np.all(np.isnan(part[0, :2])) for part in rest)
    np.testing.assert_allclose(whole[0, 2:11, 0, 0], np.exp(-0.1), rtol=1e-15)
