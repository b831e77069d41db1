"""The matrix exponential and its integrals against scipy, over twelve decades of stiffness."""

import numpy as np
import pytest
from scipy.linalg import expm

from motor_sysid.physics.exponential import substep_matrices
from motor_sysid.physics.motors import motor


def reference(a, b, g, h):
    n = a.shape[0]
    block = np.zeros((3 * n, 3 * n))
    block[:n, :n], block[:n, n : 2 * n] = a * h, h * np.eye(n)
    block[n : 2 * n, 2 * n :] = np.eye(n)
    whole = expm(block)
    phi1, phi2 = whole[:n, n : 2 * n], whole[:n, 2 * n :]
    return whole[:n, :n], phi1 @ b, phi1 @ g, phi2 @ g


@pytest.mark.parametrize('inductance', [1e-7, 1e-5, 1e-3, 1.0])
def test_motor_matrices_match_scipy(inductance):
    kind = motor('brushed_dc')
    values = {p.name: np.array([p.value, 2 * p.value]) for p in kind.parameters}
    values['L'] = np.array([inductance, 3 * inductance])
    a, b, g = kind.matrices(values)
    ours = substep_matrices(a, b, g, np.full(2, 1e-3))
    for lane in range(2):
        for one, other in zip(ours, reference(a[lane], b[lane], g[lane], 1e-3), strict=True):
            close = {'rtol': 1e-11, 'atol': 1e-12 * np.abs(other).max()}
            assert np.allclose(one[:, :, lane], other, **close)


def test_a_lane_that_is_no_motor_is_nan_and_leaves_the_others_alone():
    a = np.zeros((3, 2, 2))
    a[0, 0, 0], a[1, 0, 0], a[2, 0, 0] = np.nan, -1e30, -1.0
    b = g = np.ones((3, 2, 1))
    whole, *rest = substep_matrices(a, b, g, np.full(3, 0.1))
    assert np.all(np.isnan(whole[:, :, :2]))
    assert all(np.all(np.isnan(part[:, :, :2])) for part in rest)
    assert whole[0, 0, 2] == pytest.approx(np.exp(-0.1), rel=1e-15)
