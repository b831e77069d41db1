"""Effects that are said to be the same: both sides are simulated and make the same records."""

import numpy as np
import pytest

from motor_sysid.benchmark.equivalences import EQUIVALENCES, invisible, same_as
from motor_sysid.estimation.batch import make_chain, Problem
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Provenance, Record

R, L, K, J, B = 1.2, 0.8e-3, 0.05, 4e-5, 2e-5
WIDTHS = {'omega_eps': 0.5, 'i_eps': 0.02}
BASE = {'R': R, 'L': L, 'k_t': K, 'J': J, 'b': B, 'current_offset': 0.1}
COUNT, DT = 3000, 1e-3


def shown(base, effects):
    """Return what the sensors show, (N, 2) current and speed, from the state of rest."""
    model = Model.base('brushed_dc', {**BASE, **WIDTHS, **base})
    for key, values in effects.items():
        model = model.with_effect(key, values)
    time = DT * np.arange(COUNT)
    rng = np.random.default_rng(5)
    voltage = np.repeat(rng.uniform(-8, 8, COUNT // 100), 100)
    voltage[:200] = 0.0
    start = Record(
        time,
        {'voltage': voltage, 'current': np.zeros(COUNT), 'speed': np.zeros(COUNT)},
        {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'},
        Provenance('test'),
    )
    chain = make_chain(start, model.kind, ('current', 'speed'))
    problem = Problem(model, [chain], ('current', 'speed'))
    near = problem.linearize(problem.vector(), parameters=False)
    return np.concatenate([-one.residual for one in near])


SIDES = {
    ('coulomb_friction', 'constant_load_torque'): (
        ({}, {'coulomb_friction': {'tau_c': 3e-3}, 'constant_load_torque': {'tau_l': 1e-3}}),
        ({}, {'asymmetric_coulomb_friction': {'tau_c_plus': 4e-3, 'tau_c_minus': 2e-3}}),
    ),
    ('current_sensor_scale',): (
        ({}, {'current_sensor_scale': {'g': 0.1}}),
        ({'R': R / 1.1, 'L': L / 1.1, 'J': 1.1 * J, 'b': 1.1 * B}, {}),
    ),
    ('speed_sensor_scale',): (
        ({}, {'speed_sensor_scale': {'g': 0.1}}),
        ({'k_t': K / 1.1, 'J': J / 1.21, 'b': B / 1.21}, {}),
    ),
    ('current_sensor_offset',): (
        ({}, {'current_sensor_offset': {'o': 0.2}}),
        ({'current_offset': BASE['current_offset'] + 0.2}, {}),
    ),
    ('speed_sensor_offset',): (
        ({}, {'speed_sensor_offset': {'o': 5.0}}),
        (
            {'current_offset': 0.1 + K * 5.0 / R},
            {'constant_load_torque': {'tau_l': -(B + K**2 / R) * 5.0}},
        ),
    ),
}
"""Left side of a row to base parameters and effects of both sides."""


@pytest.mark.parametrize('left', SIDES, ids=lambda left: '+'.join(left))
def test_both_sides_make_the_same_records(left):
    assert frozenset(left) in {row.one for row in EQUIVALENCES}
    one, other = (shown(*side) for side in SIDES[left])
    settled = slice(COUNT // 10, None)
    size = np.std(one[settled], axis=0)
    assert np.all(np.max(np.abs(one - other)[settled], axis=0) < 2e-3 * size)


def test_every_row_of_the_catalogue_is_simulated():
    for row in EQUIVALENCES:
        if (row.one | row.other) <= set(catalogue()):
            assert any(frozenset(left) == row.one for left in SIDES), row


def test_effects_that_differ_do_not_pass_as_the_same():
    one = shown({}, {'coulomb_friction': {'tau_c': 3e-3}})
    other = shown({}, {'constant_load_torque': {'tau_l': 3e-3}})
    assert np.max(np.abs(one - other)) > 0.02 * np.std(one)


def test_what_is_the_same_is_found_in_larger_sets():
    found = same_as(frozenset({'coulomb_friction', 'constant_load_torque', 'cogging_torque'}))
    assert frozenset({'asymmetric_coulomb_friction', 'cogging_torque'}) in found
    assert same_as(frozenset({'coulomb_friction'})) == {frozenset({'coulomb_friction'})}
    assert same_as(frozenset()) == {frozenset()}
    assert frozenset() in same_as(frozenset({'current_sensor_scale'}))
    assert invisible('current_sensor_scale')
    assert not invisible('speed_sensor_offset')
