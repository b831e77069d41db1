"""The angle of the shaft where nothing but a speed is measured, by a sensor that is off."""

import numpy as np
import pytest

from motor_sysid.physics.drive import Drive
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motors
from motor_sysid.physics.rollout import Program
from motor_sysid.physics.simulate import simulate
from motor_sysid.physics.summed import seen_by
from motor_sysid.signals.record import Record

DT, SAMPLES = 1e-3, 4000
MOTOR = {'R': 2.0, 'L': 6e-4, 'k_t': 0.05, 'J': 5e-5, 'b': 2e-5}
OFF = [
    ('speed_sensor_offset', {'o': 9.0}, SpeedSensor.IDEAL),
    ('speed_sensor_scale', {'g': 0.05}, SpeedSensor.IDEAL),
    ('speed_sensor_lag', {'lag': 6e-3}, SpeedSensor.IDEAL),
    ('speed_sensor_lag', {'lag': 6e-3}, SpeedSensor.SAMPLED),
    ('speed_sensor_lag', {'lag': 6e-3}, SpeedSensor.DIFFERENCE),
]


def waving() -> Model:
    """Return a motor with seven waves of cogging a turn."""
    model = Model.base('brushed_dc', MOTOR)
    return model.with_effect('cogging_torque', {'a_1': 6e-3, 'b_1': 2e-3, 'n': 7})


def record() -> Record:
    """Return a slow voltage that turns back now and then."""
    time = DT * np.arange(SAMPLES)
    volts = 2.5 * np.sin(2 * np.pi * 0.4 * time) + 1.2 * np.sign(np.sin(2 * np.pi * 1.1 * time))
    return Record(time, {'voltage': volts}, {'voltage': 'V'})


def shown(model: Model) -> tuple[Record, np.ndarray]:
    """Return a record with the speed that the sensor shows, and the angle of the shaft."""
    alone = record()
    run = simulate(model, alone, ['current', 'speed', 'position'])
    signals = {'voltage': alone['voltage'], 'speed': run.outputs['speed']}
    return Record(alone.time, signals, {'voltage': 'V', 'speed': 'rad/s'}), run.outputs['position']


@pytest.mark.parametrize(('key', 'values', 'sensor'), OFF)
def test_the_sum_of_a_speed_is_the_angle_without_what_its_sensor_adds(key, values, sensor):
    model = waving().with_effect(key, values).with_speed_sensor(sensor)
    told, angle = shown(model)
    drive = Drive.of(told, model.kind)
    straight = seen_by(model, drive).position - angle
    crooked = drive.told_by(sensor).position - angle
    assert np.ptp(straight[5:-5]) < 0.03
    assert np.ptp(crooked[5:-5]) > 10 * np.ptp(straight[5:-5])


@pytest.mark.parametrize(('key', 'values', 'sensor'), OFF)
def test_waves_go_with_the_shaft_however_far_off_the_sensor_is(key, values, sensor):
    model = waving().with_effect(key, values).with_speed_sensor(sensor)
    told, _ = shown(model)
    program = Program.of(model, ['speed'])
    table = {name: np.array([value]) for name, value in model.parameters.values().items()}
    start = np.zeros(len(model.kind.states))
    drive = Drive.of(told, model.kind)
    followed = program.run(table, drive, start)[:, 0, 0]
    straight = program.run(table, seen_by(model, drive), start)[:, 0, 0]
    crooked = program.run(table, drive.told_by(sensor), start)[:, 0, 0]
    size = np.std(told['speed'])
    assert np.std(followed - told['speed']) < 0.03 * size
    assert np.std(followed - straight) < 2e-3 * size
    assert np.std(crooked - told['speed']) > 5 * np.std(followed - told['speed'])


def test_a_sensor_without_error_leaves_the_sum_as_it_is():
    model = waving()
    told, _ = shown(model)
    plain = simulate(model, told).outputs['speed']
    for key, name in (('speed_sensor_offset', 'o'), ('speed_sensor_scale', 'g')):
        np.testing.assert_array_equal(
            simulate(model.with_effect(key, {name: 0.0}), told).outputs['speed'], plain
        )
    for sensor in (SpeedSensor.SAMPLED, SpeedSensor.DIFFERENCE):
        other = model.with_effect('speed_sensor_lag', {'lag': 0.0}).with_speed_sensor(sensor)
        drive = Drive.of(told, model.kind)
        position = seen_by(other, drive).position
        np.testing.assert_allclose(position, drive.told_by(sensor).position, atol=1e-12)


def test_a_measured_position_is_taken_as_it_is():
    model = waving().with_effect('speed_sensor_offset', {'o': 9.0})
    told, angle = shown(model)
    signals, units = {**told.signals, 'position': angle}, {**told.units, 'position': 'rad'}
    both = Record(told.time, signals, units)
    drive = Drive.of(both, motors()['brushed_dc'])
    np.testing.assert_array_equal(seen_by(model, drive).position, angle)
    found = simulate(model, both).outputs['speed']
    assert np.std(found - told['speed']) < 0.01 * np.std(told['speed'])
