"""The parts of the online estimators, each against what it is to be equal to."""

from closed_loop import DT, FRICTION, TRUE
import numpy as np
from online_tools import KINDS
import pytest
from scipy.linalg import solve_triangular
from scipy.signal import lsim

from motor_sysid.estimation.online.algebra import joseph, settle, solve_upper
from motor_sysid.estimation.online.base import Tuning
from motor_sysid.estimation.online.coordinates import Coordinates
from motor_sysid.estimation.online.ekf import FilterpyUpdate
from motor_sysid.estimation.online.filters import StateVariableFilter
from motor_sysid.estimation.online.joint import JointFilter
from motor_sysid.estimation.online.laws import evaluate_columns, LawColumns
from motor_sysid.estimation.online.learners.directional import Directional
from motor_sysid.estimation.online.learners.forgetting import Forgetting
from motor_sysid.estimation.online.motion import Motion
from motor_sysid.estimation.online.regressors import signal_names
from motor_sysid.estimation.online.sizes import prior_sigma, Sizes
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record


def test_filter_is_exact_for_straight_signals():
    w, h, rng = 40.0, 1e-2, np.random.default_rng(0)
    signal = rng.standard_normal(200)
    one = StateVariableFilter(1, w)
    one.start(np.zeros(1))
    values = [0.0]
    previous = 0.0
    for value in signal:
        one.step(np.array([previous]), np.array([value]), h)
        previous = value
        values.append(float(one.value[0]))
    t = h * np.arange(201)
    system = ([w**2], [1, 2 * w, w**2])
    assert np.allclose(lsim(system, np.append(0.0, signal), t)[1], values, atol=1e-12)


@pytest.mark.parametrize('measured', [1, 2, 3])
def test_the_compiled_update_is_that_of_filterpy(measured):
    rng = np.random.default_rng(measured)
    for states in range(3, 13):
        other = FilterpyUpdate(0, states, 3)
        spread = rng.standard_normal((states, states)) * 10.0 ** rng.uniform(-3, 3, states)
        p = spread.T @ spread
        rows = rng.standard_normal((measured, states)) * (rng.random((measured, states)) < 0.5)
        noise = 10.0 ** rng.uniform(-3, 3, measured)
        x, z = rng.standard_normal(states), rng.standard_normal(measured)
        size = np.sqrt(np.diag(p))
        found, expected = joseph(x, p, z, rows, noise), other(x.copy(), p.copy(), z, rows, noise)
        for state, covariance in (found, expected):
            settle(state, covariance, np.empty(0), np.empty(0))
        assert np.abs((found[0] - expected[0]) / size).max() < 1e-12 * max(1, np.abs(z).max())
        assert np.abs((found[1] - expected[1]) / np.outer(size, size)).max() < 1e-12


def test_a_triangle_is_solved_as_scipy_does():
    rng = np.random.default_rng(0)
    upper = np.triu(rng.standard_normal((9, 9))) + 3 * np.eye(9)
    right = rng.standard_normal((9, 3))
    assert solve_upper(upper, right) == pytest.approx(solve_triangular(upper, right), rel=1e-12)


@pytest.mark.parametrize('kind', KINDS)
def test_motion_is_the_simulation_and_its_derivatives(kind):
    model = Model.base(kind).with_effect('constant_load_torque', {'tau_l': 0.0})
    if kind == 'brushed_dc':
        model = model.with_values(TRUE)
    n = len(model.kind.states)
    name = model.kind.parameters[0].name
    motion = Motion(model, Coordinates([model.parameters[name]]))
    x, z = np.arange(1.0, n + 1), np.log([model[name]])
    steps = np.full(n + 1, 1e-4)

    def after(model, start):
        (drive,) = model.kind.inputs[0]
        record = Record(np.array([0.0, DT]), {drive: np.full(2, 2.0)}, {drive: 'V'})
        initial = dict(zip(model.kind.states, start, strict=True))
        run = simulate(model, record, initial=initial, follow_position=False).outputs
        shown = {o.state: run[o.signal][1] - (model[o.bias] if o.bias else 0.0)
                 for o in model.kind.outputs}  # fmt: skip
        return np.array([shown[state] for state in model.kind.states])

    move = motion.advance(x, z, steps, np.array([2.0]), 0.0, DT)
    base = after(model, x)
    assert move.state == pytest.approx(base, rel=1e-12)
    for k in range(n):
        moved = after(model, x + 1e-3 * np.eye(n)[k])
        assert move.slope[:, k] == pytest.approx((moved - base) / 1e-3, rel=1e-6, abs=1e-9)
    moved = after(model.with_values({name: model[name] * np.exp(1e-6)}), x)
    assert move.slope[:, n] == pytest.approx((moved - base) / 1e-6, rel=1e-3, abs=1e-6)
    loaded = after(model.with_values({'constant_load_torque.tau_l': 1e-3}), x)
    assert -move.by_force[:, 0] == pytest.approx((loaded - base) / 1e-3, rel=1e-6, abs=1e-9)


def test_own_states_move_with_the_motor_and_have_derivatives():
    model = Model.base('brushed_dc', TRUE)
    model = model.with_effect('flexible_shaft', {'r': 0.5, 'w_a': 60.0, 'z': 0.1})
    model = model.with_effect('armature_heating', {'h': 0.01, 't_th': 1.0})
    motion = Motion(model, Coordinates([]))
    assert motion.beginning(np.array([1.0, 2.0, 3.0])).tolist() == [1, 2, 3, 0, 2, 0]
    x, u, steps = np.array([1.0, 40.0, 2.0, 0.01, 35.0, 0.5]), np.array([3.4]), np.full(6, 1e-4)
    move = motion.advance(x, np.empty(0), steps, u, 0.0, DT)
    base = move.state.copy()
    slip = 0.5 * (x[1] - x[4] + base[1] - base[4])
    assert base[3] - x[3] == pytest.approx(slip * DT, rel=0.02)
    assert base[5] - x[5] == pytest.approx((TRUE['R'] * x[0] ** 2 - x[5]) * DT, rel=0.05)
    slopes = move.slope.copy()
    for k in range(6):
        moved = motion.advance(x + 1e-3 * np.eye(6)[k], np.empty(0), steps, u, 0.0, DT).state
        assert slopes[:, k] == pytest.approx((moved - base) / 1e-3, rel=2e-3, abs=1e-7)


def test_columns_are_the_law_with_one_amplitude_at_one():
    from motor_sysid.physics.effects import effect

    model = Model.base('brushed_dc', TRUE).with_effect('cogging_torque', {'n': 12.0})
    model = model.with_effect('coulomb_friction', {'tau_c': FRICTION})
    model = model.with_effect('brush_voltage_drop')
    model = model.with_values({'cogging_torque.b_1': 3e-3})
    model = model.with_free(['cogging_torque.b_1'], False)
    laws = LawColumns(model, ['torque'], ('i', 'omega', 'theta', 'u', 't', 'turn'))
    names = [column.name.partition('.')[2] for column in laws.columns]
    assert names == ['a_1', 'a_2', 'b_2', '', 'tau_c', '']
    assert laws.needs == {'omega', 'theta'}
    found = np.empty(len(laws.columns))
    evaluate_columns(*laws.table, np.array([1.0, 0.05, 0.3, 2.0, 0.0, 0.05]), found)
    cogging, friction = effect('cogging_torque').laws['torque'], effect('coulomb_friction')
    unit = [cogging(0.3, 0.05, *row, 12.0) for row in np.eye(4)]
    expected = [unit[0], unit[2], unit[3], 3e-3 * unit[1]]
    expected += [friction.laws['torque'](0.05, model['omega_eps'], 1.0), 0.0]
    assert found == pytest.approx(expected, rel=1e-12)


def test_regression_without_forgetting_is_least_squares():
    rng = np.random.default_rng(0)
    x = rng.standard_normal((400, 3))
    y = x @ [1.0, -2.0, 0.5] + 0.1 * rng.standard_normal(400)
    found = Forgetting(np.zeros(3), np.full(3, 1e3), 1.0, 10)
    for row, value in zip(x, y, strict=True):
        found.update(row, float(value))
    exact = np.linalg.lstsq(x, y, rcond=None)[0]
    assert np.allclose(found.coefficients, exact, atol=2e-3)
    expected = 0.1 * np.sqrt(np.diag(np.linalg.inv(x.T @ x)))
    assert np.allclose(np.sqrt(np.diag(found.covariance())), expected, rtol=0.5)


def test_covariance_sees_correlated_errors():
    rng = np.random.default_rng(0)
    ratios = []
    for _ in range(12):
        t = np.arange(4000)
        x = np.column_stack([np.sin(t / 40.0), np.ones(t.size)])
        noise = np.convolve(rng.standard_normal(t.size + 99), np.ones(100) / 10, mode='valid')
        found = Forgetting(np.zeros(2), np.full(2, 10.0), 1.0, 300)
        for row, value in zip(x, x @ [1.0, 2.0] + 0.1 * noise, strict=True):
            found.update(row, float(value))
        error = found.coefficients - [1.0, 2.0]
        ratios.append(error / np.sqrt(np.diag(found.covariance())))
    assert 0.4 < np.sqrt(np.mean(np.square(ratios))) < 2.0


@pytest.mark.parametrize('kind', ['pmsm', 'bldc', 'bldc_six_step'])
def test_sensor_offsets_are_columns_of_their_sensors_alone(kind):
    """What a motor's own law gives is in its balance already, beside the parameters."""
    model = Model.base(kind)
    signals, shown = signal_names(model.kind), model.kind.shown
    for balance in model.kind.balances:
        assert LawColumns(model, [balance.force], signals).columns == ()
    sensors = [f'{output.signal}_sensor' for output in model.kind.outputs]
    assert {c.name for c in LawColumns(model, sensors, signals).columns} == set(shown)


def test_directional_forgetting_is_not_tied_to_the_first_samples():
    """A prior that grows with the signals leaves a coefficient that is excited little free."""
    rng, true = np.random.default_rng(0), np.array([1.0, 1.0])
    x = rng.standard_normal((2000, 2)) * [1.0, 2e-3]
    x[:50] *= 1e-2
    y = x @ true + 1e-4 * rng.standard_normal(2000)
    learner = Directional(np.array([1.5, 0.5]), np.ones(2), 0.9999, 20)
    for row, value in zip(x, y, strict=True):
        learner.update(row, value)
    assert learner.coefficients == pytest.approx(true, abs=0.03)


@pytest.mark.parametrize('learner', [Forgetting, Directional])
def test_a_long_standstill_without_noise_makes_nobody_deaf(learner):
    rng = np.random.default_rng(0)
    found = learner(np.zeros(2), np.full(2, 1e3), 0.999, 10)

    def learn(truth, rows):
        for row in rng.standard_normal((rows, 2)):
            found.update(row, float(row @ truth) + 1e-3 * rng.standard_normal())

    learn([1.0, -2.0], 2000)
    for _ in range(30_000):
        found.update(np.zeros(2), 0.0)
    learn([1.5, -1.0], 3000)
    assert np.allclose(found.coefficients, [1.5, -1.0], atol=0.1)


@pytest.mark.parametrize('kind', KINDS)
def test_no_parameter_is_less_known_than_anything_within_its_bounds(kind):
    """The unscented filter looks as far as that: of a time squared of 6e-8 s^2, 1 is absurd."""
    model = Model.base(kind)
    names = [p.name for p in model.parameters.free]
    sizes = Sizes.per_unit(model).seen(24.0, np.zeros(len(model.kind.states)))
    for name, sigma in zip(names, prior_sigma(model, names, sizes, 1e-3), strict=True):
        p = model.parameters[name]
        if p.lower <= 0:
            assert 0 < sigma < 0.3 * (p.upper - p.lower), name


def test_a_filter_whose_covariance_is_none_begins_anew(monkeypatch):
    model = Model.base('brushed_dc')
    joint = JointFilter(model, 1e-3, ('current', 'speed'), Tuning())
    samples = [(1e-3 * k, 1e-3, np.array([6.0]), np.array([0.1, float(k)])) for k in range(4)]
    for sample in samples[:2]:
        joint.step(*sample)
    with monkeypatch.context() as broken:

        def singular(*given: object) -> None:
            raise np.linalg.LinAlgError('Matrix is singular to machine precision.')

        broken.setattr(joint._sensing, 'measure', singular)
        joint.step(*samples[2])
    assert joint.lost == 1
    joint.step(*samples[3])
    assert joint.lost == 1
    assert np.isfinite(joint.covariance()).all()
