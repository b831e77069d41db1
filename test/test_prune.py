"""What later effects have made superfluous goes again, and laws wider than needed are narrowed."""

from dataclasses import replace

from bench_motor import a_motor, measure, records, voltage_profile
import numpy as np
import pytest
from test_trials import prepared

from motor_sysid.diagnosis.search.gates import is_doubted, LEAST_CERTAINTY
from motor_sysid.diagnosis.search.prune import led_out, numbered, pruned, relieved, special_case
from motor_sysid.diagnosis.search.rung import climb, profile_cost
from motor_sysid.physics.effect import FAITHFUL
from motor_sysid.physics.model import SpeedSensor

TAU = 6e-3
UNEVEN = {'tau_c_plus': 1.2 * TAU, 'tau_c_minus': 0.8 * TAU}


def fitted(friction):
    """Return the fit of asymmetric friction and brushes to a motor with that friction."""
    data = records(
        {**friction, 'brush_voltage_drop': {'v_b': 0.5}}, kinds=('steps', 'triangle'), seconds=3.0
    )
    bench, base = prepared(data, SpeedSensor.DIFFERENCE)
    wide = base.model.with_effect('asymmetric_coulomb_friction', UNEVEN, bench.scales)
    wide = wide.with_effect('brush_voltage_drop', {'v_b': 0.5}, bench.scales)
    return climb(wide, bench), bench


def steps_of(hidden, rng):
    """Return two records of voltage steps of each of several motors, by name."""
    return {
        name: [measure(a_motor(law), voltage_profile('steps', 4.0, rng), rng) for _ in range(2)]
        for name, law in hidden.items()
    }


def test_even_friction_needs_no_law_for_each_direction():
    rung, bench = fitted({'coulomb_friction': {'tau_c': TAU}})
    gains, said = {'asymmetric_coulomb_friction': 500.0}, []
    slim = pruned(rung, bench, gains, said.append)
    assert slim.model.effects == ('coulomb_friction', 'brush_voltage_drop')
    assert slim.model['coulomb_friction.tau_c'] == pytest.approx(TAU, rel=0.02)
    assert gains['coulomb_friction'] == 500.0
    assert said == ['coulomb_friction does in place of asymmetric_coulomb_friction']
    asked = replace(bench, offered={'asymmetric_coulomb_friction', 'brush_voltage_drop'})
    assert pruned(rung, asked, {}, said.append) is rung  # nobody wants to hear of the other one


def test_what_was_added_on_a_law_that_was_too_wide_goes_with_it():
    """The last effect stays otherwise: it has just passed."""
    rung, bench = fitted({'coulomb_friction': {'tau_c': TAU}})
    last = rung.model.with_effect('quadratic_drag', {'k_d': 1e-10}, bench.scales)
    said = []
    slim = pruned(climb(last, bench), bench, {}, said.append)
    assert slim.model.effects == ('coulomb_friction', 'brush_voltage_drop')
    assert said[-1] == 'dropping quadratic drag: no longer needed'
    kept = climb(slim.model.with_effect('quadratic_drag', {'k_d': 1e-10}, bench.scales), bench)
    assert pruned(kept, bench, {}, said.append) is kept


@pytest.mark.parametrize('pit', [True, False])
def test_what_only_led_out_of_a_pit_goes_at_once(pit):
    """A friction that was too small, and no drag: the one is right with the other, and without."""
    bench, base = prepared(
        records({'coulomb_friction': {'tau_c': TAU}}, kinds=('steps', 'triangle'), seconds=3.0),
        SpeedSensor.DIFFERENCE,
    )
    alone = base.model.with_effect('coulomb_friction', {'tau_c': TAU}, bench.scales)
    right = climb(alone, bench)
    stuck = alone.with_values({'coulomb_friction.tau_c': 0.5 * TAU}).with_free(
        ['coulomb_friction.tau_c'], free=False
    )
    before = climb(stuck, bench) if pit else right
    drag = right.model.with_effect('quadratic_drag', {'k_d': 1e-10}, bench.scales)
    both, said = climb(drag, bench), []
    left = led_out(both, before, bench, said.append)
    if pit:
        assert left.model.effects == ('coulomb_friction',)
        assert left.model['coulomb_friction.tau_c'] == pytest.approx(TAU, rel=0.02)
    else:
        assert left is both  # it has just passed: what is without it was there before
    assert said == (['dropping quadratic drag: no longer needed'] if pit else [])


def test_uneven_friction_keeps_its_law():
    rung, bench = fitted({'asymmetric_coulomb_friction': UNEVEN})
    assert pruned(rung, bench, {}, lambda text: None) is rung


@pytest.mark.parametrize(
    ('gain', 'held', 'kept'), [(1e6, 'even', False), (1e6, 'uneven', True), (1e4, 'even', True)]
)
def test_what_no_law_has_right_is_no_evidence_against_a_special_case_that_runs_better(
    gain, held, kept
):
    """Friction uneven by some 1 % in training data, and in held-out ones or not."""
    rng, off = np.random.default_rng(4), 8e-3
    uneven = {'tau_c_plus': (1 + off) * TAU, 'tau_c_minus': (1 - off) * TAU}
    hidden = {
        'uneven': {'asymmetric_coulomb_friction': uneven},
        'even': {'coulomb_friction': {'tau_c': TAU}},
    }
    runs = steps_of(hidden, rng)
    bench, base = prepared(runs['uneven'], SpeedSensor.DIFFERENCE, held=runs[held])
    model = base.model.with_effect('asymmetric_coulomb_friction', uneven, bench.scales)
    rung = climb(model, bench)
    wide, even = 'asymmetric_coulomb_friction', 'coulomb_friction'
    slim = special_case(rung.model, wide, even, bench.scales)
    costs = [
        profile_cost(one, bench, rung.result.weighting)[0]
        for one in (climb(slim, bench, rung.result.weighting), rung)
    ]
    assert bench.threshold + 10 < costs[0] - costs[1] < FAITHFUL**2 * 1e6
    gains = {'asymmetric_coulomb_friction': gain}
    left = pruned(rung, bench, gains, lambda text: None, last=True).model.effects
    assert left == (('asymmetric_coulomb_friction',) if kept else ('coulomb_friction',))


@pytest.mark.parametrize(
    ('held', 'vague', 'kept'),
    [('even', True, False), ('even', False, True), ('rises', True, True)],
)
def test_a_rise_of_friction_that_is_not_told_from_nothing_has_to_show_in_held_out_data(
    held, vague, kept
):
    rng, rise = np.random.default_rng(3), {'tau_c': TAU, 'tau_s': 0.07 * TAU, 'omega_s': 10.0}
    hidden = {
        'rises': {'stribeck_friction': rise},
        'even': {'coulomb_friction': {'tau_c': TAU}},
    }
    runs = steps_of(hidden, rng)
    bench, base = prepared(runs['rises'], SpeedSensor.DIFFERENCE, held=runs[held])
    wide = base.model.with_effect('stribeck_friction', rise, bench.scales)
    rung = climb(wide, bench)
    if vague:
        model = rung.model
        sigmas = {'stribeck_friction.tau_s': model['stribeck_friction.tau_s']}
        model = replace(model, parameters=model.parameters.with_sigmas(sigmas))
        rung = replace(rung, result=replace(rung.result, model=model))
    assert is_doubted(rung.model, 'stribeck_friction') is vague
    left = pruned(rung, bench, {}, lambda text: None, last=True).model.effects
    assert left == (('stribeck_friction',) if kept else ('coulomb_friction',))


@pytest.mark.parametrize(('drop', 'kept'), [(6e-3, False), (2e-2, True)])
def test_what_does_next_to_nothing_beside_another_goes_whatever_its_evidence(drop, kept):
    """Brushes of 6 mV: evidence enough in 12 s of data, and next to none of the error."""
    hidden = {'coulomb_friction': {'tau_c': TAU}, 'brush_voltage_drop': {'v_b': drop}}
    bench, base = prepared(
        records(hidden, kinds=('steps', 'triangle'), seconds=6.0), SpeedSensor.DIFFERENCE
    )
    model = base.model
    for key, values in hidden.items():
        model = model.with_effect(key, values, bench.scales)
    rung = climb(model, bench)
    slim = climb(model.without_effect('brush_voltage_drop'), bench, rung.result.weighting)
    costs = [profile_cost(one, bench, rung.result.weighting) for one in (slim, rung)]
    assert costs[0][0] - costs[1][0] > bench.threshold + np.log(costs[0][1])
    left = pruned(rung, bench, {}, lambda text: None, last=True).model.effects
    assert left == (*slim.model.effects, *(('brush_voltage_drop',) if kept else ()))


def test_a_special_case_takes_the_place_and_the_mean_of_what_it_narrows():
    rung, bench = fitted({'coulomb_friction': {'tau_c': TAU}})
    model = rung.model.with_values(
        {f'asymmetric_coulomb_friction.{name}': value for name, value in UNEVEN.items()}
    )
    slim = special_case(model, 'asymmetric_coulomb_friction', 'coulomb_friction', bench.scales)
    assert slim.effects == ('coulomb_friction', 'brush_voltage_drop')
    assert slim['coulomb_friction.tau_c'] == pytest.approx(TAU)
    assert slim['brush_voltage_drop.v_b'] == model['brush_voltage_drop.v_b']


def test_what_is_left_of_several_waves_is_numbered_from_the_first():
    rung, bench = fitted({'coulomb_friction': {'tau_c': TAU}})
    wave = {'a_1': 1e-3, 'b_1': 2e-3, 'a_2': 0.0, 'b_2': 1e-4, 'n': 40.0}
    model = rung.model
    for key in ('cogging_torque', 'cogging_torque_2'):
        model = model.with_effect(key, wave, bench.scales)
    left = numbered(model.without_effect('cogging_torque'), bench.scales)
    assert left.effects == (*rung.model.effects, 'cogging_torque')
    assert left['cogging_torque.b_1'] == 2e-3
    assert left['cogging_torque.n'] == 40.0
    assert numbered(model, bench.scales) is model


@pytest.mark.parametrize('warm', [True, False])
def test_what_held_out_data_prove_stays_though_training_data_hardly_show_it(warm):
    """A winding that hardly warms in training data, and does, or does not, in held-out ones."""
    rng, heating = np.random.default_rng(1), {'h': 0.01, 't_th': 10.0}
    motor = a_motor({'armature_heating': heating})
    calm = [measure(motor, 0.4 * voltage_profile('steps', 4.0, rng), rng) for _ in range(3)]
    hot = measure(motor, voltage_profile('steps', 8.0, rng), rng)
    bench, base = prepared(calm[:2], SpeedSensor.DIFFERENCE, held=[hot if warm else calm[2]])
    rung = climb(base.model.with_effect('armature_heating', heating, bench.scales), bench)
    slim = climb(base.model, bench, rung.result.weighting)
    costs = [profile_cost(one, bench, rung.result.weighting) for one in (slim, rung)]
    assert costs[0][0] - costs[1][0] > LEAST_CERTAINTY
    assert costs[0][0] - costs[1][0] < bench.threshold + 2 * np.log(costs[0][1])
    left = pruned(rung, bench, {}, lambda text: None, last=True).model.effects
    assert left == (('armature_heating',) if warm else ())


@pytest.mark.parametrize(('held', 'left'), [(0.0, ('coulomb_friction',)), (0.1, None)])
def test_what_held_out_data_run_better_without_goes_in_the_end(held, left):
    """Brushes that only the training data have, and that are certain there; friction in both."""
    rng = np.random.default_rng(6)
    friction, drops = {'coulomb_friction': {'tau_c': TAU}}, (0.1, held)
    runs = [
        measure(
            a_motor(friction | ({'brush_voltage_drop': {'v_b': drop}} if drop else {})),
            voltage_profile('steps', 4.0, rng), rng,
        )
        for drop in drops
    ]  # fmt: skip
    bench, base = prepared(runs[:1], SpeedSensor.DIFFERENCE, held=runs[1:])
    one = climb(base.model.with_effect('coulomb_friction', {'tau_c': TAU}, bench.scales), bench)
    both = climb(one.model.with_effect('brush_voltage_drop', {'v_b': 0.1}, bench.scales), bench)
    said = []
    slim = relieved([(base, []), (one, []), (both, [])], bench, (), said.append)
    assert slim.model.effects == (left or both.model.effects)
    assert (slim is both) is (not said) is (left is None)
    assert relieved([(base, []), (one, [])], bench, (), said.append) is one
    assert relieved([(one, []), (both, [])], bench, one.model.effects, said.append) is both
