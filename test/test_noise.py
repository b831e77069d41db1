"""How much noise the sensors make at least."""

import numpy as np
import pytest

from motor_sysid.signals.noise import noise_sigmas, rounding_sigmas


def test_a_coarse_signal_that_is_held_has_the_noise_of_its_rounding():
    """Its neighbours are equal, so little fast noise shows; rounding is there all the same."""
    time = 1e-3 * np.arange(4000)
    speed = 40 * np.sin(3 * time) + 20 * np.sin(11 * time)
    held = np.repeat(np.round(speed[::5] / 3.2) * 3.2, 5)[: time.size, np.newaxis]
    assert noise_sigmas([held], [False]) < 0.6
    assert rounding_sigmas([held]) == pytest.approx(3.2 / np.sqrt(12))
    assert np.std(held[::5, 0] - speed[::5]) == pytest.approx(3.2 / np.sqrt(12), rel=0.1)


def test_a_signal_that_takes_any_value_is_not_rounded():
    smooth = np.sin(np.linspace(0, 9, 500))
    steps = np.round(smooth, 1)
    both = np.column_stack((smooth, steps))
    assert rounding_sigmas([both[:200], both[200:]]) == pytest.approx([0.0, 0.1 / np.sqrt(12)])
