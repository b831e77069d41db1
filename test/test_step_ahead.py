"""Two effects of which neither passes alone are found by a step ahead."""

from types import SimpleNamespace

import numpy as np
import pytest

from motor_sysid.benchmark.cases import draw
from motor_sysid.benchmark.scenarios import named_case
from motor_sysid.diagnosis import diagnose, Settings, Verdict
from motor_sysid.diagnosis.search import step_ahead
from motor_sysid.diagnosis.search.gates import (
    NO_EVIDENCE,
    TAKES_OVER,
    TOO_LITTLE,
    UNCERTAIN,
    UNPHYSICAL,
    UNSTEADY,
)
from motor_sysid.diagnosis.search.step_ahead import (
    fast_waves,
    hopeful,
    in_its_place,
    second_of,
    stands,
    STEPS,
    steps_from,
)
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import SpeedSensor
from motor_sysid.physics.motors import motor

THRESHOLD = 20.0


def trial(delta, note=f'{TOO_LITTLE} 0.0 % only', *, error=1.0, excess=1.0, blocks=1.0):
    """Return a trial; `blocks` is the error in the second half of the held-out data."""
    noise = np.random.default_rng(0).normal(size=(2000, 1))
    size = np.where(np.arange(2000) < 1000, error, error * blocks)[:, np.newaxis]
    held = SimpleNamespace(
        residuals=(noise * size,), channel_percent={'speed': float(np.sqrt(np.mean(size**2)))}
    )
    kind = motor('brushed_dc')
    model = SimpleNamespace(effects=(), parameters=SimpleNamespace(free=()), kind=kind)
    return SimpleNamespace(
        delta_bic=delta, note=note, rung=SimpleNamespace(held=held, model=model), excess=excess,
        gain_percent=100.0 * (1.0 - error),
    )  # fmt: skip


def test_only_what_held_out_data_alone_refuse_is_looked_beyond():
    best, second, third = (trial(d, UNSTEADY) for d in (9e4, 8e4, 7e4))
    others = [trial(1e6, UNPHYSICAL), trial(1e6, ''), trial(10.0)]
    assert hopeful([third, *others, second, best], THRESHOLD) == [best, second][:STEPS]
    assert hopeful(others, THRESHOLD) == []


@pytest.mark.parametrize(
    ('left', 'wrong', 'error', 'made'),
    [(1.1, 0.0, 1.0, True), (1.1, 0.1, 1.0, False), (1.0, 0.0, 0.6, False), (1.0, 0.0, 0.4, True)],
)
def test_from_what_is_noise_a_step_is_made_by_what_halves_the_training_error(
    monkeypatch, left, wrong, error, made
):
    """Beside brushes and a step of the load, a resistance of twice the size left noise."""
    monkeypatch.setattr(step_ahead, 'profile_cost', lambda *_: (1000.0 * left, 1000))
    first, training = trial(9e4), SimpleNamespace(error_percent=60.0)
    first.rung.training = SimpleNamespace(error_percent=60.0 * error)
    bench = SimpleNamespace(threshold=THRESHOLD, wrong=wrong)
    assert bool(steps_from(SimpleNamespace(training=training), [first], bench, None)) is made


def test_a_friction_may_be_nothing_for_want_of_a_load():
    friction = trial(9e4, f'b (viscous friction) {TAKES_OVER}')
    assert hopeful([friction], THRESHOLD) == [friction]


def wave(key, note, delta=9.0):
    """Return a trial of an effect that was fitted."""
    rung = SimpleNamespace(model=SimpleNamespace(effects=(key,)))
    scored = SimpleNamespace(variant=SimpleNamespace(effect=effect(key)))
    return SimpleNamespace(key=key, scored=scored, rung=rung, note=note, delta_bic=delta)


@pytest.mark.parametrize('note', [UNCERTAIN, f'{TOO_LITTLE} nothing'])
def test_a_wave_that_has_most_evidence_and_does_not_pass_may_want_finer_steps(note):
    ripple, other = wave('torque_ripple', note), wave('coulomb_friction', NO_EVIDENCE, 8.0)
    assert fast_waves([other, ripple]) == [ripple]
    for better in (wave('coulomb_friction', UNCERTAIN, 10.0), wave('cogging_torque', '', 10.0)):
        assert fast_waves([other, ripple, better]) == []
    assert fast_waves([other, wave('cogging_torque_2', note)]) == []
    ripple.rung.model.effects = ()
    assert fast_waves([other, ripple]) == fast_waves([]) == []


@pytest.mark.parametrize(
    ('second', 'expected'),
    [
        (trial(1e5, '', error=0.5), True),
        (trial(1e5, '', error=0.97), False),
        (trial(1e5, '', error=0.5, excess=1.5), False),
        (trial(1e5, '', error=0.3, blocks=4.0), False),
    ],
    ids=['noise only', 'no gain', 'leaves more than noise', 'helps here and harms there'],
)
def test_two_steps_must_stand_all_tests_together(second, expected):
    old = trial(0.0)
    old.rung.model.parameters = ()
    assert stands(second.rung, old.rung, second.excess) is expected


@pytest.mark.parametrize(
    ('kind', 'expected'),
    [('mechanical_axis', True), ('brushed_dc', False), ('brushed_dc_reduced', False)],
)
def test_noise_of_a_current_that_drives_goes_through_the_motor(kind, expected):
    """What is measured drives an axis; a voltage is what the drive was told."""
    old, second = trial(0.0), trial(1e5, '', error=0.5, excess=1.3)
    old.rung.model.parameters = ()
    second.rung.model.kind = motor(kind)
    assert stands(second.rung, old.rung, second.excess) is expected
    assert not stands(second.rung, old.rung, 1.6)


def test_what_held_out_data_refuse_counts_if_both_together_stand():
    """After the first step alone the error was larger; both lower it to half."""
    old = trial(0.0)
    old.rung.model.parameters = ()
    both, neither = trial(1e5, UNSTEADY, error=0.5), trial(2e5, UNPHYSICAL, error=0.4)
    for one in (both, neither):
        variant = SimpleNamespace(effect=effect('quadratic_drag'), inherits=False)
        one.key, one.scored, one.passes = 'quadratic_drag', SimpleNamespace(variant=variant), False
    assert second_of([neither, both], old.rung) is both
    assert second_of([neither], old.rung) is None


@pytest.fixture(scope='module')
def losses():
    """Iron loss shows in the held-out staircase of speeds, friction of gears in training."""
    scenario, number = named_case('pair/iron_loss+load_dependent_friction/10/0')
    return draw(scenario, 151, number)


OFFERED = (
    'coulomb_friction', 'iron_loss', 'load_dependent_friction', 'quadratic_drag', 'friction_drift'
)  # fmt: skip


@pytest.mark.slow
def test_losses_that_hide_each_other_are_both_named(losses):
    found = diagnose(losses.train, losses.valid, motor='brushed_dc', effects=OFFERED)
    assert found.verdict is Verdict.EFFECT_MISSING
    assert set(found.effects) == {'iron_loss', 'load_dependent_friction'}
    assert found.steps[-1].validation_error_percent < 1.02 * found.noise_floor_percent


@pytest.mark.slow
def test_no_more_effects_than_the_user_allows(losses):
    found = diagnose(
        losses.train, losses.valid, motor='brushed_dc', effects=OFFERED,
        settings=Settings(max_effects=1),
    )  # fmt: skip
    assert found.effects == ()
    assert found.verdict is Verdict.UNKNOWN_EFFECT


def fit_of(effects, error=1.0):
    """Return what stands for a fit with these effects and that held-out error."""
    held = SimpleNamespace(error_percent=error)
    return SimpleNamespace(model=SimpleNamespace(effects=effects), held=held)


DELAY, LAG = 'input_delay', 'current_sensor_lag'


@pytest.mark.parametrize(
    ('left', 'less', 'error', 'taken'),
    [
        ((LAG,), 500.0, 1.0, True),
        ((LAG,), 5.0, 1.0, False),
        ((LAG,), 500.0, 1.1, False),
        ((DELAY, LAG), 500.0, 1.0, False),
        ((DELAY,), 500.0, 1.0, False),
    ],
    ids=['does better', 'does as well', 'spoils the held-out data', 'both are needed', 'goes'],
)
def test_a_step_takes_the_place_of_what_it_makes_superfluous(
    monkeypatch, left, less, error, taken
):
    old, both, slim = fit_of((DELAY,)), fit_of((DELAY, LAG)), fit_of(left, error)
    costs = {id(old): 1e4, id(slim): 1e4 - less}
    monkeypatch.setattr(step_ahead, 'pruned', lambda *_: slim)
    monkeypatch.setattr(step_ahead, 'profile_cost', lambda one, *_: (costs[id(one)], 4000))
    gains, first = {DELAY: 1000.0}, SimpleNamespace(key=LAG)
    found = in_its_place(both, first, old, None, None, gains, lambda _: None)
    assert found is (slim if taken else None)
    assert gains == {DELAY: 1000.0} | ({LAG: 1000.0 + less} if taken else {})


def test_a_lag_takes_the_place_of_a_delay_that_another_speed_sensor_made_of_it():
    """With the wrong one, half a sample late, a delay has more evidence; beside the lag, none."""
    scenario, number = named_case('single/current_sensor_lag/1/1')
    case = draw(scenario, 7900, number)
    offered = ('input_delay', 'current_sensor_lag')
    found = diagnose(case.train, case.valid, motor='brushed_dc', effects=offered)
    assert found.effects == ('current_sensor_lag',)
    assert found.model.speed_sensor is SpeedSensor.DIFFERENCE
    assert found.model['current_sensor_lag.lag'] == pytest.approx(0.552e-3, rel=0.01)
    assert found.model['L'] == pytest.approx(0.180e-3, rel=0.02)
