"""Held-out data that ask for other values of the model's own parameters."""

from dataclasses import replace

from bench_motor import a_motor, measure, MOTOR, records, voltage_profile
import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.search.bench import make_bench
from motor_sysid.diagnosis.search.rung import climb, judge
from motor_sysid.diagnosis.verdict.words import _moved
from motor_sysid.diagnosis.where.other_values import held_at_best, MOVED, OtherValues
from motor_sysid.diagnosis.where.remainder import Remainder
from motor_sysid.estimation.batch import Problem
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor

STEPS, SEED = 'steps', 5


def steps(changes: dict[str, float], seed: int = SEED, seconds: float = 6.0):
    """Return a record of the motor with some of its parameters multiplied."""
    rng = np.random.default_rng(seed)
    model = a_motor({}).with_values({name: f * MOTOR[name] for name, f in changes.items()})
    return measure(model, voltage_profile(STEPS, seconds, rng), rng)


def fitted(held):
    """Return a fit to a motor as it is, judged on another record."""
    start = {**MOTOR, 'omega_eps': 0.4, 'i_eps': 1e-2}
    model = Model.base('brushed_dc', start, speed_sensor=SpeedSensor.DIFFERENCE)
    bench = make_bench(records({}, seconds=3.0), [held], motor('brushed_dc'), model, 0.3, {})
    return bench, climb(model, bench)


def at_best(bench, rung):
    problem = Problem(rung.model, bench.held, bench.outputs)
    return held_at_best(problem, rung.held.residuals, rung.result.weighting)


def test_the_parameter_that_is_another_there_is_told_with_its_value():
    bench, rung = fitted(steps({'R': 1.1}))
    best, other = at_best(bench, rung)
    assert other.parameter.name == 'R'
    assert other.value == pytest.approx(1.1 * MOTOR['R'], rel=0.01)
    assert other.parameter.value == pytest.approx(MOTOR['R'], rel=0.01)
    assert other.share > other.alone > 0.95
    times = rung.held.error_percent / best.error_percent
    assert other.times == pytest.approx(times, rel=1e-6)


def test_an_input_that_is_weaker_there_is_told():
    """Its voltage was reckoned with a supply that gives less: no parameter alone does that."""
    record = steps({})
    bench, rung = fitted(record.with_signal('voltage', record['voltage'] / 0.94, 'V'))
    _, other = at_best(bench, rung)
    assert other.gain == pytest.approx(0.94, abs=0.005)
    assert other.by_gain > 0.95
    assert 'input were 6 % weaker there than recorded' in _moved(other)
    assert at_best(*fitted(steps({'R': 1.1})))[1].by_gain == 0.0


def test_the_same_motor_asks_for_nothing_else():
    """Chance gives each parameter a thousandth of the squares at most, in 6000 samples."""
    bench, rung = fitted(steps({}))
    assert at_best(bench, rung)[1].share < 0.01


def test_what_is_left_is_judged_with_the_parameters_at_their_best():
    bench, rung = fitted(steps({}))
    wrong = {'b': 1.3 * rung.model['b'], 'k_t': 1.02 * rung.model['k_t']}
    biased = judge(replace(rung.result, model=rung.model.with_values(wrong)), bench)
    assert biased.held.error_percent > 1.5 * rung.held.error_percent
    best, _ = at_best(bench, biased)
    assert best.error_percent == pytest.approx(rung.held.error_percent, rel=0.02)


@pytest.mark.parametrize(
    ('share', 'error', 'structured'),
    [(0.8, 5.0, True), (0.3, 5.0, False), (0.8, 1.05, False)],
)
def test_parameters_that_are_others_there_are_missing_physics_unless_a_trifle(
    share, error, structured
):
    one = motor('brushed_dc').parameters[0]
    left = Remainder({}, 0.5, error, 4.0, 0.0, other=OtherValues(share, one, 2.0, share))
    assert left.moves is (share > MOVED)
    assert left.structured is structured


@pytest.mark.parametrize(
    ('sigma', 'alone', 'moves'),
    [(0.1, 0.8, True), (0.5, 0.8, False), (np.inf, 0.8, False), (0.5, 0.2, True)],
    ids=['known', 'left open', 'not seen', 'others move'],
)
def test_a_value_that_the_training_data_leave_open_is_no_missing_physics(sigma, alone, moves):
    """It moves by 1; larger motion in the held-out data may show it far better."""
    one = replace(motor('brushed_dc').parameters[0], value=1.0, sigma=sigma)
    left = Remainder({}, 0.5, 5.0, 4.0, 0.0, other=OtherValues(0.8, one, 2.0, alone))
    assert left.moves is left.structured is moves


def test_a_winding_that_is_another_over_held_out_data_is_no_complete_model():
    """The training data know nothing of it, and none of the candidates is it (0.6 times L)."""
    train = [steps({}, seed) for seed in (1, 2)]
    found = diagnose(train, [steps({'L': 0.6})], effects=['coulomb_friction', 'quadratic_drag'])
    assert found.verdict is Verdict.UNKNOWN_EFFECT
    said = found.reasons[0]
    assert said.startswith('L (armature inductance) is not the same in all records')
    assert '(2.4 mH)' in said
    assert '-40 % (95 %: -41 to -38 %) in record 3' in said
    assert 'over record 1 and record 2 alone' in found.reasons[1]
    assert not found.lent


def test_a_value_on_its_bound_is_not_told():
    """It is no other value; the share of all parameters is."""
    one = replace(motor('brushed_dc').parameters[0], value=2.0)
    said, bound = (_moved(OtherValues(0.8, one, value, 0.5)) for value in (2.3, 2.0))
    assert f'50 % with {one.name} about 2.3' in said
    assert 'about' not in bound
    assert '80 % of its square' in bound
