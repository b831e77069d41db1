"""Two effects at once, where single ones lead nowhere, and ladders told one effect at a time."""

from importlib import import_module

from bench_motor import records
import pytest
from test_trials import prepared

from motor_sysid.benchmark.cases import draw
from motor_sysid.benchmark.scenarios import named_case
from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.search.pairs import best_twosome
from motor_sysid.diagnosis.search.retelling import retold
from motor_sysid.diagnosis.search.rounds import scored
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import SpeedSensor

HIDDEN = {'coulomb_friction': {'tau_c': 6e-3}, 'brush_voltage_drop': {'v_b': 0.5}}
FEW = (*HIDDEN, 'quadratic_drag', 'iron_loss')


@pytest.mark.slow
def test_an_offset_that_a_load_explains_as_well_is_told_once_friction_is_there():
    """A load explains most alone, and hides an offset of the speed sensor."""
    scenario, number = named_case('pair/asymmetric_coulomb_friction+speed_sensor_offset/3/0')
    case = draw(scenario, 2040, number)
    found = diagnose(case.train, case.valid, motor='brushed_dc')
    assert found.verdict in (Verdict.EFFECT_MISSING, Verdict.AMBIGUOUS)
    assert 'speed_sensor_offset' in found.effects
    friction = {'asymmetric_coulomb_friction'}, {'coulomb_friction', 'constant_load_torque'}
    assert set(found.effects) - {'speed_sensor_offset'} in friction
    assert found.steps[-1].validation_error_percent < 1.5 * found.noise_floor_percent


def base_of(hidden, offered=FEW):
    """Return the bench of a motor, its linear model fitted, and the scores of some effects."""
    data = records(hidden, kinds=('steps', 'triangle'), seconds=3.0)
    bench, base = prepared(data, SpeedSensor.DIFFERENCE)
    candidates = [effect(key) for key in offered]
    return bench, base, scored(base, bench, candidates, lambda text: None)


def test_a_twosome_leaves_nothing_but_noise():
    bench, base, scores = base_of(HIDDEN)
    rung, gain, alone = best_twosome(base, scores, bench, lambda text: None)
    assert not alone
    assert set(rung.model.effects) == set(HIDDEN)
    assert rung.model['brush_voltage_drop.v_b'] == pytest.approx(0.5, rel=0.02)
    assert gain > bench.threshold
    bench, base, scores = base_of(HIDDEN, ('quadratic_drag', 'iron_loss', 'brush_voltage_drop'))
    assert best_twosome(base, scores, bench, lambda text: None) is None


def test_what_is_superfluous_beside_another_has_shown_it_the_way_and_goes():
    """An inertia that changes a little at some moment can always be fitted."""
    one = {'brush_voltage_drop': {'v_b': 0.5}}
    bench, base, scores = base_of(one, ('brush_voltage_drop', 'inertia_change'))
    assert len(scores.pairs) == 1
    told: list[str] = []
    rung, gain, (trial,) = best_twosome(base, scores, bench, told.append)
    assert told[-1] == 'dropping inertia change: no longer needed'
    assert rung.model.effects == (trial.key,) == ('brush_voltage_drop',)
    assert rung.model['brush_voltage_drop.v_b'] == pytest.approx(0.5, rel=0.02)
    assert trial.passes
    assert trial.rung is rung
    assert gain > bench.threshold


def test_what_cannot_be_is_no_part_of_a_twosome(monkeypatch):
    pairs = import_module('motor_sysid.diagnosis.search.pairs')
    monkeypatch.setattr(pairs, 'is_nonsense', lambda model, key, duration: True)
    bench, base, scores = base_of(HIDDEN)
    assert best_twosome(base, scores, bench, lambda text: None) is None


@pytest.mark.slow
def test_a_shaft_whose_fit_ends_in_a_valley_at_first_is_named():
    """The rough fit of it ends at twice the load, and lowers the held-out error the less."""
    scenario, number = named_case('single/flexible_shaft/3/1')
    case = draw(scenario, 6600, number)
    found = diagnose(case.train, case.valid, motor='brushed_dc')
    assert found.effects == ('flexible_shaft',)
    assert found.model['flexible_shaft.r'] == pytest.approx(0.176, rel=0.03)
    before, after = (step.validation_error_percent for step in found.steps)
    assert after < 0.5 * before


def test_of_a_complete_motor_there_is_no_twosome():
    bench, base, scores = base_of({})
    assert best_twosome(base, scores, bench, lambda text: None) is None


def test_a_ladder_that_took_two_steps_at_once_is_told_one_by_one():
    bench, base, scores = base_of(HIDDEN)
    both = base.model
    for key, values in HIDDEN.items():
        both = both.with_effect(key, values, bench.scales)
    final = climb(both, bench)
    ladder = [(base, []), (final, [])]
    told = retold(ladder, bench, scores.weighting, scores.singles)
    assert [set(rung.model.effects) for rung, _ in told] == [
        set(), {'brush_voltage_drop'}, set(HIDDEN)
    ]  # fmt: skip
    assert [trials[0].key for _, trials in told[:-1]] == ['brush_voltage_drop', 'coulomb_friction']
    assert all(trials[0].passes and trials[0].delta_bic > 20.0 for _, trials in told[:-1])
    assert told[-1][0] is final
    assert retold(told, bench, scores.weighting, scores.singles) is told
    unscored = [s for s in scores.singles if s.variant.effect.key != 'coulomb_friction']
    assert retold(ladder, bench, scores.weighting, unscored) is ladder
