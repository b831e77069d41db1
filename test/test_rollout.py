"""The integrator against independent ones, and the motors against the textbook."""

from dataclasses import replace
from itertools import pairwise

from numba import njit
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete, lfilter

from motor_sysid.errors import UserError
from motor_sysid.physics import workspace
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.effects import effect
from motor_sysid.physics.laws import cos, sin, smooth_sign
from motor_sysid.physics.linear_effects import along
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motors
from motor_sysid.physics.native import data_of
from motor_sysid.physics.rollout import Program
from motor_sysid.physics.simulate import simulate
from motor_sysid.physics.stepper import Stepper
from motor_sysid.physics.track import at_share, curve
from motor_sysid.physics.vector import get, put
from motor_sysid.physics.workspace import halves
from motor_sysid.signals.record import Record

MOTOR = {'R': 2.0, 'L': 6e-4, 'k_t': 0.05, 'J': 5e-5, 'b': 2e-5, 'omega_eps': 0.5}
DT = 1e-3


def random_steps(count: int = 1000, unit: str = 'V', name: str = 'voltage') -> Record:
    rng = np.random.default_rng(1)
    held = np.repeat(rng.uniform(-8, 8, count // 50 + 1), 50)[:count]
    return Record(DT * np.arange(count), {name: held}, {name: unit})


@pytest.mark.parametrize('inductance', [1e-5, 6e-4, 5e-2])
def test_the_linear_motor_is_exact_for_any_time_constant(inductance):
    record = random_steps()
    model = Model.base('brushed_dc', {**MOTOR, 'L': inductance})
    a = np.array([[-2 / inductance, -0.05 / inductance], [0.05 / 5e-5, -2e-5 / 5e-5]])
    step, gain, *_ = cont2discrete(
        (a, np.array([[1 / inductance], [0]]), np.eye(2), np.zeros((2, 1))), DT
    )
    state, expected = np.zeros(2), []
    for u in record['voltage']:
        expected.append(state)
        state = step @ state + gain[:, 0] * u
    run = simulate(model, record, ['current', 'speed'])
    np.testing.assert_allclose(run.outputs['current'], np.array(expected)[:, 0], atol=1e-11)
    np.testing.assert_allclose(run.outputs['speed'], np.array(expected)[:, 1], atol=1e-10)


def test_effects_agree_with_an_adaptive_integrator():
    record = random_steps(400)
    model = Model.base('brushed_dc', MOTOR)
    model = model.with_effect('coulomb_friction', {'tau_c': 5e-3})
    model = model.with_effect('cogging_torque', {'a_1': 3e-3, 'b_2': 1e-3, 'n': 7})
    model = model.with_effect('brush_voltage_drop', {'v_b': 0.3})

    def rhs(t: float, x: np.ndarray, u: float) -> list[float]:
        i, omega, theta = x
        torque = 0.05 * i - 2e-5 * omega - 5e-3 * smooth_sign(omega, 0.5)
        torque += 3e-3 * np.cos(7 * theta) + 1e-3 * np.sin(14 * theta)
        voltage = u - 2 * i - 0.05 * omega - 0.3 * smooth_sign(i, 0.01)
        return [voltage / 6e-4, torque / 5e-5, omega]

    x, expected = np.zeros(3), []
    for u in record['voltage']:
        expected.append(x)
        solved = solve_ivp(rhs, (0, DT), x, 'LSODA', args=(u,), rtol=1e-8, atol=1e-10)
        x = solved.y[:, -1]
    found = simulate(model, record, substeps=16)
    for j, name in enumerate(('current', 'speed', 'position')):
        truth = np.array(expected)[:, j]
        assert np.std(found.outputs[name] - truth) < 5e-4 * np.std(truth)


@pytest.mark.parametrize('size', [1, 3, 40])
def test_a_delay_reaches_back_to_what_came_before_a_part(size):
    """Parts that begin where the whole was give what the whole does, alone or side by side."""
    record = random_steps(400)
    model = Model.base('brushed_dc', MOTOR).with_effect('input_delay', {'delay': 3.4 * DT})
    model = model.with_effect('coulomb_friction', {'tau_c': 5e-3})
    program = Program.of(model, ('current', 'speed', 'position'))
    table = {name: np.full(size, value) for name, value in model.parameters.values().items()}
    drive = Drive.of(record, model.kind)
    whole = program.run(table, drive, np.zeros(3))
    edges = [0, 90, 210, 300, 400]
    parts = [drive.part(a, b) for a, b in pairwise(edges)]
    begun = [whole[a].T for a in edges[:-1]]
    found = program.run_chain(table, parts, begun)
    np.testing.assert_allclose(np.concatenate(found), whole, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(('volts', 'share'), [(2.0, 0.03), (4.0, 0.15), (8.0, 0.13)])
def test_waves_shorter_than_a_step_average_out(volts, share):
    """At 43 waves per turn a sample covers 0.25, 0.5 and 1 waves."""
    held = np.repeat([volts, 0.9 * volts, 1.1 * volts], 200)
    record = Record(DT * np.arange(held.size), {'voltage': held}, {'voltage': 'V'})
    smooth = Model.base('brushed_dc', MOTOR)
    model = smooth.with_effect('cogging_torque', {'a_1': 1e-2, 'n': 43})
    fine, coarse = (simulate(model, record, ['speed'], substeps=k) for k in (64, 1))
    plain = simulate(smooth, record, ['speed'], substeps=64).outputs['speed']
    effect = np.std(fine.outputs['speed'] - plain) + 1e-2 * DT / 5e-5  # one step of the torque
    assert np.std(coarse.outputs['speed'] - fine.outputs['speed']) < share * effect


def test_steps_are_short_where_the_current_follows_the_input(monkeypatch):
    """The current follows within a fiftieth of a sample, and the supply sags with it."""
    monkeypatch.setattr(workspace, 'FINEST', 1)
    held = random_steps(300)
    record = Record(5 * held.time, {'voltage': held['voltage']}, held.units)
    model = Model.base('brushed_dc', {**MOTOR, 'L': 2e-4}).with_effect('supply_sag', {'a': 0.02})

    def speed(steps: int) -> np.ndarray:
        return simulate(model, record, ['speed'], substeps=steps).outputs['speed']

    coarse, fine, truth = speed(8), speed(16), speed(512)
    assert np.std(coarse - truth) < 1.5e-4 * np.std(truth)
    assert np.std(fine - truth) < 0.35 * np.std(coarse - truth)


def test_a_sample_in_which_friction_turns_is_taken_in_finer_steps(monkeypatch):
    """The moment of a reversal lies anywhere in a sample of a fourth of the time constant."""
    held = random_steps(300)
    record = Record(10 * held.time, {'voltage': held['voltage']}, held.units)
    model = Model.base('brushed_dc', MOTOR).with_effect('coulomb_friction', {'tau_c': 0.01})

    def speed(steps: int) -> np.ndarray:
        return simulate(model, record, ['speed'], substeps=steps).outputs['speed']

    truth, found = speed(512), speed(1)
    monkeypatch.setattr(workspace, 'FINEST', 1)
    plain = speed(1)
    assert np.std(plain - truth) > 1e-3 * np.std(truth), 'friction should matter'
    assert np.std(found - truth) < 0.2 * np.std(plain - truth)


@njit
def followed(position, places, sample, share):
    """Return the position at the `share` (8,) of the time to the next sample, in each lane."""
    angle = np.empty(8)
    way = curve(position, places, 0, sample)
    put(data_of(angle), 0, at_share(get(data_of(share), 0), way))
    return angle


def test_a_followed_position_is_smooth_between_its_samples():
    """A constant acceleration is followed exactly, but at the ends of what may be seen."""
    time = np.arange(8.0)
    position, share = 2 * time - 3 * time**2, np.linspace(0.0, 1.0, 8)
    together, alone = np.empty((3, 0), np.int64), np.repeat([[2], [0], [8]], 8, axis=1)
    for sample in range(1, 6):
        angle, passed = followed(position, together, sample, share), sample + share
        np.testing.assert_allclose(angle, 2 * passed - 3 * passed**2, atol=1e-12)
        np.testing.assert_array_equal(followed(position, alone, sample - 2, share), angle)
    for sample, end in ((0, 1), (6, 7), (7, 7)):
        angle = followed(position, together, sample, share)
        np.testing.assert_allclose(angle[[0, -1]], position[[sample, end]])
    # a lane of rows 2 to 5: its last ones are ends, too
    cut = np.repeat([[2], [2], [6]], 8, axis=1)
    for sample, (begins, ends) in ((0, (2, 3)), (3, (5, 5)), (9, (5, 5)), (-1, (2, 3))):
        angle = followed(position, cut, sample, share)
        np.testing.assert_allclose(angle[[0, -1]], position[[begins, ends]])


LAGS_AND_SPRINGS = {
    'current_sensor_lag': ({'lag': 4e-3}, lambda i, w, z: [(i - z[0]) / 4e-3, 0.0]),
    'speed_sensor_lag': ({'lag': 3e-3}, lambda i, w, z: [(w - z[0]) / 3e-3, 0.0]),
    'flexible_shaft': (
        {'r': 0.6, 'w_a': 400.0, 'z': 0.05},
        lambda i, w, z: [w - z[1], 1.6e5 * z[0] + 40.0 * (w - z[1])],
    ),
}


@pytest.mark.parametrize('key', LAGS_AND_SPRINGS)
def test_linear_effects_are_exact_however_long_the_sample(key):
    record = random_steps(200)
    record = Record(5 * record.time, {'voltage': record['voltage']}, {'voltage': 'V'})
    values, rates = LAGS_AND_SPRINGS[key]

    def rhs(t: float, x: np.ndarray, u: float) -> list[float]:
        i, omega = x[:2]
        more = rates(i, omega, x[2:])
        twisted = 0.6 * more[1] if key == 'flexible_shaft' else 0.0
        turning = (0.05 * i - 2e-5 * omega) / 5e-5 - twisted
        return [(u - 2 * i - 0.05 * omega) / 6e-4, turning, *more]

    x, expected = np.zeros(4), []
    for u in record['voltage']:
        expected.append(x)
        x = solve_ivp(rhs, (0, 5e-3), x, 'DOP853', args=(u,), rtol=1e-9, atol=1e-11).y[:, -1]
    shown = np.array(expected)
    if key != 'flexible_shaft':
        shown[:, int(key == 'speed_sensor_lag')] = shown[:, 2]
    run = simulate(Model.base('brushed_dc', MOTOR).with_effect(key, values), record)
    for j, name in enumerate(('current', 'speed')):
        size = np.max(np.abs(shown[:, j]))
        np.testing.assert_allclose(run.outputs[name], shown[:, j], atol=1e-4 * size)


@pytest.mark.parametrize('damping', [0.05, 1.0])
@pytest.mark.parametrize('dt', [1e-3, 5e-3])
def test_own_states_of_a_linear_effect_along_a_given_motion(dt, damping):
    t = dt * np.arange(400)
    states = {'omega': 40 * np.sin(30 * t) + 10, 't': t}
    values = {'r': 0.6, 'w_a': 400.0, 'z': damping}
    model = Model.base('brushed_dc', MOTOR).with_effect('flexible_shaft', values)
    found = along(effect('flexible_shaft'), model.kind, model.parameters.values(), states, dt)

    def rhs(time: float, x: np.ndarray) -> list[float]:
        slip = np.interp(time, t, states['omega']) - x[1]
        return [slip, 1.6e5 * x[0] + 800.0 * damping * slip]

    exact = solve_ivp(rhs, (0, t[-1]), [0.0, states['omega'][0]], 'DOP853', t_eval=t, rtol=1e-9,
                      atol=1e-12, max_step=dt)  # fmt: skip
    for name, path in zip(('phi', 'omega_l'), exact.y, strict=True):
        np.testing.assert_allclose(found[name], path, atol=1e-4 * np.max(np.abs(path)))


def test_a_fractional_delay_shifts_the_answer():
    record = random_steps()
    model = Model.base('brushed_dc', MOTOR)
    plain = simulate(model, record, ['speed'], substeps=4).outputs['speed']
    late = model.with_effect('input_delay', {'delay': 3.6e-3})
    shifted = simulate(late, record, ['speed']).outputs['speed']
    fine = np.interp(record.time - 3.6e-3, record.time, plain)
    assert np.std(shifted - fine) < 2e-3 * np.std(plain)


def test_a_delay_of_whole_samples_is_a_shift_to_the_bit_of_rounding():
    record = random_steps()
    model = Model.base('brushed_dc', MOTOR)
    plain = simulate(model, record, ['current']).outputs['current']
    late = simulate(
        model.with_effect('input_delay', {'delay': 5e-3}), record, ['current']
    ).outputs['current']
    first = simulate(
        model, Record(record.time[:6], {'voltage': np.full(6, record['voltage'][0])},
                      {'voltage': 'V'}), ['current'],
    ).outputs['current']  # fmt: skip
    np.testing.assert_allclose(late[:6], first, atol=1e-9)
    assert np.corrcoef(late[200:], plain[195:-5])[0, 1] > 0.9999


@pytest.mark.parametrize(
    'effects',
    [
        (), ('coulomb_friction',), ('input_delay',), ('current_sensor_scale', 'speed_sensor_lag'),
        ('current_sensor_lag', 'speed_sensor_scale', 'speed_sensor_offset'),
    ],
)  # fmt: skip
def test_the_stepper_is_the_rollout_one_sample_at_a_time(effects):
    record = random_steps(300)
    model = Model.base('brushed_dc', {**MOTOR, 'current_offset': 0.02})
    values = {
        'coulomb_friction': {'tau_c': 4e-3}, 'input_delay': {'delay': 2.3e-3},
        'current_sensor_scale': {'g': 0.2}, 'current_sensor_lag': {'lag': 4e-3},
        'speed_sensor_scale': {'g': 0.1}, 'speed_sensor_lag': {'lag': 8e-3},
        'speed_sensor_offset': {'o': 3.0},
    }  # fmt: skip
    for key in effects:
        model = model.with_effect(key, values[key])
    quiet = record.with_signal('voltage', np.r_[np.zeros(10), record['voltage'][10:]], 'V')
    run = simulate(model, quiet, ['current', 'speed'])
    plant, found = Stepper(model, DT), []
    for u in quiet['voltage']:
        found.append((plant.outputs['current'], plant.outputs['speed']))
        plant.step(float(u))
    np.testing.assert_allclose(np.array(found)[:, 0], run.outputs['current'], atol=1e-12)
    np.testing.assert_allclose(np.array(found)[:, 1], run.outputs['speed'], atol=1e-10)


@pytest.mark.parametrize(
    ('key', 'values'),
    [
        ('load_torque_step', {'tau_l': 0.02, 't_on': 0.4, 'rise': 2e-3}),
        ('periodic_load', {'a': 0.02, 'f': 1.3}),
    ],
)
def test_time_counts_from_the_first_sample(key, values):
    record = random_steps(800)
    model = Model.base('brushed_dc', MOTOR).with_effect(key, values)
    late = replace(record, time=record.time + 5.0)
    for name, run in simulate(model, record).outputs.items():
        np.testing.assert_allclose(simulate(model, late).outputs[name], run, atol=1e-9)


@pytest.mark.parametrize('sensor', list(SpeedSensor))
def test_laws_see_the_angle_that_the_speed_adds_up_to(sensor):
    """Half a sample of angle, either way round, would be 0.6 rad of these waves at full speed."""
    record = random_steps(3000)
    model = Model.base('brushed_dc', MOTOR, speed_sensor=sensor)
    model = model.with_effect('cogging_torque', {'b_1': 6e-3, 'n': 24.0})
    true = simulate(model, record, follow_position=False).outputs
    told = record.with_signal('speed', true['speed'], 'rad/s')
    seen = simulate(model, told).outputs['speed']
    without = simulate(model.without_effect('cogging_torque'), told).outputs['speed']
    moved = np.std(without - true['speed'])
    assert np.std(seen - true['speed']) < 0.02 * moved


def test_a_measured_position_is_no_prediction_of_itself():
    """Held within the counts of its encoder the angle would fit whatever the model is."""
    record = random_steps(2000, 'N m', 'torque')
    model = Model.base('mechanical_axis', {'J': 1.0, 'b': 2.0})
    count = 2 * np.pi / 4096
    shown = np.floor(simulate(model, record).outputs['position'] / count) * count
    told = record.with_signal('position', shown, 'rad')
    wrong = model.with_values({'b': 4.0})
    weightless = wrong.with_effect('gravity_load', {'tau_sin': 1e-9, 'tau_cos': 0.0})
    plain, led = (simulate(m, told, ['position']).outputs['position'] for m in (wrong, weightless))
    np.testing.assert_allclose(led, plain, atol=1e-6)


def test_a_differenced_speed_is_half_a_sample_late():
    record = random_steps()
    ideal = simulate(Model.base('brushed_dc', MOTOR), record)
    late = simulate(Model.base('brushed_dc', MOTOR, speed_sensor=SpeedSensor.DIFFERENCE), record)
    expected = np.diff(ideal.outputs['position']) / DT
    np.testing.assert_allclose(late.outputs['speed'][1:], expected, atol=1e-9)


def passed(speed, lag):
    """Return (N,) speed behind a low pass that takes sample by sample."""
    share = 1 - np.exp(-DT / (lag + 1e-7))
    zi = [(1 - share) * speed[0]]
    return lfilter([share], [1, share - 1], speed, zi=zi)[0]


@pytest.mark.parametrize('sensor', [SpeedSensor.DIFFERENCE, SpeedSensor.SAMPLED])
@pytest.mark.parametrize('beside', [(), ('coulomb_friction',)])
def test_a_drive_filters_the_speed_sample_by_sample(sensor, beside):
    record = random_steps()
    model = Model.base('brushed_dc', MOTOR, speed_sensor=sensor)
    for key in beside:
        model = model.with_effect(key, {'tau_c': 4e-3})
    lagging = model.with_effect('speed_sensor_lag', {'lag': 3 * DT})
    speed, late = (simulate(m, record, ['speed']).outputs['speed'] for m in (model, lagging))
    np.testing.assert_allclose(late, passed(speed, 3 * DT), atol=1e-9)
    smooth = simulate(replace(lagging, speed_sensor=SpeedSensor.IDEAL), record, ['speed'])
    assert np.max(np.abs(smooth.outputs['speed'] - late)) > 1e-4 * np.max(np.abs(late))
    none = simulate(lagging.with_values({'speed_sensor_lag.lag': 0.0}), record, ['speed'])
    np.testing.assert_allclose(none.outputs['speed'], speed, atol=1e-6)


def test_what_has_passed_a_filter_is_carried_over_stretches():
    """A filter that ran on between two stretches would take one sample twice."""
    model = Model.base('brushed_dc', MOTOR, speed_sensor=SpeedSensor.SAMPLED)
    model = model.with_effect('speed_sensor_lag', {'lag': 5 * DT})
    program = Program.of(model, ['current', 'speed'])
    drive = Drive(random_steps(400)['voltage'][:, np.newaxis], DT)
    values = {name: np.array([v]) for name, v in model.parameters.values().items()}
    whole = program.run(values, drive, np.zeros(3))[:, 1, 0]
    ideal = Program.of(model.without_effect('speed_sensor_lag'), ['current', 'speed', 'position'])
    plain = ideal.run(values, drive, np.zeros(3))[:, :, 0]
    half = Drive(drive.inputs[:200], DT), Drive(drive.inputs[200:], DT, start=200 * DT)
    first, second = program.run_chain(values, half, [np.zeros(3), plain[200]])
    found = np.concatenate((first, second))[:, 1, 0]
    np.testing.assert_allclose(found, whole, atol=1e-9)


def test_a_speed_that_no_filter_takes_is_the_ideal_one():
    model = Model.base('brushed_dc', MOTOR, speed_sensor=SpeedSensor.SAMPLED)
    model = model.with_effect('speed_sensor_lag', {'lag': DT})
    assert model.filters_speed
    plain = model.without_effect('speed_sensor_lag')
    assert plain.speed_sensor is SpeedSensor.IDEAL
    assert not plain.filters_speed
    assert plain.with_speed_sensor(SpeedSensor.SAMPLED) == plain
    assert plain.with_speed_sensor(SpeedSensor.DIFFERENCE).speed_sensor is SpeedSensor.DIFFERENCE
    counted = replace(model, speed_sensor=SpeedSensor.DIFFERENCE)
    kept = counted.without_effect('speed_sensor_lag').speed_sensor
    assert kept is SpeedSensor.DIFFERENCE
    other = model.with_effect('coulomb_friction', {'tau_c': 1e-3})
    assert other.without_effect('coulomb_friction').speed_sensor is SpeedSensor.SAMPLED


def test_the_reduced_motor_is_the_motor_without_inductance():
    record = random_steps()
    full = Model.base('brushed_dc', {**MOTOR, 'L': 1e-7})
    reduced = Model.base(
        'brushed_dc_reduced',
        {'k_v': 0.05 + 2.0 * 2e-5 / 0.05, 'k_a': 2.0 * 5e-5 / 0.05, 'omega_eps': 0.5},
    )
    a, b = (simulate(m, record, ['speed']).outputs['speed'] for m in (full, reduced))
    assert np.max(np.abs(a - b)) < 5e-3 * np.max(np.abs(a))


def test_steady_state_follows_the_textbook():
    """At rest of all transients omega = k_t V / (b R + k_t k_e), i = b omega / k_t."""
    count = 4000
    record = Record(DT * np.arange(count), {'voltage': np.full(count, 6.0)}, {'voltage': 'V'})
    run = simulate(Model.base('brushed_dc', MOTOR), record)
    omega = 0.05 * 6 / (2e-5 * 2 + 0.05**2)
    assert run.outputs['speed'][-1] == pytest.approx(omega, rel=1e-9)
    assert run.outputs['current'][-1] == pytest.approx(2e-5 * omega / 0.05, rel=1e-9)


def test_energy_is_conserved_without_losses():
    """Electrical work equals kinetic energy, magnetic energy and copper loss."""
    record = random_steps(500)
    model = Model.base('brushed_dc', {**MOTOR, 'b': 1e-12})
    fine = simulate(model, record)
    i, omega = fine.outputs['current'], fine.outputs['speed']
    stored = 0.5 * 5e-5 * omega[-1] ** 2 + 0.5 * 6e-4 * i[-1] ** 2
    dense = Record(
        1e-5 * np.arange(50000), {'voltage': np.repeat(record['voltage'], 100)}, {'voltage': 'V'}
    )
    run = simulate(model, dense, ['current']).outputs['current']
    mid = 0.5 * (run[1:] + run[:-1])[:49900]
    work = np.sum(mid * dense['voltage'][:49900]) * 1e-5
    lost = np.sum(2.0 * mid**2) * 1e-5
    assert work - lost == pytest.approx(stored, rel=2e-3)


def test_a_motor_that_cannot_be_is_nan_not_a_crash():
    record = random_steps(100)
    from motor_sysid.physics.motors import motor

    program = Program(motor('brushed_dc'), [], ['speed'])
    values = {p.name: np.full(3, p.value) for p in motor('brushed_dc').parameters}
    values['L'] = np.array([1e-3, np.nan, 1e-300])
    run = program.run(values, Drive.of(record, motor('brushed_dc')), np.zeros(3))
    assert np.all(np.isfinite(run[:, :, 0]))
    assert not np.any(np.isfinite(run[5:, :, 1:]))


@pytest.mark.parametrize('effects', [(), ('coulomb_friction',), ('lugre_friction',)])
@pytest.mark.parametrize('restarts', [(), (2,)])
def test_stretches_that_run_side_by_side_come_to_the_same(effects, restarts):
    record = random_steps(6000)
    model = Model.base('brushed_dc')
    for key in effects:
        model = model.with_effect(key)
    program = Program.of(model, ('speed', 'current'))
    whole = Drive.of(record, model.kind)
    edges = [0, 1000, 2500, 6000]
    drives = [
        Drive(whole.inputs[a:b], DT, a * DT, np.empty(0)) for a, b in pairwise(edges)
    ]
    values = {name: np.full(2, value) for name, value in model.parameters.values().items()}
    start = [np.zeros(3)] * 3
    alone = program.run_chain(values, drives, start, restarts=restarts)
    both = program.run_chain(values, drives, start, restarts=restarts, threads=2)
    assert all(np.array_equal(a, b) for a, b in zip(alone, both, strict=True))
    free = not program.memory_offsets or restarts
    lengths = [len(d.inputs) for d in drives]
    cut = halves(lengths, restarts if program.memory_offsets else range(3))
    assert len(cut) == (2 if free else 1)


def test_steps_follow_teeth_that_swing_faster_than_the_samples():
    """A gear of 200 rad/s, sampled every 10 ms; beside steps eight times as many again."""
    record = Record(
        0.01 * np.arange(300), {'voltage': np.repeat([8.0, -8.0, 4.0], 100)}, {'voltage': 'V'}
    )
    gear = {'r': 3.0, 'phi_g': 0.05, 'w_a': 200.0, 'z': 0.05}
    model = Model.base('brushed_dc', MOTOR).with_effect('backlash', gear)
    program = Program.of(model, ('speed',))
    values = model.parameters.values()
    column = np.array([values[name] for name in program.names])
    assert program.pace.steps(column, 0.0, 0.01) == 8  # 200 sqrt(1 + 3) 0.01 = 4 rad by halves
    assert program.pace.steps(column, 0.0, 1e-4) == 1
    # Parts of a sample are steps as well: the longest of four has 7/16 of it, of sixteen 31/256.
    assert [program.pace.steps(column, 0.0, 0.01, parts) for parts in (4, 16)] == [4, 1]
    assert program.pace.steps(column, 0.0, 1.0) == 16  # no sample shows what swings that fast
    runs = (simulate(model, record, ['speed'], substeps=n) for n in (1, 8))
    coarse, fine = (run.outputs['speed'] for run in runs)
    assert np.all(np.isfinite(coarse))
    assert np.std(coarse - fine) < 0.05 * np.std(fine)
    # In a swarm the stiffest teeth set the pace, wherever they stand; one that is none sets none.
    table = {name: np.full(3, value) for name, value in values.items()}
    table['backlash.w_a'] = np.array([20.0, 200.0, np.nan])
    drive = Drive.of(record, model.kind)
    swarm = program.run(table, drive, np.zeros(3))[:, 0, 1]
    stiff = {name: value[1:2] for name, value in table.items()}
    np.testing.assert_array_equal(swarm, program.run(stiff, drive, np.zeros(3))[:, 0, 0])


def test_a_motor_without_current_coasts_where_its_bridge_lets_go():
    """Between pulses only the share that is still shorted brakes."""
    reduced = Model.base('brushed_dc_reduced', {'k_v': 0.05, 'k_a': 5e-3})
    model = reduced.with_effect('drive_coast', {'a': 0.8, 'u_c': 1.0})
    volts = np.where(np.arange(400) < 200, 5.0, 0.0)
    record = Record(DT * np.arange(400), {'voltage': volts}, {'voltage': 'V'})
    speed = simulate(model, record, ['speed']).outputs['speed']
    free = simulate(reduced, record, ['speed']).outputs['speed']
    assert speed[:200] == pytest.approx(free[:200], rel=1e-9)
    tau = 5e-3 / 0.05
    after = DT * np.arange(200)
    assert speed[200:] == pytest.approx(speed[200] * np.exp(-0.2 * after / tau), rel=1e-4)
    assert free[200:] == pytest.approx(free[200] * np.exp(-after / tau), rel=1e-6)


def test_missing_inputs_are_named():
    record = random_steps(50, name='current', unit='A')
    with pytest.raises(UserError, match='needs voltage as input'):
        simulate(Model.base('brushed_dc'), record)


@pytest.mark.parametrize('key', sorted(motors()))
def test_every_motor_kind_describes_itself(key):
    kind = motors()[key]
    assert kind.key == key
    assert kind.title
    values = {p.name: np.array([p.value]) for p in kind.parameters}
    a, b, g = kind.matrices(values)
    n = len(kind.states)
    assert a.shape == (1, n, n)
    assert b.shape == (1, n, len(kind.arguments))
    assert g.shape == (1, n, len(kind.forces))
    assert {o.state for o in kind.outputs} <= set(kind.states)


def test_fast_sine_is_exact_enough_and_takes_arrays():
    x = np.linspace(-3e4, 3e4, 200001)
    assert np.max(np.abs(sin(x) - np.sin(x))) < 2e-11
    assert np.max(np.abs(cos(x) - np.cos(x))) < 2e-11
    assert sin(1.0) == pytest.approx(np.sin(1.0), abs=1e-13)
    assert smooth_sign(np.array([-9.0, 0.0, 9.0]), 0.1).tolist() == [-1.0, 0.0, 1.0]


def test_a_law_that_reads_a_rate_that_fades_within_a_sample_gets_its_parts():
    """The current settles in a third of a sample; beside 64 parts, which are told of."""
    motor = {**MOTOR, 'R': 0.2, 'L': 5e-5}
    rng = np.random.default_rng(5)
    record = Record(
        1e-3 * np.arange(400), {'voltage': rng.uniform(-6.0, 6.0, 400)}, {'voltage': 'V'}
    )
    plain = Model.base('brushed_dc', motor)
    iron = plain.with_effect('inductance_saturation', {'s': 0.5, 'i_s': 5.0})
    heavy = plain.with_effect('inertia_change', {'g': 0.5, 't_on': 0.1})
    programs = [Program.of(model, ('current',)) for model in (plain, iron, heavy)]
    columns = [
        np.array([[model.parameters[name].value] for name in program.names])
        for program, model in zip(programs, (plain, iron, heavy), strict=True)
    ]
    asked = [p.pace.parts(c, 1e-3) for p, c in zip(programs, columns, strict=True)]
    assert asked == [1, 4, 1]  # R dt / L = 4; the inertia's own rate is that of friction
    assert programs[1].pace.parts(columns[1], 1e-2) == 8  # 40, which no step follows
    without = simulate(plain, record, ['current']).outputs['current']
    coarse, fine = (
        simulate(iron, record, ['current'], substeps=n).outputs['current'] - without
        for n in (1, 64)
    )
    assert np.linalg.norm(coarse - fine) < 0.4 * np.linalg.norm(fine)  # 12 times, in one step
