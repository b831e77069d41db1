"""A law that adds to a special case what no sensor sees may as well be the special case."""

import pytest

from motor_sysid.diagnosis.search.ranking import rivals_left
from motor_sysid.physics.model import Model

NOISE = {'A': 0.01, 'rad/s': 0.5}
BRUSHES = {'inverter_dead_time': ('brush_voltage_drop',)}


def with_ripple(ripple: float) -> Model:
    """Return a motor whose bridge has a dead time with half a ripple of current, A."""
    return Model.base('brushed_dc').with_effect('inverter_dead_time', {'i_0': ripple, 'v_d': 0.3})


@pytest.mark.parametrize(('ripple', 'told'), [(0.2, {}), (0.005, BRUSHES)])
def test_a_dead_time_without_a_ripple_that_is_seen_may_be_brushes(ripple, told):
    assert rivals_left({}, with_ripple(ripple), NOISE) == told


def test_on_its_lower_bound_a_ripple_is_not_seen_either():
    model = with_ripple(0.2)
    name = 'inverter_dead_time.i_0'
    lowest = model.with_values({name: model.parameters[name].lower})
    assert rivals_left({}, lowest, {}) == BRUSHES


def test_what_the_model_has_is_no_rival():
    model = with_ripple(0.005).with_effect('brush_voltage_drop', {'v_b': 0.2})
    assert not any(rivals_left({}, model, NOISE).values())
    known = {'inverter_dead_time': ('supply_sag', 'brush_voltage_drop'), 'gravity_load': ('x',)}
    assert rivals_left(known, model, NOISE) == {'inverter_dead_time': ('supply_sag',)}


def test_bristles_with_a_stiction_that_is_not_seen_are_still_no_coulomb_friction():
    """They bend: one shape of several that is lost in noise does not make the special case."""
    model = Model.base('brushed_dc').with_effect('lugre_friction', {'omega_s': 0.1})
    assert rivals_left({}, model, NOISE) == {}


def test_a_special_case_has_the_rivals_of_what_it_took_the_place_of():
    model = Model.base('brushed_dc').with_effect('flexible_shaft', {})
    rivals = {'backlash': ('speed_sensor_lag',)}
    assert rivals_left(rivals, model, NOISE) == {'flexible_shaft': ('speed_sensor_lag',)}
    rivals['flexible_shaft'] = ()
    assert rivals_left(rivals, model, NOISE) == {'flexible_shaft': ()}


def test_what_is_wider_than_the_special_case_itself_is_none_of_them():
    """Uneven friction is a rival of Stribeck friction, and a wider form of Coulomb friction."""
    model = Model.base('brushed_dc').with_effect('coulomb_friction', {})
    rivals = {'stribeck_friction': ('asymmetric_coulomb_friction', 'iron_loss')}
    assert rivals_left(rivals, model, NOISE) == {'coulomb_friction': ('iron_loss',)}


def test_a_rise_of_friction_below_the_noise_of_a_speed_is_still_a_rise():
    """Counts of 6 rad/s do not hide what rises at 2 rad/s: it is its size that tells."""
    model = Model.base('brushed_dc').with_effect('stribeck_friction', {'omega_s': 0.2})
    assert rivals_left({}, model, NOISE) == {}
