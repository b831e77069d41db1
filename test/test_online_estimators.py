"""What each online estimator is for: the property that sets it apart from the others."""

from functools import cache

from closed_loop import drive, DT, samples, TRUE, true_motor, WRONG, wrong_motor
import numpy as np
from online_tools import BY_REGRESSION, feed, identifier, score
import pytest
from scipy.optimize import lsq_linear
from three_phase_records import pmsm_record

from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.sensors import measure, Sensors
from motor_sysid.benchmark.truth import Control, run
from motor_sysid.estimation.online import OnlineIdentifier, Tuning
from motor_sysid.estimation.online.algebra import joseph
from motor_sysid.estimation.online.arrival import bounded_step
from motor_sysid.estimation.online.coordinates import Coordinates
from motor_sysid.estimation.online.dual_ekf import DualUpdate
from motor_sysid.estimation.online.learners.directional import Directional
from motor_sysid.estimation.online.learners.forgetting import Forgetting
from motor_sysid.estimation.online.learners.gradient import Gradient
from motor_sysid.estimation.online.learners.window import Window
from motor_sysid.estimation.online.motion import Motion
from motor_sysid.estimation.online.sliding_mode import LOAD
from motor_sysid.estimation.online.ukf import Unscented
from motor_sysid.physics.model import Model, SpeedSensor

LIMITS = {
    'rls_directional': 0.02, 'compound_ls': 0.02, 'window_ls': 0.02, 'ukf': 0.01, 'mhe': 0.01,
    'dual_ekf': 0.05, 'mras': 0.02,
}  # fmt: skip


@pytest.mark.parametrize('key', LIMITS)
def test_finds_the_known_motor_and_says_how_well(key):
    rms, worst = score(feed(identifier(key), samples()).estimate())
    assert worst < LIMITS[key]
    assert rms < 4


# ---- regressions --------------------------------------------------------------------------------


@pytest.mark.parametrize('key', BY_REGRESSION)
def test_laws_read_the_motor_as_it_was_found(key):
    """Gear friction is a share of `k_t i`: with the `k_t` of the start it is twice too large."""
    gear = Model.base('brushed_dc', TRUE).with_effect('load_dependent_friction', {'mu': 0.2})
    begun = Model.base('brushed_dc', {**TRUE, 'k_t': 0.5 * TRUE['k_t']})
    begun = begun.with_effect('load_dependent_friction')
    found = feed(identifier(key, begun), drive(gear, 4.0, 0, 4096)).estimate()
    mu = found['load_dependent_friction.mu']
    assert mu.identifiable
    assert mu.value == pytest.approx(0.2, abs=min(4 * mu.sigma, 0.05))


def test_compound_least_squares_find_a_jump_that_a_long_memory_averages_away():
    hot = drive(true_motor(R=1.8), 2.0, 3, 4096)
    hot[:, 0] += 2000 * DT
    errors = {}
    for key in ('rls', 'compound_ls'):
        online = feed(feed(identifier(key), samples()[:2000]), hot)
        errors[key] = abs(online.estimate()['R'].value - 1.8)
    assert errors['compound_ls'] < 0.1
    assert errors['compound_ls'] < 0.25 * errors['rls']


def regressors(count, directions):
    """Return (N, 3) regressors of no correlation; after 200 only the first `directions` last."""
    x = np.tile([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], (count // 4, 1))
    x[200:, directions:] = 0.0
    return x


@pytest.mark.parametrize('scale', [1.0, 1e-6])
def test_directional_forgetting_keeps_what_is_not_excited(scale):
    """... in any units of the parameters."""
    true = np.array([1.0, -2.0, 0.5])
    units = np.array([1.0, 1.0, scale])
    found = Directional(np.zeros(3), np.full(3, 10.0) / units, np.exp(-1 / 50), 5)
    noise = iter(0.01 * np.random.default_rng(1).standard_normal(4000))
    for row in regressors(3000, 2):
        found.update(row * units, float(row @ true + next(noise)))
    assert found.coefficients * units == pytest.approx(true, abs=0.02)
    for value in (4.0, 8.0):
        true[0] = value
        for row in regressors(600, 2)[200:]:
            found.update(row * units, float(row @ true + next(noise)))
        assert found.coefficients * units == pytest.approx(true, abs=0.05)


def test_directional_forgetting_forgets_nothing_for_noise():
    rng = np.random.default_rng(0)
    found = Directional(np.zeros(3), np.full(3, 10.0), np.exp(-1 / 50), 5)
    for row in regressors(200, 3):
        found.update(row, float(row.sum()))
    known = found.covariance()
    for row in 1e-5 * rng.standard_normal((5000, 3)):
        found.update(row, 0.0)
    assert found.coefficients == pytest.approx(np.ones(3), abs=1e-2)
    assert np.all(np.diag(found.covariance()) < 10 * np.diag(known) + 1e-8)


def test_a_window_is_least_squares_of_its_samples_alone():
    rng, block = np.random.default_rng(1), 10
    x = rng.standard_normal((500, 3))
    y = np.where(np.arange(500) < 200, x @ [5.0, 5.0, 5.0], x @ [1.0, -2.0, 0.5])
    y = y + 0.01 * rng.standard_normal(500)
    found = Window(np.zeros(3), np.full(3, 1e4), np.exp(-1 / 100), block)
    for row, value in zip(x, y, strict=True):
        found.update(row, float(value))
    exact = np.linalg.lstsq(x[400:], y[400:], rcond=None)[0]
    assert found.coefficients == pytest.approx(exact, abs=1e-6)


def test_model_reference_adaptation_never_moves_away():
    """The integral of past errors falls with every step, however unequal the regressors."""
    sigma, true = np.array([1.0, 3.0, 0.1]), np.array([0.7, -1.0, 0.05])
    mixed = np.array([[1.0, 0.9, 0.0], [0.0, 0.3, 0.0], [0.0, 0.5, 0.02]])
    found = Gradient(np.zeros(3), sigma, 0.99, 5)
    for row in np.random.default_rng(0).standard_normal((3000, 3)) @ mixed / sigma:
        before = found.coefficients.copy()
        found.update(row, float(row @ true))
        least = np.linalg.solve(found._information, found._target)
        far, near = before - least, found.coefficients - least
        assert near @ found._information @ near <= far @ found._information @ far
    assert found.coefficients == pytest.approx(least, rel=1e-2)


def test_the_gradient_ends_where_least_squares_of_the_same_memory_do():
    """... and says how far it still is from there."""
    rng, true = np.random.default_rng(3), np.array([2.0, -0.5])
    start, sigma = np.zeros(2), np.full(2, 10.0)
    learners = [kind(start, sigma, np.exp(-1 / 200), 10) for kind in (Gradient, Forgetting)]
    x = rng.standard_normal((2000, 2)) @ np.array([[1.0, 0.8], [0.0, 0.2]])
    y = x @ true + 0.1 * rng.standard_normal(2000)
    for k, (row, value) in enumerate(zip(x, y, strict=True)):
        for one in learners:
            one.update(row, float(value))
        if k == 30:
            away = learners[0].coefficients - learners[1].coefficients
            assert np.all(np.abs(away) < 3.0 * np.sqrt(np.diag(learners[0].covariance())))
    gradient, exact = learners
    error = np.sqrt(np.diag(exact.covariance()))
    assert np.all(np.abs(gradient.coefficients - exact.coefficients) < 0.5 * error)
    assert np.diag(gradient.covariance()) == pytest.approx(error**2, rel=0.5)


# ---- Kalman filters -----------------------------------------------------------------------------


def test_the_unscented_transform_of_a_linear_motor_is_its_linearization():
    model = Model.base('brushed_dc', TRUE)
    motion = Motion(model, Coordinates([]))
    rng = np.random.default_rng(0)
    spread = rng.standard_normal((3, 3))
    x, p, u = np.array([1.0, 30.0, 2.0]), spread @ spread.T, np.array([6.0])
    exact = motion.advance(x, np.empty(0), np.full(3, 1e-4), u, 0.0, DT)
    slope = exact.slope.copy()
    found = Unscented(3, 0)(motion, x, p, np.empty(0), u, 0.0, DT)
    assert found.state == pytest.approx(exact.state, rel=1e-9)
    assert found.slope == pytest.approx(slope, rel=1e-5, abs=1e-8)
    assert np.abs(found.curve).max() < 1e-9


def test_the_unscented_transform_sees_the_curve_of_a_parameter():
    """The mean over a distribution of resistances, against a large sample of them."""
    model, size = Model.base('brushed_dc', TRUE), 0.2
    motion = Motion(model, Coordinates([model.parameters['R']]))
    x, z, u, h = np.array([8.0, 30.0, 0.0]), np.array([np.log(1.2)]), np.array([6.0]), 5e-3
    p = np.diag([1e-12, 1e-12, 1e-12, size**2])
    found = Unscented(3, 1)(motion, np.concatenate((x, z)), p, np.empty(0), u, 0.0, h)
    many = z + size * np.random.default_rng(0).standard_normal((20_000, 1))
    after, _ = motion.scatter(np.tile(x, (len(many), 1)), many, u, 0.0, h)
    spread = found.slope[0, 3] ** 2 * size**2 + float(np.sum(found.curve[0] ** 2))
    assert found.state[0] == pytest.approx(after[:, 0].mean(), abs=4 * after[:, 0].std() / 141)
    assert np.sqrt(spread) == pytest.approx(after[:, 0].std(), rel=0.05)
    straight = motion.advance(x, z, np.array([1e-5] * 3 + [1e-4]), u, 0.0, h).state[0]
    assert abs(found.state[0] - after[:, 0].mean()) < 0.2 * abs(straight - after[:, 0].mean())


HIDDEN = {
    'flexible_shaft': {'r': 0.5, 'w_a': 60.0, 'z': 0.1},
    'lugre_friction': {'tau_c': 0.02, 's': 0.3, 'omega_s': 20.0, 'z_s': 0.05, 't_b': 1e-3},
    'backlash': {'r': 0.5, 'phi_g': 0.05, 'w_a': 200.0, 'z': 0.3},
    'armature_heating': {'h': 4e-3, 't_th': 3.0},
}  # fmt: skip


FOLLOWED = [(name, key) for name in HIDDEN for key in ('ekf', 'mhe')]
FOLLOWED += [('backlash', 'ukf'), ('backlash', 'dual_ekf')]


@cache
def hidden(name):
    truth = Model.base('brushed_dc', TRUE).with_effect(name, HIDDEN[name])
    return truth, drive(truth, 4.0, 0, 20_000)


@pytest.mark.parametrize(('name', 'key'), FOLLOWED)
def test_own_states_of_effects_are_states_of_the_filter(name, key):
    """What a twist, a bend or heat does is put down to J, R and friction where it is not known."""
    truth, rows = hidden(name)
    off = {**truth.parameters.values(), 'R': 1.5, 'J': 1e-4, 'current_offset': 0.0}
    begun = truth.with_values(off).with_speed_sensor(SpeedSensor.DIFFERENCE)
    found = feed(identifier(key, begun), rows).estimate()
    size = f'{name}.{next(iter(HIDDEN[name]))}'
    for one, limit in (('R', 0.01), ('k_t', 0.01), ('J', 0.02), (size, 0.2)):
        assert found[one].value == pytest.approx(truth[one], rel=limit)
        slack = 6 * found[one].sigma + 5e-3 * truth[one]
        assert found[one].value == pytest.approx(truth[one], abs=slack)


def test_two_filters_are_one_where_the_parameters_are_known():
    rng = np.random.default_rng(0)
    spread, rows = rng.standard_normal((3, 3)), rng.standard_normal((2, 5))
    p = np.zeros((5, 5))
    p[:3, :3], p[3:, 3:] = spread @ spread.T, 1e-20 * np.eye(2)
    x, z, noise = rng.standard_normal(5), rng.standard_normal(2), np.array([0.1, 2.0])
    state, covariance = DualUpdate(3, 5, 2)(x, p, z, rows, noise)
    expected = joseph(x, p, z, rows, noise)
    assert state == pytest.approx(expected[0], abs=1e-9)
    assert covariance == pytest.approx(expected[1], abs=1e-9)


# ---- moving horizon -----------------------------------------------------------------------------


def test_a_step_between_bounds_is_the_best_one():
    rng = np.random.default_rng(0)
    for _ in range(20):
        a, b = rng.standard_normal((12, 4)), rng.standard_normal(12)
        lower, upper = -rng.uniform(0, 0.3, 4), rng.uniform(0, 0.3, 4)
        best = lsq_linear(a, b, (lower, upper)).x
        found = bounded_step(a.T @ a, a.T @ b, lower, upper)
        assert np.all((lower <= found) & (found <= upper))
        assert np.linalg.norm(a @ found - b) < 1.1 * np.linalg.norm(a @ best - b)


@pytest.mark.parametrize('horizon', [0.2, 2.0])
def test_no_sample_costs_more_than_four_steps(horizon, monkeypatch):
    steps = []
    plain = Motion.advance

    def counted(self, *arguments):
        steps.append(self)
        return plain(self, *arguments)

    online = identifier('mhe', tuning=Tuning(horizon=horizon))
    monkeypatch.setattr(Motion, 'advance', counted)
    rows = samples()[:1500]
    for k in range(len(rows)):
        before = len(steps)
        feed(online, rows[k : k + 1])
        assert len(steps) - before <= 1 + 4


def test_a_moving_horizon_stays_within_bounds_and_says_so():
    model = wrong_motor()
    box = model.parameters['R']
    tight = [type(box)('R', box.unit, 2.0, 1.5, 4.0, box.description)]
    tight += [p for p in model.parameters if p.name != 'R']
    from dataclasses import replace

    start = replace(model, parameters=type(model.parameters)(tuple(tight)))
    found = feed(identifier('mhe', start), samples()[:2000]).estimate()['R']
    assert found.value == pytest.approx(1.5)
    assert not found.identifiable


# ---- load torque --------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def loaded():
    """Return a record of a motor whose load comes on after a second, simulated independently."""
    dry = {'tau_plus': 0.012, 'tau_minus': 0.012}
    load = {'step_torque': 0.03, 'step_time': 1.0}
    plant = Plant(1.2, 1.5e-3, 0.055, 8e-5, 3e-5, **dry, **load)
    levels = 60.0 * np.array([1.0, -0.5, 0.8, -1.0])[np.arange(2000) // 500]
    truth = run(plant, Control(levels, 0.15, 1.0, 24.0, 0.0, 4096), DT)
    return measure(truth, Sensors(4096, 0.0, 0.02, 0.005, 0.0), DT, np.random.default_rng(0))


def observer(record, percent, until):
    """Return the estimates of an observer whose model is as good as that."""
    values = {**{name: TRUE[name] for name in WRONG}, 'coulomb_friction.tau_c': 0.012}
    model = Model.base('brushed_dc', WRONG, speed_sensor=SpeedSensor.DIFFERENCE)
    model = model.with_effect('coulomb_friction').with_effect('constant_load_torque')
    sigmas = {name: 0.01 * percent * value for name, value in values.items()}
    model = model.with_estimates(
        {**values, 'current_offset': 0.0}, {**sigmas, 'current_offset': 0.01}
    )
    online = OnlineIdentifier(model, 'sliding_mode', DT, ['voltage'], ['current', 'speed'])
    measured = np.column_stack([record['current'], record['speed']])
    online.update(record.time[:until], record['voltage'][:until, np.newaxis], measured[:until])
    return online.estimate()


@pytest.mark.parametrize(('until', 'load'), [(980, 0.0), (1100, 0.03), (1700, 0.03)])
def test_the_load_is_found_within_a_tenth_of_a_second(loaded, until, load):
    found = observer(loaded, 2.0, until)
    estimate = found[LOAD]
    assert estimate.value == pytest.approx(load, abs=4e-3)
    assert abs(estimate.value - load) < 3 * estimate.sigma
    assert estimate.identifiable
    others = [e for name, e in found.items() if name != LOAD]
    assert not any(e.identifiable for e in others)


def of_three_phases(key, machine, record, start):
    """Return the estimates of a salient three-phase motor."""
    names = 'R', 'L_d', 'L_q', 'psi_f', 'J', 'b'
    true = (machine.R, machine.L_d, machine.L_q, machine.k_e / machine.pole_pairs, machine.J)
    values = dict(zip(names, (*true, machine.b), strict=True))
    begin = {name: values[name] * factor for name, factor in zip(names, start, strict=True)}
    model = Model.base(
        'pmsm', {**begin, 'pole_pairs': machine.pole_pairs}, speed_sensor=SpeedSensor.DIFFERENCE
    ).with_effect('constant_load_torque')
    if key == 'sliding_mode':
        model = model.with_estimates(values, {name: 0.02 * v for name, v in values.items()})
    inputs, outputs = ['voltage_d', 'voltage_q'], ['current_d', 'current_q', 'speed', 'position']
    online = OnlineIdentifier(model, key, record.dt, inputs, outputs)
    columns = [np.column_stack([record[name] for name in part]) for part in (inputs, outputs)]
    online.update(record.time, *columns)
    return values, online.estimate()


def test_a_three_phase_motor_goes_through_the_same_balances_and_steps():
    machine, record = pmsm_record(1.5, top=150.0)
    start = (1.4, 0.7, 1.3, 0.75, 1.4, 1.5)
    values, found = of_three_phases('mhe', machine, record, start)
    for name, limit in (('R', 0.02), ('L_d', 0.05), ('L_q', 0.05), ('psi_f', 0.02), ('J', 0.03)):
        assert found[name].value == pytest.approx(values[name], rel=limit)
    load = of_three_phases('sliding_mode', machine, record, [1.0] * 6)[1][LOAD]
    assert abs(load.value) < 3 * load.sigma
    assert load.sigma < 0.03 * 1.5 * machine.k_e * np.ptp(record['current_q'])


def test_a_load_is_known_no_better_than_the_motor(loaded):
    good, poor = (observer(loaded, percent, 1400) for percent in (2.0, 40.0))
    assert poor[LOAD].sigma > 3 * good[LOAD].sigma
