"""A drive that tells its q axis alone, and motion that tells the current that it takes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim
from three_phase_records import pmsm_record

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.errors import UserError
from motor_sysid.estimation.online.identifier import OnlineIdentifier
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.stepper import Stepper
from motor_sysid.signals.motion import with_motion
from motor_sysid.signals.record import Record

TRUE = {'J': 2e-4, 'b': 3e-4, 'tau_c': 0.06, 'offset': -0.02}
WAVES = {72: (0.18, 0.3), 144: (0.02, 1.0), 18: (0.05, -0.7), 12: (0.03, 2.0)}
"""Waves per turn: amplitude in A and phase in rad."""


def q_axis(record: Record) -> Record:
    return record.select(['voltage_q', 'current_q', 'speed', 'position'])


@pytest.fixture(scope='module')
def drive():
    machine, record = pmsm_record(4.0, push_d=0.0)
    return machine, record


def test_the_q_axis_alone_gives_the_motor(drive):
    """k_t is 1.5 pole_pairs psi_f, though no pole pairs are told."""
    machine, record = drive
    found = fit_model([q_axis(record)], motor='pmsm').model
    assert found.motor == 'pmsm_q'
    truth = {'R': machine.R, 'k_t': 1.5 * machine.k_e, 'J': machine.J}
    for name, value in truth.items():
        assert found[name] == pytest.approx(value, rel=0.02), name
    assert found['b'] == pytest.approx(machine.b, rel=0.1)


@pytest.mark.parametrize('estimator', ['rls', 'ekf'])
def test_the_q_axis_is_followed_live(drive, estimator):
    machine, record = drive
    truth = {'R': machine.R, 'k_t': 1.5 * machine.k_e, 'J': machine.J}
    wrong = {name: 1.5 * value for name, value in truth.items()}
    model = Model.base('pmsm_q', wrong, speed_sensor=SpeedSensor.DIFFERENCE)
    inputs, outputs = ['voltage_q'], ['current_q', 'speed']
    online = OnlineIdentifier(model, estimator, record.dt, inputs, outputs)
    u, y = (np.column_stack([record[n] for n in names]) for names in (inputs, outputs))
    online.update(record.time, u, y)
    for name, value in truth.items():
        assert online.estimate()[name].value == pytest.approx(value, rel=0.03), name


def test_the_filter_of_the_current_is_named():
    """A law for the sensor of the current is that of the q current where there is no other."""
    records = []
    for seed in (1, 2):
        record = q_axis(pmsm_record(3.0, push_d=0.0, seed=seed)[1])
        shown = lsim(([1.0], [2e-3, 1.0]), record['current_q'], record.time)[1]
        records.append(record.with_signal('current_q', shown, 'A'))
    keys = ['current_sensor_lag', 'speed_sensor_lag', 'coulomb_friction', 'input_delay']
    found = diagnose(records[:1], records[1:], motor='pmsm_q', effects=keys)
    assert found.effects == ('current_sensor_lag',)
    assert found.model['current_sensor_lag.lag'] == pytest.approx(2e-3, rel=0.05)


def test_a_known_motion_is_not_simulated():
    with pytest.raises(UserError, match='no motion of its own'):
        Stepper(Model.base('inverse_axis'), 1e-3)


def test_a_motor_without_brushes_has_no_drop_of_them():
    model = Model.base('pmsm_q')
    assert not model.admits(effect('brush_voltage_drop'))
    assert model.admits(effect('inverter_dead_time'))
    assert Model.base('brushed_dc').admits(effect('brush_voltage_drop'))


def moved(
    position: np.ndarray, dt: float, rng: np.random.Generator, *, cogs: bool = True
) -> Record:
    """Return what an axis of known motion draws: the balance of torques, sample by sample."""
    time = dt * np.arange(position.size)
    speed = np.gradient(position, dt)
    current = TRUE['J'] * np.gradient(speed, dt) + TRUE['b'] * speed + TRUE['offset']
    current += TRUE['tau_c'] * np.tanh(speed / 1e-3)
    for order, (size, phase) in WAVES.items() if cogs else ():
        current += size * np.sin(order * position + phase)
    signals = {
        'position': position + rng.normal(0.0, 1e-5, position.size),
        'current': current + rng.normal(0.0, 0.01, position.size),
    }
    return Record(time, signals, {'position': 'rad', 'current': 'A'})


def there_and_back(seconds: float, dt: float, turn: float) -> np.ndarray:
    time = np.arange(0.0, seconds, dt)
    return turn * 0.5 * (1 - np.cos(2 * np.pi * time / seconds))


@pytest.fixture(scope='module')
def mapped():
    rng = np.random.default_rng(3)
    train, valid = (
        moved(there_and_back(60.0, 1e-2, turns * 2 * np.pi), 1e-2, rng) for turns in (1.0, 1.3)
    )
    keys = ['coulomb_friction', 'quadratic_drag', 'gravity_load']
    keys += [one.key for one in effect('cogging_torque').repeated()]
    return diagnose([train], [valid], motor='inverse_axis', effects=keys)


def test_slow_motion_tells_every_set_of_cogging_waves(mapped):
    assert mapped.verdict is Verdict.EFFECT_MISSING
    assert set(mapped.effects) == {
        'coulomb_friction', 'cogging_torque', 'cogging_torque_2', 'cogging_torque_3'
    }
    found = {}
    for key in ('cogging_torque', 'cogging_torque_2', 'cogging_torque_3'):
        n = mapped.model[f'{key}.n']
        for h in (1, 2):
            wave = np.hypot(mapped.model[f'{key}.a_{h}'], mapped.model[f'{key}.b_{h}'])
            found[round(h * n)] = wave
    for order, (size, _) in WAVES.items():
        assert found[order] == pytest.approx(size, rel=0.05), order


def test_the_error_falls_to_the_noise(mapped):
    first, last = mapped.steps[0], mapped.steps[-1]
    assert last.validation_error_percent < first.validation_error_percent / 8
    assert last.validation_error_percent < 1.1 * mapped.noise_floor_percent


def test_fast_motion_tells_inertia_and_friction():
    rng = np.random.default_rng(4)
    position = 4.0 * np.sin(2 * np.pi * 2.0 * np.arange(0.0, 6.0, 1e-3))
    record = moved(position, 1e-3, rng, cogs=False)
    found = fit_model([record], motor='inverse_axis', effects=('coulomb_friction',)).model
    for name in ('J', 'b'):
        assert found[name] == pytest.approx(TRUE[name], rel=0.03), name
    assert found['coulomb_friction.tau_c'] == pytest.approx(TRUE['tau_c'], rel=0.03)


def test_another_set_of_waves_waits_for_the_first():
    model = Model.base('brushed_dc')
    second = effect('cogging_torque_2')
    assert model.admits(second)
    assert not model.lacks(second)
    assert model.with_effect('cogging_torque').lacks(second)


def test_a_repeated_effect_is_the_same_law_under_another_key():
    first, second, third = effect('cogging_torque').repeated()
    assert (second.key, third.key) == ('cogging_torque_2', 'cogging_torque_3')
    assert second.card == replace(first.card, title=second.card.title)
    assert second.laws == first.laws


def at(position: np.ndarray, dt: float) -> Record:
    return Record(dt * np.arange(position.size), {'position': position}, {'position': 'rad'})


def test_speed_and_acceleration_come_from_the_position():
    time = 1e-3 * np.arange(4000)
    (found,) = with_motion([at(0.5 * np.sin(12.0 * time), 1e-3)])
    assert len(found) == 4000
    inner = slice(20, -20)
    for name, values in (
        ('speed', 6.0 * np.cos(12.0 * time)), ('acceleration', -72.0 * np.sin(12.0 * time))
    ):  # fmt: skip
        assert np.max(np.abs(found[name] - values)[inner]) < 1e-3 * np.max(values)
    assert found.units['acceleration'] == 'rad/s^2'


def test_motion_from_stop_to_stop_is_read_over_the_time_that_tells_its_direction():
    """Steps of 2 mrad in 0.25 s, with counts of 0.3 mrad, there and back."""
    rng, dt = np.random.default_rng(1), 0.01
    ramp = np.concatenate([np.arange(0.0, 120.0, dt), np.arange(120.0, 0.0, -dt)])
    stops = 2e-3 * np.floor(ramp / 0.25)
    position = 3e-4 * np.round((stops + rng.normal(0.0, 3e-4, stops.size)) / 3e-4)
    records = with_motion([at(position, dt)])
    direction = np.sign(records[0]['speed'])
    assert 2 * dt < records[0].dt < 1.0
    away = np.abs(records[0].time - 120.0) > 1.0
    assert np.all(direction[away] == np.where(records[0].time < 120.0, 1.0, -1.0)[away])
