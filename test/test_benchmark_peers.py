"""The peers: they find what is plain to see, and their equations hold for a known motor."""

from functools import cache

import numpy as np
import pytest

from motor_sysid.benchmark.cases import Case, draw
from motor_sysid.benchmark.peers import e_sindy, f_test, Peer, PEERS
from motor_sysid.benchmark.peers.equations import Equations, equations
from motor_sysid.benchmark.scenarios import Scenario
from motor_sysid.physics.effects import catalogue

FEW = ('coulomb_friction', 'quadratic_drag', 'brush_voltage_drop', 'armature_heating')


@cache
def case(*effects: str) -> Case:
    return draw(Scenario(effects, 0.1 if effects else 0.0), 7, 1)


@cache
def balances(*effects: str) -> Equations:
    return equations(case(*effects).train, FEW)


def explained(found: Equations, name: str, *more: np.ndarray) -> float:
    """Return the share of a left-hand side that base and further columns explain."""
    columns, target = np.column_stack([found.base[name], *more]), found.target[name]
    rest = target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]
    return 1 - float(rest @ rest) / float(target @ target)


def test_the_equations_hold_for_a_linear_motor():
    found, plant = balances(), case().setting.plant
    assert explained(found, 'voltage') > 0.99
    base, target = found.base['voltage'], found.target['voltage']
    r, _, k, _ = np.linalg.lstsq(base, target, rcond=None)[0]
    assert k == pytest.approx(plant.k, rel=0.05)
    assert r == pytest.approx(plant.R, rel=0.1)


def test_every_effect_has_its_terms():
    terms = balances().terms
    assert {t.effect for t in terms} == set(FEW)
    assert sum(t.effect == 'armature_heating' for t in terms) > 1
    for term in terms:
        for name, columns in term.columns.items():
            assert columns.shape[0] == balances().target[name].size
            assert np.all(np.isfinite(columns))


def test_a_hidden_effect_explains_what_the_base_cannot():
    found = balances('coulomb_friction')
    (term,) = (t for t in found.terms if t.effect == 'coulomb_friction')
    before = explained(found, 'torque')
    after = explained(found, 'torque', term.columns['torque'])
    assert 1 - after < 0.8 * (1 - before)


def test_the_whole_catalogue_can_be_asked_for():
    found = equations(case().train, tuple(catalogue()))
    assert {t.effect for t in found.terms} >= set(FEW)


def test_the_f_test_names_a_large_effect_first():
    assert f_test.name_effects(case('coulomb_friction').train, FEW)[0] == 'coulomb_friction'


def test_sindy_names_a_large_effect():
    pytest.importorskip('pysindy', reason='PySINDy is an extra: pip install motor_sysid[bench]')
    state = np.random.get_state()[1].copy()  # noqa: NPY002
    named = e_sindy.name_effects(case('coulomb_friction').train, FEW)
    assert 'coulomb_friction' in named
    assert np.array_equal(np.random.get_state()[1], state)  # noqa: NPY002


def test_a_peer_says_what_it_lacks():
    assert PEERS['f_test'].lacks == ''
    assert 'no_such_module' in Peer('x', f_test.name_effects, 'no_such_module').lacks
