"""The batch fit: known parameters come back, and its uncertainty is what it says."""

from dataclasses import replace

from bench_motor import CURRENT_OFFSET, measure, MOTOR, records, voltage_profile
import numpy as np
import pytest

from motor_sysid.estimation.batch import (
    coloured,
    fit,
    fit_multistart,
    make_chain,
    observed_outputs,
    Problem,
)
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.physics.parameters import ParameterSet
from motor_sysid.signals.record import Record

HIDDEN = {'coulomb_friction': {'tau_c': 6e-3}}
TRUTH = {**MOTOR, 'coulomb_friction.tau_c': 6e-3, 'current_offset': CURRENT_OFFSET}


def a_problem(model: Model, data: list[Record]) -> Problem:
    outputs = observed_outputs(model.kind, data)
    return Problem(model, [make_chain(r, model.kind, outputs) for r in data], outputs)


def a_start(factor: float = 1.0) -> Model:
    values = {name: factor * MOTOR[name] for name in ('R', 'L', 'k_t', 'J', 'b')}
    base = Model.base(
        'brushed_dc', {**values, 'omega_eps': 0.3, 'i_eps': 0.01},
        speed_sensor=SpeedSensor.DIFFERENCE,
    )  # fmt: skip
    return base.with_effect('coulomb_friction', {'tau_c': 6e-3 * factor})


@pytest.mark.parametrize('factor', [0.3, 1.0, 3.0])
def test_parameters_come_back_from_far_starts(factor):
    data = records(HIDDEN, kinds=('steps', 'triangle'), seconds=4.0)
    result = fit(a_problem(a_start(factor), data))
    assert result.success
    for name in ('R', 'L', 'k_t', 'J', 'coulomb_friction.tau_c', 'current_offset'):
        assert result.model[name] == pytest.approx(TRUTH[name], rel=0.02)
    assert not result.unidentifiable
    assert not result.warnings


def test_a_fit_that_runs_out_of_steps_says_so():
    result = fit(a_problem(a_start(3.0), records(HIDDEN, seconds=2.0)), reweight=0, iterations=1)
    assert (result.success, result.reason) == (False, 'stopped after 1 step without converging')


def test_stated_uncertainty_is_honest():
    """Errors over sigmas have a spread near 1.

    12 data sets of 7 parameters: with honest sigmas the spread of the 84 ratios lies within 0.7
    and 1.4 in all but one in 1e4 draws; the seeds are fixed.
    """
    ratios = []
    for seed in range(12):
        data = records(HIDDEN, kinds=('steps', 'triangle'), seconds=3.0, seed=seed)
        found = fit(a_problem(a_start(), data)).model
        free = found.parameters.free
        ratios.append([(p.value - TRUTH[p.name]) / (p.sigma or np.nan) for p in free])
    spread = float(np.std(ratios))
    assert 0.7 < spread < 1.4


def test_sensitivities_are_those_of_finer_steps():
    data = records({}, kinds=('steps',), seconds=1.5)
    problem = a_problem(a_start(), data)
    z = problem.vector()
    (found,) = problem.linearize(z)
    for k in range(problem.dimension):
        step = np.zeros_like(z)
        step[k] = 1e-6
        up, down = (problem.simulate((z + s)[np.newaxis, :])[0][:, :, 0] for s in (step, -step))
        exact = (up - down) / 2e-6
        error = np.max(np.abs(found.slope[:, :, k] - exact))
        assert error < 4e-3 * np.max(np.abs(exact))


def test_one_sided_sensitivities_are_near_those_of_both_sides():
    problem = a_problem(a_start(), records({}, kinds=('steps',), seconds=1.5))
    rough = Problem(problem.model, problem.chains, problem.outputs, one_sided=True)
    bound = np.append(problem.vector()[:-1], problem.box()[0][-1])
    for z in (problem.vector(), bound):
        (exact,), (found,) = problem.linearize(z), rough.linearize(z)
        error = np.sum((found.slope - exact.slope) ** 2, axis=(0, 1))
        assert np.all(error < 0.002**2 * np.sum(exact.slope**2, axis=(0, 1)))
        assert np.allclose(found.start, exact.start, rtol=1e-9)


def test_what_cannot_be_seen_is_said():
    """Voltage, current and speed leave the torque constant free once it is not tied to the EMF."""
    data = records({}, kinds=('steps',), seconds=3.0)
    freed = a_start().without_effect('coulomb_friction').with_free(['emf_ratio'])
    result = fit(a_problem(freed, data))
    assert any('in combination' in words for words in result.unidentifiable)
    assert any('emf_ratio' in words or 'k_t' in words for words in result.unidentifiable)


def test_an_inductance_that_no_sample_shows_takes_no_other_parameter_along():
    """With L/R of 0.5 us at 1 ms the derivative by L is rounding; all else is known to 2 %."""
    rng = np.random.default_rng(4)
    true = {**MOTOR, 'L': 1e-6}
    model = Model.base('brushed_dc', true, speed_sensor=SpeedSensor.DIFFERENCE)
    data = [
        measure(model, voltage_profile(kind, 4.0, rng), rng)
        for kind in ('steps', 'triangle')
    ]
    result = fit(a_problem(model, data))
    assert result.undetermined == ('L',)
    assert 'L is not determined by these data' in result.unidentifiable
    for name in ('R', 'k_t', 'J', 'b'):
        p = result.model.parameters[name]
        assert p.sigma < 0.02 * p.value
        assert p.value == pytest.approx(true[name], abs=4 * p.sigma)


def test_a_parameter_that_is_not_seen_at_all_leaves_the_others_their_standard_errors():
    """Where nothing coasts, nothing tells from which command on."""
    data = records({}, kinds=('steps',), seconds=2.0)
    base = a_start().without_effect('coulomb_friction')
    alone = fit(a_problem(base, data))
    model = base.with_effect('drive_coast', {'a': 0.0, 'u_c': 5.0}).with_free(
        ['drive_coast.a'], free=False
    )
    result = fit(a_problem(model, data))
    assert result.model.parameters['drive_coast.u_c'].sigma == np.inf
    for name in ('R', 'L', 'k_t', 'J', 'b'):
        own = result.model.parameters[name].sigma
        assert own == pytest.approx(alone.model.parameters[name].sigma, rel=0.05)


def test_a_parameter_whose_box_holds_one_value_is_fixed():
    data = records({}, kinds=('steps',), seconds=2.0)
    model = a_start().without_effect('coulomb_friction')
    p = model.parameters['R']
    one = replace(p, lower=p.value, upper=p.value)
    items = tuple(one if q.name == 'R' else q for q in model.parameters)
    found = fit(a_problem(replace(model, parameters=ParameterSet(items)), data)).model.parameters
    assert found['R'].value == p.value
    assert found['R'].sigma is None
    assert 0.0 < found['k_t'].sigma < 0.01 * MOTOR['k_t']


def test_a_parameter_on_its_bound_is_said():
    data = records({}, kinds=('steps',), seconds=2.0)
    result = fit(a_problem(a_start(), data))
    if result.model['coulomb_friction.tau_c'] == 0.0:
        assert any('tau_c' in words and 'bound' in words for words in result.warnings)
    else:
        p = result.model.parameters['coulomb_friction.tau_c']
        assert p.value < 4 * (p.sigma or 0)


def test_a_record_that_begins_in_motion_costs_nothing():
    """Uncertain initial states are found beside the parameters."""
    data = records(HIDDEN, kinds=('steps',), seconds=5.0)
    late = [r.slice(1234, len(r)) for r in data]
    result = fit(a_problem(a_start(1.3), late))
    for name in ('R', 'k_t', 'J'):
        assert result.model[name] == pytest.approx(TRUTH[name], rel=0.02)


def test_scaling_all_signals_scales_the_parameters():
    """Ten times the voltage and speed, the same current: R, k_t, L ten times."""
    data = records({}, kinds=('steps',), seconds=2.0)[0]
    scaled = Record(
        data.time,
        {'voltage': 10 * data['voltage'], 'current': data['current'],
         'speed': 10 * data['speed'], 'position': 10 * data['position']},
        data.units,
    )  # fmt: skip
    start = a_start().without_effect('coulomb_friction')
    one = fit(a_problem(start, [data])).model
    ten = fit(a_problem(start.with_values({'R': 21.0, 'L': 2.4e-2}), [scaled])).model
    assert ten['R'] == pytest.approx(10 * one['R'], rel=1e-4)
    assert ten['k_t'] == pytest.approx(one['k_t'], rel=1e-4)
    assert ten['J'] == pytest.approx(0.1 * one['J'], rel=1e-3)


def test_a_coloured_noise_model_whitens():
    rng = np.random.default_rng(8)
    white = rng.normal(size=20000)
    noise = np.zeros_like(white)
    for k in range(1, white.size):
        noise[k] = 0.9 * noise[k - 1] + white[k]
    errors = np.column_stack([noise, rng.normal(size=white.size)])
    flat = coloured([errors], 4).flat(errors[:, :, np.newaxis]).reshape(-1, 2)
    for j in range(2):
        assert np.std(flat[:, j]) == pytest.approx(1.0, rel=0.02)
        assert abs(np.corrcoef(flat[1:, j], flat[:-1, j])[0, 1]) < 0.03


def test_bursts_are_no_noise():
    """What a model lacks shows here and there; the noise is what is left elsewhere."""
    rng = np.random.default_rng(9)
    white = rng.normal(size=(20000, 1))
    bursts = np.zeros_like(white)
    for k in range(1000, 20000, 4000):
        bursts[k : k + 300, 0] = 40 * np.hanning(300)
    clean, spoiled = coloured([white], 4), coloured([white + bursts], 4)
    assert spoiled.sigma[0] == pytest.approx(clean.sigma[0], rel=0.25)
    assert np.abs(spoiled.whiteners[0] - clean.whiteners[0]).max() < 0.3


def test_a_signal_that_rests_tells_nothing_of_its_noise_in_motion():
    """Counts of an encoder have none at rest; nor does a model err there.

    A block that is partly at rest counts.
    """
    noise = np.random.default_rng(9).normal(size=(20000, 1))
    rests = (np.arange(20000) % 5000 > 1250)[:, np.newaxis]
    still, clean = coloured([np.where(rests, 0.0, noise)], 4, 0.5), coloured([noise], 4, 0.5)
    assert still.sigma[0] == pytest.approx(clean.sigma[0], rel=0.1)
    assert coloured([np.zeros((20000, 1))], 4, 0.5).sigma[0] == 0.5


def test_the_start_values_read_from_balances_are_near():
    rng = np.random.default_rng(2)
    model = Model.base('brushed_dc', MOTOR)
    data = [measure(model, voltage_profile('steps', 4.0, rng), rng)]
    start = motor('brushed_dc').start(data, {})
    for name in ('R', 'k_t', 'J'):
        assert start[name] == pytest.approx(MOTOR[name], rel=0.2)


def test_a_cloud_of_starts_saves_a_bad_one():
    data = records(HIDDEN, kinds=('steps', 'triangle'), seconds=3.0)
    lost = a_start().with_values({'R': 40.0, 'L': 1e-6, 'k_t': 0.4, 'J': 1e-6})
    result = fit_multistart(a_problem(lost, data))
    for name in ('R', 'k_t', 'J'):
        assert result.model[name] == pytest.approx(TRUTH[name], rel=0.02)


def test_a_model_that_leaves_much_is_fitted_in_few_steps():
    """Large residuals bend the valley; Gauss and Newton alone run to and fro in it."""
    values = {'R': 15.6, 'L': 2.8e-4, 'k_t': 0.012, 'J': 3.7e-7, 'b': 1.5e-7}
    motor = Model.base('brushed_dc', {**values, 'omega_eps': 1.0, 'i_eps': 6e-5})
    rng = np.random.default_rng(5)
    volts = [voltage_profile(kind, 4.0, rng) for kind in ('steps', 'triangle')]
    worn = motor.with_effect('brush_voltage_drop', {'v_b': 2.4})
    problem = a_problem(motor, [measure(worn, volt, rng) for volt in volts])
    found = [fit(problem, start=problem.vector() + move) for move in (0.0, 0.5)]
    assert all(one.success for one in found)
    assert max(one.iterations for one in found) < 18
    assert found[0].noise['current'] == pytest.approx(found[1].noise['current'], rel=1e-3)


# --- fewer steps of the integration


def test_a_problem_in_few_steps_is_right_where_it_was_asked_to_be():
    """Cogging so fast that one step a sample follows it badly."""
    cogging = {'a_1': 5e-2, 'b_1': 0.0, 'a_2': 0.0, 'b_2': 0.0, 'n': 40.0}
    model = a_start().with_effect('cogging_torque', cogging)
    data = records({**HIDDEN, 'cogging_torque': cogging}, kinds=('steps',), seconds=1.0)
    plain = a_problem(model, data)
    fine = Problem(model, plain.chains, plain.outputs, substeps=16)
    z, away = fine.vector(), 1e-3 * np.random.default_rng(0).standard_normal((8, fine.dimension))
    few = fine.in_steps(1, z)
    assert few.in_steps(4, z) is few, 'it has no more steps to spare'
    for one, other in zip(*(p.linearize(z, parameters=False) for p in (few, fine)), strict=True):
        np.testing.assert_allclose(one.residual, other.residual, atol=1e-9)
    weighting = fit(fine, reweight=1, iterations=1).weighting

    def costs(problem: Problem) -> np.ndarray:
        near = problem.linearize(z)
        return problem.costs(np.concatenate((z[np.newaxis], z + away)), weighting, near)

    right, corrected, wrong = costs(fine), costs(few), costs(plain)
    assert corrected[0] == pytest.approx(right[0], rel=1e-3)
    assert abs(wrong[0] - right[0]) > 0.03 * right[0], 'steps matter here'
    rises, seen = right[1:] - right[0], corrected[1:] - corrected[0]
    assert np.max(np.abs(seen - rises)) < 0.1 * np.max(np.abs(rises))
