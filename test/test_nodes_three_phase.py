"""The simulated motor as PMSM and BLDC: against the independent simulator, and over real DDS."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
import math
from pathlib import Path
import time

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.utilities import try_shutdown
from ros_harness import nodes, parameters, wait_for

from motor_sysid.benchmark.machine import Bridge, Machine
from motor_sysid.benchmark.three_phase_cases import draw
from motor_sysid.benchmark.three_phase_drive import PhaseSensors, run_drive, ThreePhaseDrive
from motor_sysid.control.foc import CurrentLoop
from motor_sysid.control.six_step import SixStepLoop
from motor_sysid.errors import UserError
from motor_sysid.nodes.monitor import Estimated, Monitor
from motor_sysid.nodes.motor_settings import MotorSettings
from motor_sysid.nodes.plants import make_plant
from motor_sysid.nodes.plants.base import Plant, Sample
from motor_sysid.nodes.publishing import joint_publisher, vector_publisher
from motor_sysid.recording import load
from motor_sysid.signals import Record
from motor_sysid.signals.doctor import examine
from motor_sysid.signals.phases import phase_columns

IDEAL = {'encoder_counts': 0, 'current_noise': 0.0, 'current_offset': 0.0, 'current_bits': 0}
ROTOR = {'R': 2.0, 'J': 5e-5, 'b': 2e-5}
PMSM = Machine(**ROTOR, L_d=4e-3, L_q=5e-3, k_e=4 * 8.3e-3, pole_pairs=4)
BLDC = Machine(**ROTOR, L_d=5e-3, L_q=5e-3, k_e=0.025, pole_pairs=4, corner=0.3)
FOC = CurrentLoop(2.0, 4e-3, 5e-3, 8.3e-3, 1080.0)
SIX = SixStepLoop(2.0, 5e-3, 0.025, 1080.0, 5.0)
PERFECT = PhaseSensors(counts=0, noise=0.0, bits=0)
COMMANDS = np.repeat([1.0, -2.0, 0.5], [40, 60, 20])


def plant(kind: str, **given: object) -> Plant:
    settings = {'rate': 500.0, 'control_rate': 4000.0, 'motor_kind': kind, **given}
    return make_plant(MotorSettings(**settings).setup())  # type: ignore[arg-type]


def samples(of: Plant, commands: np.ndarray) -> list[Sample]:
    return [of.sample(float(command)) for command in commands]


def test_a_pmsm_that_speeds_up_gets_the_voltage_that_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """2700 rad/s^2: with the speed of the last sample, which is half a sample old, 23 mV on d."""
    motor = make_plant(
        MotorSettings(motor_kind='pmsm', rate=1000.0, pole_pairs=4, encoder_counts=10**6).setup()
    )
    given, step = [], motor.stepper.step
    monkeypatch.setattr(motor.stepper, 'step', lambda u: (given.append(u[0]), step(u)))
    off = []
    for _ in range(40):
        given.clear()
        told = motor.sample(3.0).voltage[0]
        off.append(np.mean(given) - told)
    assert motor.stepper.state['omega'] > 80.0
    assert abs(np.mean(off[5:])) < 2e-3


@pytest.mark.parametrize('kind', ['pmsm', 'bldc'])
def test_live_motors_move_as_the_independent_simulation_does(kind: str) -> None:
    ours = samples(plant(kind, **IDEAL), COMMANDS)
    machine, loop = (PMSM, FOC) if kind == 'pmsm' else (BLDC, SIX)
    drive = ThreePhaseDrive(Bridge(24.0), loop, control_dt=2.5e-4, sensors=PERFECT)
    theirs = run_drive(machine, drive, COMMANDS, 2e-3, np.random.default_rng(0))
    speed = np.array([sample.position for sample in ours])
    tolerance = 0.01 if kind == 'pmsm' else 0.03
    top = np.max(np.abs(theirs.position))
    assert np.max(np.abs(speed - theirs.position)) < tolerance * top
    if kind == 'pmsm':
        current = np.array([sample.current[1] for sample in ours])
        assert np.allclose(current[5:40], 1.0, atol=0.05)
        voltage = np.array([sample.voltage for sample in ours])
        assert np.max(np.abs(voltage[5:, :2] - theirs.command_dq[5:])) < 0.6


def test_a_pmsm_tells_d_and_q_with_offsets_that_turn() -> None:
    of = plant('pmsm', encoder_counts=0, current_noise=0.0, current_bits=0, current_offset=0.1,
               angle_offset=0.5)  # fmt: skip
    told = samples(of, np.full(150, 0.3))
    d = np.array([sample.current[0] for sample in told[20:]])
    state = of.stepper.state
    assert (of.frame, of.command) == ('dq', 'current')
    assert np.max(np.abs(d)) < 0.05, 'the drive believes its sensors'
    assert abs(state['i_d']) < 0.2
    assert math.hypot(state['i_d'], state['i_q'] - 0.3) == pytest.approx(0.1155, rel=0.2)
    u_q = told[-1].voltage[1]
    assert u_q == pytest.approx(2.0 * 0.3 + 4 * 8.3e-3 * told[-1].speed, abs=0.6)


def test_a_bldc_drives_two_phases_and_shows_what_the_third_induces() -> None:
    of = plant('bldc', **IDEAL)
    told = samples(of, np.full(120, 1.0))
    currents = np.abs([sample.current for sample in told[20:]])
    assert np.median(np.sort(currents)[:, 0]) < 0.02
    assert np.median(np.sort(currents)[:, 2]) == pytest.approx(1.0, abs=0.1)
    voltages = np.array([sample.voltage for sample in told])
    assert np.all((voltages > -0.8) & (voltages < 24.8))
    assert of.frame == 'abc'
    assert abs(sum(told[-1].current)) < 1e-9


def test_a_phase_that_was_left_ends_its_period_without_current() -> None:
    """As far as the rails allow it, where the resistance takes its part of a long period, too."""
    of = plant('bldc', **IDEAL, control_rate=500.0)
    told = np.array([sample.current for sample in samples(of, np.full(300, 1.0))[50:]])
    largest = np.max(np.abs(told), axis=1)
    left = np.min(np.abs(told), axis=1)
    assert np.sqrt(np.mean((left / largest) ** 2)) < 0.15


@pytest.mark.parametrize('kind', ['brushed_dc', 'pmsm', 'bldc'])
def test_sensors_that_are_wrong_show_it(kind: str) -> None:
    speed = ('speed_sensor_scale.g=0.2', 'speed_sensor_offset.o=3.0')
    given = {'hidden_effects': ('speed_sensor_scale', 'speed_sensor_offset'), **IDEAL}
    of = plant(kind, hidden_parameters=speed, **given)
    one = samples(of, np.full(120, 1.0))[-1]
    true = of.stepper.state['omega']
    assert one.speed == pytest.approx(1.2 * true + 3.0, rel=0.03)
    of = plant(kind, hidden_effects=('current_sensor_scale',), **IDEAL,
               hidden_parameters=('current_sensor_scale.g=0.25',))  # fmt: skip
    if kind == 'brushed_dc':
        both = of, plant(kind, **IDEAL)
        told = [samples(each, np.full(3, 2.0))[-1].current[0] for each in both]
        assert told[0] == pytest.approx(1.25 * told[1], rel=1e-6)
    else:  # the drive believes its sensors: less current flows
        samples(of, np.full(40, 1.0))
        own = of.stepper.state
        size = math.hypot(own['i_d'], own['i_q']) if kind == 'pmsm' else max(
            abs(own['i_a']), abs(own['i_b']), abs(own['i_a'] + own['i_b']))  # fmt: skip
        assert size == pytest.approx(0.8, abs=0.08)


@pytest.mark.parametrize('kind', ['pmsm', 'bldc'])
def test_hidden_effects_come_without_a_jump_and_reset_stops(kind: str) -> None:
    of = plant(kind)
    before = samples(of, np.full(60, 1.0))[-1]
    of.change(MotorSettings(
        motor_kind=kind, control_rate=4000.0, hidden_effects=('coulomb_friction',),
        hidden_parameters=('coulomb_friction.tau_c=0.04',),
    ).setup())  # fmt: skip
    after = samples(of, np.full(60, 0.0))
    assert after[0].speed == pytest.approx(before.speed, rel=0.05)
    assert after[-1].speed < 0.2 * before.speed
    of.reset()
    still = of.sample(0.0)
    assert (still.speed, still.position) == (0.0, 0.0)


def test_rates_that_do_not_go_together_are_refused_with_the_next_that_does() -> None:
    with pytest.raises(UserError, match='take 1500 Hz'):
        MotorSettings(motor_kind='pmsm', rate=500.0, control_rate=1600.0)
    with pytest.raises(UserError, match=r'needs|unknown'):
        MotorSettings(motor_kind='bldc', hidden_effects=('brush_voltage_drop',))


def test_a_pmsm_is_identified_and_recorded_over_dds(repository: Path, tmp_path: Path) -> None:
    """The files of the launch description, the nodes as programs, and what they leave behind."""
    config = repository / 'config'

    def files(name: str) -> list[str]:
        each = (config / f'{name}.yaml', config / 'loop_pmsm.yaml')
        return [text for file in each for text in ('--params-file', str(file))]

    nominal = '[R=2.3, L_d=3.5e-3, L_q=5.5e-3, psi_f=9.0e-3, J=4.0e-5, b=2.0e-5, pole_pairs=4]'
    given = {
        'motor': files('motor'),
        'pid': [*files('pid'), *parameters(profile='mixed', profile_duration=8.0, top_speed=80.0)],
        'identifier': [*files('identifier'), *parameters(nominal=nominal)],
        'recorder': [*files('recorder'), *parameters(path=tmp_path / 'bag')],
    }
    with nodes(**given) as running, Monitor('current') as monitor:
        monitor.wait_until_heard(lambda: None, patience=110)
        monitor.call('/identifier/reset', lambda: None)

        def known() -> bool:
            found = monitor.look().estimates
            return all(
                name in found and found[name].sigma < 0.05 * value
                and found[name].value == pytest.approx(value, rel=0.15)
                for name, value in (('R', 2.0), ('psi_f', 8.3e-3), ('J', 5e-5))
            )  # fmt: skip

        wait_for(known, 'estimates', 60)
        estimates = monitor.look().estimates
        wait_for(lambda: turned(tmp_path / 'bag') > 20.0, 'turns of the shaft', 60)
        for name in ('recorder', 'pid', 'motor', 'identifier'):  # no record without a reference
            assert running[name].end() == 0, running[name].output()
    for name, value in (('R', 2.0), ('psi_f', 8.3e-3), ('J', 5e-5)):
        assert estimates[name].value == pytest.approx(value, rel=0.15), name
    record = max(load(tmp_path / 'bag').records, key=travel)
    names = {'voltage_d', 'voltage_q', 'current_d', 'current_q', 'speed', 'position'}
    assert names | {'current_command', 'speed_reference'} <= set(record)
    assert not [f for f in examine(record) if f.code == 'electrical_offset']


def test_a_bldc_is_recorded_in_phases_over_dds(repository: Path, tmp_path: Path) -> None:
    """Terminal voltages and currents of all phases, at stamps that every topic shares."""
    loop = ['--params-file', str(repository / 'config' / 'loop_bldc.yaml')]
    given = {
        'motor': [*loop, *parameters(rate=200, control_rate=2000)],
        'pid': [*loop, *parameters(profile='steps', profile_duration=6.0, top_speed=20.0)],
        'recorder': parameters(path=tmp_path / 'bag'),
    }
    with nodes(**given) as running:
        wait_for(lambda: turned(tmp_path / 'bag') > 2.0, 'a turn of the shaft', 90)
        for name in ('recorder', 'pid', 'motor'):  # no record without a reference
            assert running[name].end() == 0, running[name].output()
    record = max(load(tmp_path / 'bag').records, key=travel)
    currents, voltages = (phase_columns(record, kind) for kind in ('current', 'voltage'))
    assert np.max(np.abs(currents.sum(axis=1))) < 1e-9
    assert record.dt == pytest.approx(5e-3)
    turning = np.abs(record['speed']) > 3
    line = np.ptp(voltages[turning], axis=1)
    assert np.all(line < 25.5)
    assert np.median(line) > 0.05
    assert {'current_command', 'speed_reference'} <= set(record)


@pytest.mark.slow
def test_a_six_step_motor_is_identified_over_dds() -> None:
    """A drive that tells voltage and current of the pair, as the nodes of a robot would."""
    case = draw('six_step/coulomb_friction/10/0', 0, 6.0)
    m, record = case.hidden.machine, case.train[0]
    true = {'R': 2 * m.R, 'k_t': 2 * m.k_e, 'J': m.J, 'coulomb_friction.tau_c': m.tau_c}
    off = {'R': 1.3 * true['R'], 'L': 1.6 * m.L_d, 'k_t': 1.6 * m.k_e, 'J': 0.7 * m.J, 'b': m.b}
    nominal = off | {'pole_pairs': m.pole_pairs, 'v_free': case.sheet.supply}
    given = parameters(
        motor='bldc_six_step', estimator='ekf', effects='[coulomb_friction]',
        nominal=f'[{", ".join(f"{name}={value:.12g}" for name, value in nominal.items())}]',
    )  # fmt: skip
    with nodes(identifier=given), Monitor() as monitor:
        with publishing() as (node, publish):
            wait_for(
                lambda: node.get_subscriptions_info_by_topic('/motor/speed'), 'a listener', 60
            )
            publish(record)
        wait_for(lambda: within(monitor.look().estimates, true, 0.03), 'estimates', 60)


def within(estimates: Mapping[str, Estimated], true: Mapping[str, float], share: float) -> bool:
    """Whether all of these are estimated, and right within a share."""
    return all(
        name in estimates and estimates[name].value == pytest.approx(value, rel=share)
        for name, value in true.items()
    )


@contextmanager
def publishing() -> Iterator[tuple[Node, Callable[[Record], None]]]:
    """Give a node and a function that publishes voltage, current and speed in real time."""
    context = Context()
    rclpy.init(context=context)
    node = rclpy.create_node('drive', context=context)
    voltage, current = (vector_publisher(node, f'motor/{n}', 'dc') for n in ('voltage', 'current'))
    speed = joint_publisher(node, 'motor/speed', 'shaft', ('position', 'velocity'))

    def publish(record: Record) -> None:
        names = ('voltage', 'current', 'position', 'speed')
        rows = np.column_stack([record[name] for name in names])
        begin = node.get_clock().now().nanoseconds
        for k, (v, i, angle, omega) in enumerate(rows.tolist()):
            stamp = begin + k * 1_000_000
            voltage.publish(stamp, v, 0.0, 0.0)
            current.publish(stamp, i, 0.0, 0.0)
            speed.publish(stamp, angle, omega)
            ahead = stamp - node.get_clock().now().nanoseconds
            if ahead > 2_000_000:
                time.sleep(1e-9 * ahead)

    try:
        yield node, publish
    finally:
        node.destroy_node()
        try_shutdown(context=context)


def travel(record: Record) -> float:
    return float(np.ptp(record['position']))


def turned(bag: Path) -> float:
    """Return how far the shaft got under a reference in a bag that is being written, rad.

    A reference whose topic was found late is left out as long as it covers less than half.
    """
    try:
        records = load(bag).records
    except UserError:
        return 0.0
    led = [r for r in records if {'position', 'speed_reference'} <= set(r)]
    return max(map(travel, led), default=0.0)
