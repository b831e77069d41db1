"""The implicit part of a step: every law whose root is within reach is settled in a few trials."""

from numba import cfunc, njit
import numpy as np
import pytest

from motor_sysid.physics.implicit import settle, weighed
from motor_sysid.physics.native import as_pointer, data_of, LANES
from motor_sysid.physics.vector import get, put, spread, WIDTH

START, WEIGHT = 1.0, 0.5
TARGET, COUNT, FOUND = LANES, 2 * LANES, 3 * LANES
CHANGES = np.array([-3.0, -1.0, -0.1, -1e-6, 1e-6, 0.1, 1.0, 3.0])


@njit
def solve(buffer, base, calls, change, start):
    """Settle one equation whose own state lies in the first row; count the trials."""
    p = as_pointer(base)
    _, weight, c, d = weighed(
        get(data_of(change), 0), spread(0.0), spread(0.0), spread(WEIGHT), spread(WEIGHT)
    )
    force = settle(
        p, base, calls, 1, np.zeros(1, np.int64), 0, 0, TARGET, spread(START), spread(start),
        weight, c, d,
    )  # fmt: skip
    put(p, FOUND, force)


def settled(law, change):
    """Solve ``d = c + w (law(d) - law(0))`` with a change `c` (8,); return d and the trials."""
    compiled = njit(law)

    @cfunc('void(int64, int64, int64)')
    def lane(base, own, state):
        p = as_pointer(base)
        put(p, TARGET, get(p, TARGET) + compiled(get(p, 0) - START))
        put(p, COUNT, get(p, COUNT) + 1.0)

    buffer, calls = np.zeros(4 * LANES), np.array([[lane.address, 0, 0]], dtype=np.int64)
    solve(buffer, buffer.ctypes.data, calls, change, law(0.0))
    return buffer[:WIDTH] - START, buffer[COUNT]


@pytest.mark.parametrize('slope', [-100.0, -1.0, 0.0, 0.1, 0.5, 0.9])
def test_a_linear_law_is_settled_whether_it_damps_or_feeds(slope):
    """A law that feeds has its root beyond the change without it."""
    found, trials = settled(lambda d: slope * d, CHANGES)
    assert found == pytest.approx(CHANGES / (1.0 - 0.5 * slope), rel=2e-5)
    assert trials <= 4


def test_a_friction_that_falls_as_the_motion_begins_is_settled():
    def law(d):
        return -1.0 / (1.0 + (START + d) * (START + d))

    found, trials = settled(law, np.abs(CHANGES))
    assert found == pytest.approx(np.abs(CHANGES) + 0.5 * (law(found) - law(0.0)), rel=1e-4)
    assert trials <= 8


def test_a_law_that_feeds_more_than_a_step_can_follow_ends_at_twice_the_change():
    """... and costs no more trials than another."""
    found, trials = settled(lambda d: 3.0 * d, CHANGES)
    assert found == pytest.approx(2.0 * CHANGES)
    assert trials <= 4
