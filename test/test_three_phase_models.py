"""PMSM and BLDC: the model against other integrators, and parameters found in drives' records."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from three_phase_records import BLDC, bldc_record, IDEAL, pmsm_record, PMSM_SHEETS

from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor
from motor_sysid.physics.simulate import simulate
from motor_sysid.physics.stepper import Stepper
from motor_sysid.signals.hall import with_hall_position
from motor_sysid.signals.phases import hall_sector
from motor_sysid.signals.record import Record

DT, COUNT = 1e-3, 300
SALIENT = {
    'R': 0.6, 'L_d': 1.2e-3, 'L_q': 1.9e-3, 'psi_f': 0.012, 'J': 6e-5, 'b': 4e-5, 'pole_pairs': 4.0
}  # fmt: skip
BLOCK = {
    'R': 0.8, 'L': 1.1e-3, 'k_e': 0.025, 'J': 3e-5, 'b': 2e-5, 'pole_pairs': 4.0, 'flat': 2.0,
    'angle_offset': 0.5, 'corner': 0.2,
}  # fmt: skip


def solved(rates, inputs: np.ndarray) -> np.ndarray:
    """Return (N, 4) states under held inputs, by an adaptive integrator of high order."""
    x, found = np.zeros(4), []
    for u in inputs:
        found.append(x)
        x = solve_ivp(rates, (0, DT), x, 'DOP853', args=(u,), rtol=1e-8, atol=1e-10).y[:, -1]
    return np.array(found)


def recorded(inputs: np.ndarray, names: str, states: np.ndarray) -> Record:
    signals = {f'voltage_{n}': inputs[:, k] for k, n in enumerate(names)}
    units = dict.fromkeys(signals, 'V') | {'speed': 'rad/s', 'position': 'rad'}
    signals |= {'speed': states[:, 2], 'position': states[:, 3]}
    return Record(DT * np.arange(len(inputs)), signals, units)


def errors(model: Model, record: Record, states: np.ndarray, **options) -> np.ndarray:
    run = simulate(model, record, **options)
    names = [o.signal for o in model.kind.outputs]
    off = [run.outputs[name] - states[:, k] for k, name in enumerate(names)]
    return np.std(off, axis=1) / np.std(states, axis=0)


@pytest.fixture(scope='module')
def turning() -> tuple[Model, Record, np.ndarray]:
    rng = np.random.default_rng(0)
    low, high = [-3, -12], [1, 12]
    inputs = np.repeat(rng.uniform(low, high, (COUNT // 50, 2)), 50, axis=0)
    m, p = SALIENT, SALIENT['pole_pairs']

    def rates(t, x, u):
        i_d, i_q, omega, _ = x
        flux_d, flux_q = m['L_d'] * i_d + m['psi_f'], m['L_q'] * i_q
        torque = 1.5 * p * (flux_d * i_q - flux_q * i_d) - m['b'] * omega
        return [
            (u[0] - m['R'] * i_d + p * omega * flux_q) / m['L_d'],
            (u[1] - m['R'] * i_q - p * omega * flux_d) / m['L_q'],
            torque / m['J'],
            omega,
        ]

    states = solved(rates, inputs)
    return Model.base('pmsm', m), recorded(inputs, 'dq', states), states


def test_pmsm_agrees_with_an_adaptive_integrator(turning):
    model, record, states = turning
    assert 4 * np.max(np.abs(states[:, 2])) * DT > 0.6, 'it turns fast for its sampling'
    assert np.all(errors(model, record, states) < 6e-3)
    assert np.all(errors(model, record, states, substeps=4) < 4e-4)


@pytest.mark.parametrize('angle', [0.14, -0.4])
def test_a_magnet_off_the_recorded_axis_turns_flux_and_inductances(turning, angle):
    """Seen from axes beside those of the magnet, the motor is the one that was integrated."""
    model, record, states = turning
    inputs = np.column_stack([record['voltage_d'], record['voltage_q']])
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])  # of rows: from the magnet's axes to the record's
    seen = np.column_stack([states[:, :2] @ turn, states[:, 2:]])
    model = model.with_values({'frame_error': angle})
    off = errors(model, recorded(inputs @ turn, 'dq', states), seen, substeps=4)
    assert np.all(off < 1.5e-3)


def test_a_sample_at_a_time_is_the_same_motor(turning):
    model, record, states = turning
    plant = Stepper(model, DT)
    found = []
    for u in np.column_stack([record['voltage_d'], record['voltage_q']]):
        found.append(list(plant.state.values()))
        plant.step(u)
    assert np.all(np.std(np.array(found) - states, axis=0) < 1.5e-2 * np.std(states, axis=0))


def test_bldc_agrees_with_an_adaptive_integrator():
    m = BLOCK

    def wave(s):
        y, c = np.arcsin(np.sin(s)) / (0.5 * (np.pi - m['flat'])), m['corner']
        bend = np.clip((np.abs(y) - 1 + c) / (2 * c), 0, 1)
        return np.sign(y) * (np.where(np.abs(y) > 1 + c, 1 + c, np.abs(y)) - c * bend**2)

    def rates(t, x, u):
        s = m['pole_pairs'] * x[3] + m['angle_offset']
        form = np.array([wave(s), wave(s - 2 * np.pi / 3), wave(s + 2 * np.pi / 3)])
        e, i = -m['k_e'] * x[2] * form, np.array([x[0], x[1], -x[0] - x[1]])
        rise = (u - np.mean(u - e) - m['R'] * i - e) / m['L']
        torque = -m['k_e'] * form @ i - m['b'] * x[2]
        return [rise[0], rise[1], torque / m['J'], x[2]]

    rng = np.random.default_rng(0)
    size = np.repeat(rng.uniform(-9, 9, COUNT // 50), 50)
    turn = np.cumsum(0.02 * size)[:, np.newaxis]
    inputs = 3 + size[:, np.newaxis] * np.sin(turn - np.array([0, 2, 4]) * np.pi / 3)
    states = solved(rates, inputs)
    record = recorded(inputs, 'abc', states)
    assert np.all(errors(Model.base('bldc', m), record, states, substeps=4) < 6e-3)


def test_start_values_need_no_iteration(turning):
    _, record, states = turning
    for k, axis in enumerate('dq'):
        record = record.with_signal(f'current_{axis}', states[:, k], 'A')
    found = motor('pmsm').start([record], {})
    for name in ('R', 'L_d', 'L_q', 'psi_f', 'J', 'pole_pairs'):
        assert found[name] == pytest.approx(SALIENT[name], rel=0.05), name


def test_pmsm_parameters_are_found_in_the_loop():
    truth, record = pmsm_record()
    model = fit_model([record], motor='pmsm').model
    assert model['pole_pairs'] == truth.pole_pairs, 'read from the record'
    assert model['psi_f'] == pytest.approx(truth.k_e / truth.pole_pairs, rel=2e-3)
    for name in ('R', 'L_d', 'L_q', 'J'):
        assert model[name] == pytest.approx(getattr(truth, name), rel=0.01), name
    mean = np.mean((0.03, -0.02, 0.01))
    assert model['current_offset_a'] == pytest.approx(0.03 - mean, abs=5e-3)
    assert model['current_offset_b'] == pytest.approx(-0.02 - mean, abs=5e-3)


def test_bldc_parameters_are_found_in_the_loop():
    truth, record = bldc_record()
    model = fit_model([record], motor='bldc').model
    assert model['pole_pairs'] == truth.pole_pairs, 'read from the record'
    for name, value in {'R': truth.R, 'L': truth.L_d, 'k_e': truth.k_e, 'J': truth.J}.items():
        assert model[name] == pytest.approx(value, rel=0.01), name
    assert model['flat'] == pytest.approx(2 * np.pi / 3, rel=0.01)
    assert model['corner'] == pytest.approx(truth.corner, rel=0.2)
    assert model['angle_offset'] == pytest.approx(0.0, abs=0.01)


def test_bldc_holds_while_a_phase_floats():
    _, record = bldc_record(0.4, sensors=IDEAL)
    values = {'R': BLDC.R, 'L': BLDC.L_d, 'k_e': BLDC.k_e, 'J': BLDC.J, 'b': BLDC.b,
              'corner': BLDC.corner}  # fmt: skip
    run = simulate(Model.base('bldc', {**values, 'pole_pairs': BLDC.pole_pairs}), record)
    for name in ('current_a', 'current_b', 'speed'):
        error = np.std(run.outputs[name] - record[name]) / np.std(record[name])
        assert error < 0.04, name


def test_pole_pairs_that_no_record_tells_are_asked_for():
    still = Record(
        DT * np.arange(500),
        {n: np.full(500, 0.1) for n in (
            'voltage_d', 'voltage_q', 'current_d', 'current_q', 'speed')},
        dict.fromkeys(('voltage_d', 'voltage_q'), 'V')
        | dict.fromkeys(('current_d', 'current_q'), 'A') | {'speed': 'rad/s'},
    )  # fmt: skip
    with pytest.raises(UserError, match='pole_pairs'):
        motor('pmsm').start([still], {})


def test_a_position_is_made_from_hall_sectors():
    truth, record = bldc_record(1.0, sensors=IDEAL)
    sectors = hall_sector(truth.pole_pairs * record['position']).astype(float)
    others = [name for name in record if name != 'position']
    halls = record.select(others).with_signal('hall_sector', sectors, '1')
    made = with_hall_position(halls, {'pole_pairs': truth.pole_pairs})
    shift = made['position'] - record['position']
    turn = 2 * np.pi / truth.pole_pairs
    assert np.median(shift / turn) == pytest.approx(round(np.median(shift / turn)), abs=0.02)
    assert np.quantile(np.abs(shift - np.median(shift)), 0.95) < 0.1 * turn
    start = motor('bldc').start([made], {'pole_pairs': truth.pole_pairs})
    assert start['k_e'] == pytest.approx(truth.k_e, rel=0.02)
    with pytest.raises(UserError, match='pole_pairs'):
        fit_model([halls], motor='bldc')


def turned_record(angle: float) -> Record:
    """Return a record whose drive takes an axis `angle` electrical rad behind the magnet for d."""
    _, record = pmsm_record(2.0)
    for kind, unit in (('voltage', 'V'), ('current', 'A')):
        d, q = record[f'{kind}_d'], record[f'{kind}_q']
        cos, sin = np.cos(angle), np.sin(angle)
        record = record.with_signal(f'{kind}_d', d * cos - q * sin, unit)
        record = record.with_signal(f'{kind}_q', d * sin + q * cos, unit)
    return record


@pytest.mark.parametrize('degrees', [90, -90, 180, 45])
def test_axes_that_are_mixed_up_are_refused_with_their_angle(degrees):
    record = turned_record(np.radians(degrees))
    with pytest.raises(UserError, match=rf'lies {degrees:+d}'.replace('+', '') + '|lies -180'):
        fit_model([record], motor='pmsm', nominal={'pole_pairs': 4.0})


def test_axes_that_are_a_little_off_are_made_up_for():
    upright = motor('pmsm').start([turned_record(0.0)], {'pole_pairs': 4.0})
    found = motor('pmsm').start([turned_record(0.1)], {'pole_pairs': 4.0})
    assert found['frame_error'] == pytest.approx(0.1, abs=0.02)
    for name in ('R', 'L_d', 'L_q', 'psi_f', 'J'):
        assert found[name] == pytest.approx(upright[name], rel=0.03), name


@pytest.mark.parametrize('angle', [-0.14, 0.07, 0.14, 0.3])
def test_pole_pairs_are_told_though_axes_are_off(angle):
    assert motor('pmsm').start([turned_record(angle)], {})['pole_pairs'] == 4.0


def test_a_salient_motor_is_found_though_its_axes_are_off():
    """Inductances that differ by half turn along: 8 electrical degrees change nothing else."""
    upright = fit_model([turned_record(0.0)], motor='pmsm').model
    turned = fit_model([turned_record(0.14)], motor='pmsm').model
    assert turned['frame_error'] - upright['frame_error'] == pytest.approx(0.14, abs=1e-3)
    for name in ('R', 'L_d', 'L_q', 'psi_f', 'J'):
        assert turned[name] == pytest.approx(upright[name], rel=2e-3), name


def test_a_voltage_that_stands_still_in_the_stator_moves_no_parameter():
    """The rotor turns by up to a fifth of a radian in each of the drive's periods of 100 us.

    Without `hold_squared` the flux is some 15 of its standard errors off, and the age of the angle
    that explains as much is R T^2 / (12 L_d) = 0.5 us.  Two seeds, fixed.
    """
    machine = PMSM_SHEETS[1].machine
    drives = [
        pmsm_record(1.5, 1e-4, machine=machine, seed=seed, top=500.0, push_d=0.7)[1]
        for seed in (1, 2)
    ]
    model = fit_model(drives, motor='pmsm', nominal={'pole_pairs': 4.0}).model
    hold = model.parameters['hold_squared']
    assert hold.value == pytest.approx(1e-8, abs=4 * hold.sigma)
    assert hold.sigma < 1e-9
    truth = {'R': machine.R, 'L_d': machine.L_d, 'psi_f': machine.k_e / 4, 'J': machine.J}
    for name, value in truth.items():
        assert model[name] == pytest.approx(value, rel=1e-3), name


def test_a_magnet_beside_the_recorded_axis_is_told_with_the_way_to_turn():
    kind = motor('pmsm')

    def said(degrees: float, sigma: float | None = 1e-3) -> str:
        model = Model.base('pmsm', {'frame_error': np.radians(degrees), 'pole_pairs': 4.0})
        model = model.with_estimates({}, {'frame_error': sigma}) if sigma else model
        return kind.remark(model.parameters)

    assert said(-8.0).startswith('The magnet lies 8 electrical degrees behind the d axis')
    assert '(2 of the shaft)' in said(-8.0)
    assert said(-8.0).endswith('turn the zero of its rotor angle by -8 electrical degrees')
    assert 'ahead of' in said(8.0)
    assert said(2.0) == said(8.0, sigma=0.1) == said(8.0, sigma=None) == ''
