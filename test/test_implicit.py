"""The implicit part of a step: every law whose root is within reach is settled in a few trials."""

import numpy as np
import pytest

from motor_sysid.physics import implicit
from motor_sysid.physics.implicit import narrow, prepare, ROWS
from motor_sysid.physics.native import LANES

WIDE, START = 8, 1.0
WEIGHT = np.full((1, 1, 1, LANES), 0.5)


def settled(law, change, trials=12):
    """Solve ``d = c + w (law(d) - law(0))`` with a change `c` (WIDE,); return d and the trials."""
    memory, force = np.zeros(ROWS * LANES), np.zeros(LANES)
    predicted, whole = np.full((1, LANES), START), np.zeros((1, LANES))
    whole[0, :WIDE] = change / WEIGHT[0, 0, 0, 0]
    begun = np.full(LANES, law(0.0))
    zero = np.zeros((1, LANES))
    prepare(
        WIDE, memory, 0, 0, predicted, whole, begun[np.newaxis], begun[np.newaxis], zero,
        WEIGHT, WEIGHT, 0,
    )  # fmt: skip
    place = implicit._D
    for trial in range(trials):
        now = memory[place : place + WIDE].copy()
        force[:WIDE] = law(now)
        if narrow(WIDE, force, 0, memory, trial == 0) == 0:
            return now, trial + 1
    return now, trials + 1


CHANGES = np.array([-3.0, -1.0, -0.1, -1e-6, 1e-6, 0.1, 1.0, 3.0])


@pytest.mark.parametrize('slope', [-100.0, -1.0, 0.0, 0.1, 0.5, 0.9])
def test_a_linear_law_is_settled_whether_it_damps_or_feeds(slope):
    """A law that feeds has its root beyond the change without it."""
    found, trials = settled(lambda d: slope * d, CHANGES)
    assert found == pytest.approx(CHANGES / (1.0 - 0.5 * slope), rel=2e-5)
    assert trials <= 4


def test_a_friction_that_falls_as_the_motion_begins_is_settled():
    def law(d):
        return -1.0 / (1.0 + (START + d) ** 2)

    found, trials = settled(law, np.abs(CHANGES))
    assert found == pytest.approx(np.abs(CHANGES) + 0.5 * (law(found) - law(0.0)), rel=1e-4)
    assert trials <= 8


def test_a_law_that_feeds_more_than_a_step_can_follow_ends_at_twice_the_change():
    """... and costs no more trials than another."""
    found, trials = settled(lambda d: 3.0 * d, CHANGES)
    assert found == pytest.approx(2.0 * CHANGES)
    assert trials <= 4
