"""The functions of the exponential step of own states, against many digits."""

from decimal import Decimal, localcontext

from numba import njit
import pytest

from motor_sysid.physics.own_states import phis
from motor_sysid.physics.vector import element, spread

ARGUMENTS = (-1e-300, -1e-12, -1e-6, -1e-3, -0.05, -0.6, -1.0, -7.3, -39.9, -40.0, -40.1, -1e3)



@njit
def both(z):  # type: ignore[no-untyped-def]
    """Return both functions of one number."""
    first, second = phis(spread(z))
    return element(first, 0), element(second, 7)


@pytest.mark.parametrize('z', ARGUMENTS)
def test_both_functions_are_right_to_the_last_digits_however_far_a_state_fades(z: float) -> None:
    with localcontext() as context:
        context.prec = 700
        exact = Decimal(z)
        faded = exact.exp()
        first, second = (faded - 1) / exact, (faded - 1 - exact) / exact**2
    assert both(z) == pytest.approx((float(first), float(second)), rel=1e-15)


def test_what_does_not_fade_takes_the_limits() -> None:
    assert both(0.0) == (1.0, 0.5)


def test_what_fades_at_once_leaves_nothing_infinite() -> None:
    assert both(-1e200) == pytest.approx((1e-200, 1e-200), rel=1e-15)
