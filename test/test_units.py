"""Units: what users write, and the SI that it means."""

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from motor_sysid.errors import UserError
from motor_sysid.signals.units import parse_unit


@pytest.mark.parametrize(
    ('text', 'si', 'factor'),
    [
        ('V', 'V', 1), ('mV', 'V', 1e-3), ('v', 'V', 1), ('mA', 'A', 1e-3), ('us', 's', 1e-6),
        ('µs', 's', 1e-6), ('rpm', 'rad/s', 2 * np.pi / 60), ('RPM', 'rad/s', 2 * np.pi / 60),
        ('deg', 'rad', np.pi / 180), ('deg/s', 'rad/s', np.pi / 180), ('°', 'rad', np.pi / 180),
        ('rev/s', 'rad/s', 2 * np.pi), ('turns', 'rad', 2 * np.pi), ('counts', 'count', 1),
        ('counts/s', 'count/s', 1), ('Nm', 'N m', 1), ('N m', 'N m', 1), ('mN·m', 'N m', 1e-3),
        ('mm/s', 'm/s', 1e-3), ('m/s^2', 'm/s^2', 1), ('rad/s²', 'rad/s^2', 1), ('%', '1', 0.01),
        ('-', '1', 1), ('', '1', 1), ('kg m^2', 'kg m^2', 1), ('g', 'kg', 1e-3),
        ('1/min', 'rad/s', 2 * np.pi / 60), ('min^-1', 'rad/s', 2 * np.pi / 60),
        ('rad per s', 'rad/s', 1), ('V s/rad', 'V s/rad', 1), ('inch', 'm', 0.0254),
    ],
)  # fmt: skip
def test_known_units(text: str, si: str, factor: float) -> None:
    unit = parse_unit(text)
    assert (unit.si, unit.offset) == (si, 0)
    assert unit.factor == pytest.approx(factor, rel=1e-12)


def test_temperatures_have_an_offset() -> None:
    assert parse_unit('K').to_si(300.0) == pytest.approx(26.85)
    assert parse_unit('degF').to_si(212.0) == pytest.approx(100)
    assert parse_unit('C').si == 'degC'


@pytest.mark.parametrize('text', ['rpmm', 'furlong', 'M', 'm1', 'k%', '5'])
def test_unknown_unit_is_named(text: str) -> None:
    with pytest.raises(UserError, match=f'`{text}` is not known'):
        parse_unit(text)


def test_suggestion() -> None:
    with pytest.raises(UserError, match='did you mean `rpm`'):
        parse_unit('rpmm')


@given(st.sampled_from(['rpm', 'mA', 'deg', 'degF', 'turns/s']), st.floats(-1e6, 1e6))
def test_there_and_back(text: str, value: float) -> None:
    unit = parse_unit(text)
    assert unit.from_si(unit.to_si(value)) == pytest.approx(value, rel=1e-9, abs=1e-9)


@given(st.text(max_size=12))
def test_any_text_gives_a_unit_or_a_user_error(text: str) -> None:
    try:
        unit = parse_unit(text)
    except UserError:
        return
    assert unit.factor > 0
