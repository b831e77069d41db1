"""A delay that a fit left too short, with an inductance that makes up for it, is walked on."""

import pytest

from motor_sysid.benchmark.answers import true_base_values, true_effect_values
from motor_sysid.benchmark.cases import Case, draw
from motor_sysid.benchmark.scenarios import named_case
from motor_sysid.diagnosis.fitting import bench_of
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.delay_walk import walked
from motor_sysid.diagnosis.search.further import RESTLESS
from motor_sysid.diagnosis.search.rung import climb, leaves_much
from motor_sysid.physics.model import Model

MADE_UP = 0.9e-3
"""Part of the delay, s, that an inductance makes up for."""


@pytest.fixture(scope='module')
def case() -> Case:
    """Return a motor with a delay of 4.9 samples and a cogging that no model here has."""
    return draw(named_case('pair/cogging_torque+input_delay/10/0')[0], 9500, 0)


@pytest.fixture(scope='module')
def linear(case: Case) -> tuple[Bench, Model]:
    """Return the records, ready to fit, and the linear model that a diagnosis begins with."""
    return bench_of(case.train, case.valid, None, 'brushed_dc', {}, 0.2)


def delayed(case: Case, linear: Model, missing: float) -> Model:
    """Return the true model without cogging, its delay shorter by so much and made up for."""
    effects = case.scenario.effects
    truth = {**true_base_values(case, effects), **true_effect_values(case)}
    base = {name: truth[name] for name in linear.parameters.values() if name in truth}
    base['L'] += base['R'] * missing
    delay = truth['input_delay.delay'] - missing
    return linear.with_values(base).with_effect('input_delay', {'delay': delay})


def test_a_delay_that_an_inductance_makes_up_for_is_walked_on(
    case: Case, linear: tuple[Bench, Model]
) -> None:
    bench, model = linear
    stuck = climb(delayed(case, model, MADE_UP), bench)
    right = climb(delayed(case, model, 0.0), bench)
    assert stuck.held.error_percent > 3.0 * right.held.error_percent  # else there was no pit
    found, _ = walked(stuck, bench)
    assert found.held.error_percent == pytest.approx(right.held.error_percent, rel=0.05)
    for name in ('input_delay.delay', 'R', 'L'):
        assert found.model[name] == pytest.approx(right.model[name], rel=0.02), name


def test_a_delay_at_its_best_and_a_model_without_one_stay(
    case: Case, linear: tuple[Bench, Model]
) -> None:
    bench, model = linear
    right = climb(delayed(case, model, 0.0), bench)
    assert walked(right, bench) == (right, bench)
    bare = climb(model, bench)
    assert walked(bare, bench) == (bare, bench)


def test_edges_that_look_like_noise_in_the_held_out_data_do_not_stop_the_walk() -> None:
    """The held-out error is 0.88 times what its own differences tell of noise, and 4 times it."""
    fast = draw(named_case('single/input_delay/10/6')[0], 9500, 6)
    bench, model = bench_of(fast.train, fast.valid, None, 'brushed_dc', {}, 0.2)
    stuck = climb(delayed(fast, model, 1.76e-3), bench)
    assert not leaves_much(stuck, bench, RESTLESS)
    found, _ = walked(stuck, bench)
    truth = true_effect_values(fast)['input_delay.delay']
    assert found.model['input_delay.delay'] == pytest.approx(truth, rel=0.01)
    assert found.held.error_percent < 0.5 * stuck.held.error_percent
