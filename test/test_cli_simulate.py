"""`motor-sysid simulate`: what it writes reads back, and holds the motor that was asked for."""

import numpy as np
import pytest

from motor_sysid.cli import main
from motor_sysid.diagnosis.search.motor_kind import told_kind
from motor_sysid.estimation.batch import refit
from motor_sysid.physics.model import Model
from motor_sysid.physics.store import load_model
from motor_sysid.recording import load
from motor_sysid.recording.save import write_record
from motor_sysid.signals import Record
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.phases import hall_sector

SHORT = ['--duration', '3', '--profile', 'reversals']
MOTOR = ['--set', 'R=1.2', 'L=1.5e-3', 'k_t=0.055', 'J=8e-5', 'b=3e-5']


def one(path):
    (record,) = load(path).records
    return record


@pytest.mark.parametrize('name', ['run.csv', 'run.csv.gz', 'bag'])
def test_writes_what_loads(tmp_path, capsys, name):
    out = tmp_path / name
    assert main(['simulate', *MOTOR, *SHORT, '-o', str(out)]) == 0
    record = one(out)
    assert {'voltage', 'current', 'speed', 'position', 'speed_reference'} <= set(record)
    assert len(record) == 3000
    assert record.dt == pytest.approx(1e-3)
    assert '3000 samples' in capsys.readouterr().out


def test_the_motor_is_in_the_data(tmp_path):
    out, kept = tmp_path / 'run.csv', tmp_path / 'motor.yaml'
    arguments = ['--effect', 'coulomb_friction', '--save-model', str(kept), '-o', str(out)]
    friction = 'coulomb_friction.tau_c=0.02'
    assert main(['simulate', *MOTOR, friction, *SHORT, *arguments]) == 0
    model = load_model(kept)
    assert model['coulomb_friction.tau_c'] == 0.02
    start = Model.base('brushed_dc', {'R': 2.0, 'k_t': 0.08}).with_effect('coulomb_friction')
    start = start.with_values({'omega_eps': model['omega_eps']})
    found = refit(start, one(out), 'least_squares').model
    for name in ('R', 'k_t', 'J', 'coulomb_friction.tau_c'):
        assert found[name] == pytest.approx(model[name], rel=0.03)


def test_a_model_follows_a_recorded_input(tmp_path):
    first, kept, second = tmp_path / 'a.csv', tmp_path / 'm.yaml', tmp_path / 'b.csv'
    ideal = [*MOTOR, *SHORT, '--ideal', '--save-model', str(kept)]
    assert main(['simulate', *ideal, '-o', str(first)]) == 0
    follow = ['--input', str(first), '--ideal']
    assert main(['simulate', str(kept), *follow, '-o', str(second)]) == 0
    assert np.allclose(one(first)['current'], one(second)['current'], atol=1e-9)


def test_linear_axis_in_open_loop(tmp_path):
    out = tmp_path / 'axis.csv'
    axis = ['--motor', 'mechanical_axis', '--linear', '--set', 'J=95', 'b=200']
    assert main(['simulate', *axis, '--open-loop', '50', *SHORT, '-o', str(out)]) == 0
    record = one(out)
    assert record.units['speed'] == 'm/s'
    assert record.units['force'] == 'N'
    assert np.max(np.abs(record['force'])) == pytest.approx(25.0)


@pytest.mark.parametrize('motor', ['pmsm', 'bldc'])
def test_three_phase_motors_come_with_their_drive(tmp_path, motor):
    pmsm, bldc = ['L_d=4e-3', 'L_q=5e-3', 'psi_f=8.3e-3'], ['L=5e-3', 'k_e=25e-3']
    magnet = pmsm if motor == 'pmsm' else bldc
    values = ['R=2', *magnet, 'J=5e-5', 'b=2e-5', 'pole_pairs=4']
    out = tmp_path / 'run.csv'
    motion = ['--duration', '2', '--profile', 'reversals', '--top-speed', '40', '--rate', '500']
    assert main(['simulate', '--motor', motor, '--set', *values, *motion, '-o', str(out)]) == 0
    record = one(out)
    axes = 'dq' if motor == 'pmsm' else 'abc'
    assert {f'{kind}_{axis}' for kind in ('voltage', 'current') for axis in axes} <= set(record)
    error = record['speed'] - record['speed_reference']
    assert np.std(error) < 0.5 * np.std(record['speed_reference'])
    assert np.max(np.abs(record['current_command'])) <= 0.4 * 24 / 2 + 1e-9


@pytest.mark.parametrize(
    ('motor', 'values', 'signal'),
    [
        ('pmsm_q', ['R=1'], 'current_q'),
        ('pmsm', ['L_d=4e-3', 'L_q=5e-3', 'psi_f=8.3e-3', 'pole_pairs=4'], 'current_d'),
        ('bldc', ['L=5e-3', 'k_e=25e-3', 'pole_pairs=4'], 'current_b'),
    ],
)
def test_sensors_show_every_current(tmp_path, motor, values, signal):
    drive, ideal, real = (tmp_path / f'{name}.csv' for name in ('drive', 'ideal', 'real'))
    time = np.arange(500) / 1000
    model = Model.base(motor, {})
    inputs = {name: 2 * np.sin(9 * time + k) for k, name in enumerate(model.kind.inputs[0])}
    signals = {**inputs, 'speed': np.sin(time)}
    units = {name: BY_NAME[name].units[0] for name in signals}
    write_record(Record(time, signals, units), drive)
    follow = ['--motor', motor, '--set', *values, '--input', str(drive)]
    assert main(['simulate', *follow, '--ideal', '-o', str(ideal)]) == 0
    assert main(['simulate', *follow, '--current-noise', '0.1', '-o', str(real)]) == 0
    records = one(ideal), one(real)
    assert set(records[0]) == set(records[1])
    assert np.std(records[1][signal] - records[0][signal]) == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize('motor', ['pmsm_q', 'bldc'])
def test_a_bag_of_three_phases_is_one_that_can_be_used(tmp_path, capsys, motor):
    """It holds what the model has, and no zeros of axes that it lacks."""
    bag, first = tmp_path / 'bag', tmp_path / 'first.csv'
    drive = ['--open-loop', '3', *SHORT]
    if motor == 'bldc':
        assert main(['simulate', '--motor', 'bldc', *SHORT, '-o', str(first)]) == 0
        drive = ['--input', str(first)]
    assert main(['simulate', '--motor', motor, *drive, '--ideal', '-o', str(bag)]) == 0
    written = capsys.readouterr().out
    record = one(bag)
    assert all(f'{name} [' in written for name in record)
    assert ('current_d' in record, 'current_c' in record) == (False, False)
    assert main(['check', str(bag)]) == 0


@pytest.mark.parametrize('name', ['run.csv', 'bag'])
def test_a_six_step_motor_shows_its_hall_sectors(tmp_path, name):
    """By them its own record is taken for what it is; an offset of the angle moves them."""
    out, again = tmp_path / name, tmp_path / 'again.csv'
    values = ['R=0.8', 'L=1.2e-3', 'k_t=0.045', 'J=4e-5', 'pole_pairs=4', 'angle_offset=0.3']
    six = ['simulate', '--motor', 'bldc_six_step', '--set', *values, '--ideal']
    assert main([*six, '--open-loop', '4', *SHORT, '-o', str(out)]) == 0
    assert main([*six, '--input', str(out), '-o', str(again)]) == 0
    for record in (one(out), one(again)):
        sectors = hall_sector(4 * record['position'] + 0.3)
        assert np.array_equal(record['hall_sector'], sectors)
        assert set(sectors) == set(range(1, 7))
        assert told_kind([record], None) == 'bldc_six_step'


def test_an_input_is_followed_at_its_own_rate_and_read_as_a_msg_config_says(tmp_path):
    data, config, out = tmp_path / 'a.csv', tmp_path / 'a.yaml', tmp_path / 'out.csv'
    rows = [f'{k / 500},{k // 100 % 2},{np.sin(k / 30)}' for k in range(400)]
    data.write_text('\n'.join(['t,u,v', *rows]))
    config.write_text('time: t\nsignals: {voltage: {column: u, scale: 3}, speed: {column: v}}\n')
    follow = ['--input', str(data), '--msg-config', str(config), '--ideal', '-o', str(out)]
    assert main(['simulate', *follow]) == 0
    assert set(one(out)['voltage']) == {0.0, 3.0}
    assert one(out).dt == pytest.approx(0.002)


def test_an_input_in_several_stretches_is_refused(tmp_path, capsys):
    data, out = tmp_path / 'gap.csv', tmp_path / 'out.csv'
    rows = [f'{k / 500 + 5 * (k > 200)},{k // 100 % 2},{np.sin(k / 30)}' for k in range(400)]
    data.write_text('\n'.join(['time [s],voltage [V],speed [rad/s]', *rows]))
    assert main(['simulate', '--input', str(data), '-o', str(out)]) == 2
    assert 'consists of 2 stretches (the longest begins at 0 s' in capsys.readouterr().err
    assert not out.exists()


def test_same_seed_same_file(tmp_path):
    for name, seed in (('a', '1'), ('b', '1'), ('c', '2')):
        out = str(tmp_path / f'{name}.csv')
        assert main(['simulate', *SHORT, '--seed', seed, '-o', out]) == 0
    a, b, c = ((tmp_path / f'{name}.csv').read_bytes() for name in 'abc')
    assert a == b
    assert a != c


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['--motor', 'steam'], 'unknown motor'),
        (['--effect', 'magic'], 'unknown effect'),
        (['--set', 'R=-1'], 'outside its range'),
        (['--set', 'R'], 'not `effect.parameter=number`'),
        (['--profile', 'loop'], 'no profile `loop`'),
        (['--duration', '0'], '--duration 0 is no number above 0'),
        (['--rate', 'nan'], '--rate nan is no number above 0'),
        (['--seed', '-1'], '--seed -1 is no whole number from 0 on'),
        (['--seed', '0.5'], '--seed 0.5 is no whole number from 0 on'),
        (['--duration', '1e9'], '1e+09 s at 1000 Hz are more than 10,000,000 samples; give a'),
        (['--rate', '1e300'], '--rate 1e300 is no number above 0.0001 and below 1e+09'),
        (['--rate', '1e8'], '20 s at 1e+08 Hz are more than'),
        (['--set', 'coulomb_friction.tau_c=3'], 'give --effect coulomb_friction, too'),
        (['--set', 'coulomb_frction.tau_c=3'], 'unknown effect `coulomb_frction`'),
        (['--counts', '-4'], '--counts -4 is no whole number from 0 on'),
        (['--current-bits', '2000'], '--current-bits 2000 is no whole number from 0 to 32'),
        (['--current-noise', '-0.1'], '--current-noise -0.1 is no number from 0 on'),
        (['--input', 'a.csv', '--rate', '500'], '--rate does nothing beside --input'),
        (['--input', 'a.csv', '--profile', 'steps'], '--profile does nothing beside --input'),
        (['--input', 'a.csv', '--duration', '20'], '--duration does nothing beside --input'),
        (['--input', 'a.csv', '--open-loop', '0'], '--open-loop does nothing beside --input'),
        (['m.yaml', '--motor', 'pmsm'], '--motor does nothing beside a MODEL'),
        (['m.yaml', '--linear'], '--linear does nothing beside a MODEL'),
        (['--profile', 'next.yaml', '--duration', '3'], '--duration does nothing beside --prof'),
        (['--open-loop', '3', '--top-speed', '9'], '--top-speed does nothing beside --open-loop'),
        (['--msg-config', 'odrive'], '--msg-config says how to read the DATA of --input'),
        (['--motor', 'mechanical_axis'], 'give --open-loop'),
        (['--motor', 'inverse_axis'], 'without a controller; give --input DATA'),
        (['--motor', 'inverse_axis', '--open-loop', '1'], 'by one level; give --input DATA'),
        (['--motor', 'pmsm', '--open-loop', '1'], 'by one level; leave --open-loop out, or give'),
        (['missing.yaml'], 'cannot read'),
        (['--input', 'missing.csv'], 'missing.csv'),
    ],
)
def test_bad_questions(tmp_path, capsys, arguments, message):
    assert main(['simulate', *arguments, '-o', str(tmp_path / 'x.csv')]) == 2
    error = capsys.readouterr().err
    assert error.startswith('error: ')
    assert message in error
    assert 'Traceback' not in error


@pytest.mark.parametrize('name', ['x.mat', 'x.NPZ', 'x.yaml', 'x.csv.zip', 'x.MCAP', 'no/x.csv'])
def test_the_place_is_looked_at_before_the_work(tmp_path, capsys, name):
    assert main(['simulate', 'missing.yaml', '-o', str(tmp_path / name)]) == 2
    error = capsys.readouterr().err
    assert any(part in error for part in ('name a .csv', 'a bag is a folder', 'is no folder'))
    assert list(tmp_path.iterdir()) == []


def test_a_bag_needs_a_place_of_its_own(tmp_path, capsys):
    assert main(['simulate', 'missing.yaml', '-o', str(tmp_path)]) == 2
    assert 'exists already; choose another name' in capsys.readouterr().err


def test_a_table_may_be_named_in_capitals(tmp_path):
    out = tmp_path / 'RUN.CSV'
    assert main(['simulate', *SHORT, '-o', str(out)]) == 0
    assert out.is_file()
    assert len(one(out)) > 100
