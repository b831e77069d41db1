"""Ways to fit: each finds known motors of an independent simulator; biased ones are biased.

Every test has fixed seeds.  Limits are three to five times the standard deviation over seeds.
"""

import numpy as np
import pytest

from motor_sysid.benchmark.excitation import random_steps
from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.sensors import measure, Sensors
from motor_sysid.benchmark.truth import Control, run
from motor_sysid.cli import main
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import make_chain, Problem, refit
from motor_sysid.estimation.batch.methods import DIRECT, frequency_response
from motor_sysid.estimation.batch.methods.characteristic_points import begun
from motor_sysid.estimation.batch.methods.reference import noise_free_input
from motor_sysid.estimation.batch.methods.sampled import Core
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.simulate import simulate
from motor_sysid.physics.store import save_model
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.record import Record

DT = 1e-3
TRUE = {'R': 2.1, 'L': 2.4e-3, 'k_t': 0.046, 'J': 2.6e-5, 'b': 1.3e-5}
PLANT = Plant(2.1, 2.4e-3, 0.046, 2.6e-5, 1.3e-5)
OFFSET = 0.015
WELL_SEEN = ('R', 'k_t', 'J')
APART = ('ls', 'delay_profiled', 'frequency_response', 'characteristic_points')
"""Methods with tests of their own."""


def bench(*, closed=False, noise=1.0, push=0.0, seed=3, rows=4000):
    """Return a record: tachometer and current sensor with white noise, a random torque `push`."""
    rng = np.random.default_rng(seed)
    shape = random_steps(DT * np.arange(rows), 0.026, rng)
    control = Control(60 * shape, 0.3, 3.0, 24.0) if closed else Control(9 * shape)
    torque, keep = np.zeros(rows), np.exp(-DT / 0.1)
    drawn = rng.standard_normal(rows)
    for k in range(1, rows):
        torque[k] = keep * torque[k - 1] + push * np.sqrt(1 - keep**2) * drawn[k]
    truth = run(PLANT, control, DT, torque)
    sensors = Sensors(0, 0.6 * noise, 0.02 * noise, 1e-4, OFFSET)
    return measure(truth, sensors, DT, rng, control.reference if closed else None)


def start(factor=1.5):
    return Model.base('brushed_dc', {name: factor * value for name, value in TRUE.items()})


def off(model, name):
    return abs(model[name] / TRUE[name] - 1)


@pytest.mark.parametrize('closed', [False, True], ids=['open', 'closed'])
@pytest.mark.parametrize('method', [m for m in DIRECT if m not in APART])
def test_the_known_motor_comes_back_with_an_honest_sigma(method, closed):
    if method == 'two_stage' and not closed:
        with pytest.raises(UserError, match='speed_reference'):
            refit(start(), bench(rows=600), method)
        return
    found = refit(start(), bench(closed=closed), method)
    assert found.success
    for name in WELL_SEEN:
        assert off(found.model, name) < 0.01
        sigma = found.model.parameters[name].sigma
        assert abs(found.model[name] - TRUE[name]) < 4 * sigma + 2e-4 * TRUE[name]
        assert sigma < 0.02 * TRUE[name]
    assert off(found.model, 'L') < 0.05
    assert found.model['current_offset'] == pytest.approx(OFFSET, abs=2e-3)
    fed_back = 0.3 if method == 'two_stage' else 0.15  # what was taken out of the input
    assert found.noise['current'] == pytest.approx(0.02, rel=fed_back)


def test_raw_least_squares_are_biased_and_instruments_are_not():
    """Noise in the regressors draws L and J to zero; filters help, instruments cure."""
    data = bench(noise=5.0)
    ls, svf, iv, tls = (refit(start(), data, m).model for m in ('ls', 'svf', 'iv', 'tls'))
    assert off(ls, 'J') > 0.5
    assert off(ls, 'L') > 0.5
    assert ls['J'] < TRUE['J']
    assert off(svf, 'J') < 0.05
    for consistent in (iv, tls):
        assert off(consistent, 'J') < 0.012
        assert off(consistent, 'J') < off(ls, 'J') / 20


def test_a_loop_that_feeds_back_biases_the_output_error_alone():
    """A random load torque in a closed loop: a noise model, or the reference alone, helps."""
    errors = {'least_squares': [], 'two_stage': [], 'prediction_error': []}
    for seed in (1, 2, 3):
        data = bench(closed=True, noise=0.5, push=6e-3, seed=seed, rows=6000)
        for method, found in errors.items():
            found.append(off(refit(start(), data, method).model, 'J'))
    assert max(errors['least_squares']) > 0.04
    assert max(errors['two_stage']) < 0.035
    assert sum(errors['two_stage']) < 0.7 * sum(errors['least_squares'])
    assert max(errors['prediction_error']) < 0.01


def test_the_reference_takes_the_load_out_of_the_input():
    """What the load changes in the input mostly goes; what the reference asks for stays."""
    pushed, calm = (bench(closed=True, noise=0.5, push=p, seed=3, rows=6000) for p in (6e-3, 0.0))
    cleaned = noise_free_input(pushed, start().kind)['voltage'] - calm['voltage']
    assert np.std(cleaned) < 0.4 * np.std(pushed['voltage'] - calm['voltage'])
    kept = noise_free_input(calm, start().kind)['voltage'] - calm['voltage']
    assert np.std(kept) < 0.03 * np.std(calm['voltage'])


@pytest.mark.parametrize('method', ['huber', 'soft_l1', 'cauchy'])
def test_outliers_hardly_move_a_robust_fit(method):
    data, rng = bench(), np.random.default_rng(0)
    hit = rng.random(len(data)) < 0.03
    current = data['current'] - 2.0 * hit
    speed = data['speed'] + 60 * hit * rng.standard_exponential(len(data))
    torn = data.with_signal('current', current, 'A').with_signal('speed', speed, 'rad/s')
    found, plain = (refit(start(), torn, m).model for m in (method, 'least_squares'))
    assert plain['current_offset'] < -0.03
    assert found['current_offset'] == pytest.approx(OFFSET, abs=3e-3)
    for name in WELL_SEEN:
        assert off(found, name) < 0.003
        assert found.parameters[name].sigma < 0.3 * plain.parameters[name].sigma


@pytest.mark.parametrize(('method', 'limit'), [('svf', 0.2), ('iv', 0.06)])
def test_an_effect_is_one_more_column(method, limit):
    """The sign of a noisy speed is blurred, so that `svf` finds too little dry friction."""
    rng = np.random.default_rng(4)
    plant = PLANT._replace(tau_plus=8e-3, tau_minus=8e-3)
    truth = run(plant, Control(9 * random_steps(DT * np.arange(5000), 0.026, rng)), DT)
    data = measure(truth, Sensors(0, 0.3, 0.01, 1e-4, OFFSET), DT, rng)
    found = refit(start().with_effect('coulomb_friction'), data, method).model
    assert found['coulomb_friction.tau_c'] == pytest.approx(8e-3, rel=limit)
    assert off(found, 'J') < 0.03


@pytest.mark.parametrize('method', ['svf', 'iv', 'tls', 'gls'])
def test_a_filter_of_the_current_sensor_is_no_inductance(method):
    data, lag = bench(), 3e-3
    whole = start(1.0).with_effect('current_sensor_lag', {'lag': lag})
    shown = simulate(whole, data, follow_position=False, substeps=8).outputs['current']
    noisy = shown + 0.02 * np.random.default_rng(0).standard_normal(len(data))
    found = refit(whole, data.with_signal('current', noisy, 'A'), method).model
    assert off(found, 'L') < 0.05
    assert off(found, 'J') < 0.02


@pytest.mark.parametrize('closed', [False, True], ids=['open', 'closed'])
def test_a_linear_motor_is_found_in_its_frequency_response(closed):
    found = refit(start(), bench(closed=closed, rows=8000), 'frequency_response')
    for name in (*WELL_SEEN, 'L'):
        assert off(found.model, name) < 0.015
    assert any('current_offset' in words for words in found.unidentifiable)
    with pytest.raises(UserError, match='leave out coulomb_friction'):
        refit(start().with_effect('coulomb_friction'), bench(rows=600), 'frequency_response')


def free_run(model, seed=0):
    """Return a record of a model that runs freely under steps of its inputs."""
    time, rng = DT * np.arange(600), np.random.default_rng(seed)
    names = model.kind.inputs[0]
    steps = {name: np.repeat(rng.uniform(-5, 5, 20), 30) for name in names}
    record = Record(time, steps, dict.fromkeys(names, 'V'))
    for name, values in simulate(model, record, follow_position=False).outputs.items():
        record = record.with_signal(name, values, BY_NAME[name].units[0])
    return record.with_signal('speed_reference', record['speed'], 'rad/s')


def test_a_frequency_response_is_of_one_input_and_one_sample_time():
    for kind in ('pmsm', 'bldc_six_step'):
        with pytest.raises(UserError, match='linear motors with one input, not for a'):
            refit(Model.base(kind), free_run(Model.base(kind)), 'frequency_response')
    data = bench(rows=2000)
    with pytest.raises(UserError, match='one sample time'):
        refit(start(), [data, data.uniform(2 * DT)], 'frequency_response')


def test_a_frequency_response_of_the_speed_alone_says_what_it_does_not_tell():
    data = bench(rows=8000).select(['voltage', 'speed'])
    model = Model.base('brushed_dc', {**TRUE, 'J': 2 * TRUE['J']})
    problem = Problem(model, [make_chain(data, model.kind, ['speed'])], ['speed'])
    found = frequency_response.fit(problem).model
    assert all(np.isinf(found.parameters[name].sigma) for name in ('R', 'L', 'J'))


def test_a_differenced_speed_is_no_other_motor_in_its_frequency_response():
    rng = np.random.default_rng(5)
    shape = random_steps(DT * np.arange(20000), 0.008, rng)
    truth = run(PLANT, Control(6 * shape), DT)
    data = measure(truth, Sensors(2**20, 0.0, 5e-3, 1e-4, OFFSET), DT, rng)
    model = start().with_speed_sensor(SpeedSensor.DIFFERENCE)
    found = refit(model, data, 'frequency_response')
    for name in (*WELL_SEEN, 'L'):
        assert off(found.model, name) < 0.01


def test_a_delay_is_found_without_a_start():
    """7.4 ms of dead time, values four times too large."""
    rng = np.random.default_rng(6)
    shape = random_steps(DT * np.arange(4000), 0.026, rng)
    data = measure(run(PLANT._replace(delay=7.4e-3), Control(9 * shape), DT),
                   Sensors(0, 0.6, 0.02, 1e-4, OFFSET), DT, rng)  # fmt: skip
    late = start(4.0).with_effect('input_delay')
    found = refit(late, data, 'delay_profiled').model
    assert found['input_delay.delay'] == pytest.approx(7.4e-3, abs=5e-5)
    for name in WELL_SEEN:
        assert off(found, name) < 0.01
    with pytest.raises(UserError, match='add the effect `input_delay`'):
        refit(start(), data, 'delay_profiled')


@pytest.mark.parametrize('factor', [0.15, 6.0])
def test_steiglitz_mcbride_need_no_start_and_end_where_the_output_error_does(factor):
    """Five times the noise, which draws plain least squares tens of percent off."""
    data = bench(closed=True, noise=5.0)
    found = refit(start(factor), data, 'steiglitz_mcbride')
    best = refit(start(), data, 'least_squares').model
    assert 'settled within' in found.reason
    for name in (*WELL_SEEN, 'L'):
        p = found.model.parameters[name]
        assert abs(p.value - TRUE[name]) < 4 * p.sigma
        assert abs(p.value - best[name]) < 0.3 * p.sigma
        assert p.sigma == pytest.approx(best.parameters[name].sigma, rel=0.5)


def test_steiglitz_mcbride_on_an_encoder_and_without_a_current():
    rng = np.random.default_rng(5)
    truth = run(PLANT, Control(9 * random_steps(DT * np.arange(4000), 0.026, rng)), DT)
    data = measure(truth, Sensors(4096, 0.0, 0.02, 1e-4, OFFSET), DT, rng)
    values = {name: 1.5 * value for name, value in TRUE.items()}
    late = Model.base('brushed_dc', values, speed_sensor=SpeedSensor.DIFFERENCE)
    found = refit(late, data, 'steiglitz_mcbride').model
    assert max(off(found, name) for name in WELL_SEEN) < 0.01
    reduced = Model.base('brushed_dc_reduced', {'k_v': 0.1, 'k_a': 1e-3})
    alone = refit(reduced, bench().select(['voltage', 'speed']), 'steiglitz_mcbride').model
    scale = TRUE['R'] / TRUE['k_t']
    assert alone['k_v'] == pytest.approx(TRUE['k_t'] + TRUE['b'] * scale, rel=0.01)
    assert alone['k_a'] == pytest.approx(TRUE['J'] * scale, rel=0.06)  # L is in it


def test_linear_methods_refuse_what_is_not():
    data, pmsm = bench(rows=600), Model.base('pmsm', {})
    with pytest.raises(UserError, match='leave out coulomb_friction'):
        refit(start().with_effect('coulomb_friction'), data, 'steiglitz_mcbride')
    for method in ('steiglitz_mcbride', 'characteristic_points'):
        with pytest.raises(UserError, match=f'`{method}` is for motors whose equations are'):
            Core.of(pmsm, method)
        with pytest.raises(UserError, match='one sample time'):
            refit(start(), [data, data.uniform(2 * DT)], method)


@pytest.mark.parametrize('factor', [0.1, 8.0])
def test_characteristic_points_are_a_start_that_depends_on_no_start(factor):
    """Limits: three times what five times the noise does to the points."""
    data = bench(noise=2.0)
    model = start(factor)
    chain = make_chain(data, model.kind, ('current', 'speed'))
    read = begun(Problem(model, [chain], ('current', 'speed'))).model
    assert max(off(read, name) for name in WELL_SEEN) < 0.03
    assert off(read, 'L') < 0.15
    rough = refit(model, data, 'cpm_gwo', polish=False).model
    assert max(off(rough, name) for name in WELL_SEEN) < 0.15
    for method in ('characteristic_points', 'cpm_gwo'):
        found = refit(model, data, method)
        assert found.success
        assert max(off(found.model, name) for name in WELL_SEEN) < 0.01


def test_characteristic_points_leave_friction_to_the_fit_and_ask_for_steps():
    rng = np.random.default_rng(4)
    plant = PLANT._replace(tau_plus=8e-3, tau_minus=8e-3)
    truth = run(plant, Control(9 * random_steps(DT * np.arange(5000), 0.026, rng)), DT)
    data = measure(truth, Sensors(0, 0.3, 0.01, 1e-4, OFFSET), DT, rng)
    model = start(4.0).with_effect('coulomb_friction')
    found = refit(model, data, 'characteristic_points').model
    assert found['coulomb_friction.tau_c'] == pytest.approx(8e-3, rel=0.03)
    assert off(found, 'J') < 0.01
    with pytest.raises(UserError, match='record steps that last five time constants'):
        refit(start(), bench(closed=True), 'characteristic_points')


def test_on_the_command_line(tmp_path, capsys):
    data = bench()
    path, model = tmp_path / 'run.csv', tmp_path / 'model.yaml'
    header = ','.join(['time [s]', *(f'{n} [{data.units[n]}]' for n in data)])
    table = np.column_stack([data.time, *data.signals.values()])
    np.savetxt(path, table, delimiter=',', header=header, comments='')
    save_model(start(), model)
    assert main(['fit', str(path), '--model', str(model), '--method', 'iv']) == 0
    assert 'solved without iteration' in capsys.readouterr().out
    assert main(['fit', str(path), '--model', str(model), '--method', 'magic']) == 2
    assert 'unknown method `magic`' in capsys.readouterr().err
