"""The nodes as programs: exit codes, signals, kills, and the identifier under load."""

from collections.abc import Iterator
import json
import os
from pathlib import Path
import resource
import signal
import socket
import subprocess
import sys

import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from ros_harness import NodeProcess, nodes, parameters, wait_for

from motor_sysid.cli import main
from motor_sysid.errors import UserError
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.launcher import choose_domain, node_processes
from motor_sysid.nodes.monitor import Monitor
from motor_sysid.nodes.replay import replay
from motor_sysid.recording import load
from motor_sysid.recording.rosbag import Bag

NAMES = ('motor', 'pid', 'identifier', 'recorder', 'excitation')
VECTOR, DIAGNOSTICS = 'geometry_msgs/msg/Vector3Stamped', 'diagnostic_msgs/msg/DiagnosticArray'
INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
LOOP = {
    'motor': parameters(rate=200, hidden_effects='[coulomb_friction]'),
    'pid': parameters(profile='mixed', profile_duration=20.0, top_speed=100.0),
}


@pytest.fixture
def other() -> Iterator[Node]:
    context = Context()
    rclpy.init(context=context)
    node = rclpy.create_node('other', context=context)
    yield node
    node.destroy_node()
    rclpy.try_shutdown(context=context)


BAD = {
    'motor': (parameters(rat=1), 'did you mean `rate`'),
    'pid': (parameters(kpp=1), 'did you mean `kp`'),
    'identifier': (parameters(estimater='ekf'), 'did you mean `estimator`'),
    'recorder': (parameters(storag='mcap'), 'did you mean `storage`'),
    'excitation': (parameters(profil='steps'), 'did you mean `profile`'),
}
BAD_PID = (
    (['-p', 'kp'], 'cannot be used'),
    (['--params-file', '/nowhere.yaml'], '/nowhere.yaml'),
    (['--', 'surplus'], 'surplus'),
    (['-p', 'voltage_limit:=-1'], 'outside its range'),
)


@pytest.mark.parametrize(
    'cases', [[(n, *bad) for n, bad in BAD.items()], [('pid', *bad) for bad in BAD_PID]],
    ids=['unknown', 'unusable'],
)  # fmt: skip
def test_bad_arguments_end_with_code_2_and_a_reason(
    cases: list[tuple[str, list[str], str]],
) -> None:
    running = [(NodeProcess(name, given), message) for name, given, message in cases]
    for node, message in running:
        assert node.process.wait(40) == 2
        assert message in node.output()
        assert 'Traceback' not in node.output()
        node.kill()


def test_an_empty_list_is_no_effects(other: Node) -> None:
    """ROS gives ``[]`` no type."""
    given = {'motor': parameters(hidden_effects='[]'), 'identifier': parameters(effects='[]')}
    with nodes(**given) as running:
        for node in running.values():
            assert node.end() == 0, node.output()
    wrong = NodeProcess('pid', parameters(kp='[]'))
    assert wrong.process.wait(40) == 2
    assert "`kp` = [''] is a list; it must be a float" in wrong.output()
    wrong.kill()


def test_config_files_start_their_nodes(repository: Path, tmp_path: Path) -> None:
    given = {n: ['--params-file', str(repository / 'config' / f'{n}.yaml')] for n in NAMES}
    given['recorder'] += parameters(path=tmp_path / 'bag')
    with nodes(**given) as running:
        for node in running.values():
            assert node.end(TERM) == 0, node.output()


@pytest.mark.parametrize('signals', [(INT,), (TERM,), (INT, INT, TERM, HUP)], ids=str)
def test_every_node_ends_with_code_0_however_it_is_asked(
    signals: tuple[signal.Signals, ...], tmp_path: Path
) -> None:
    recorder = parameters(path=tmp_path / 'bag')
    with nodes(**LOOP, identifier=[], recorder=recorder) as running, Monitor() as monitor:
        monitor.wait_until_heard(lambda: None)
        for name, node in running.items():
            assert node.end(*signals) == 0, (name, node.output())
            assert 'Traceback' not in node.output()
    assert (tmp_path / 'bag' / 'metadata.yaml').exists()


@pytest.mark.parametrize('started_by_nohup', [True, False])
def test_a_node_outlives_its_terminal_where_it_was_told_to(
    started_by_nohup: bool, tmp_path: Path
) -> None:
    handler = signal.signal(HUP, signal.SIG_IGN if started_by_nohup else signal.SIG_DFL)
    try:
        with nodes(recorder=parameters(path=tmp_path / 'bag')) as running:
            node = running['recorder']
            status = Path(f'/proc/{node.process.pid}/status').read_text()
            (ignored,) = (x.split()[1] for x in status.splitlines() if x.startswith('SigIgn'))
            assert bool(int(ignored, 16) & 1 << (HUP - 1)) == started_by_nohup
            assert node.end(HUP, *([INT] if started_by_nohup else [])) == 0
    finally:
        signal.signal(HUP, handler)


def test_the_controller_leaves_the_motor_at_zero_volts(other: Node) -> None:
    voltage = RawTopic(other, '/motor/voltage_command', VECTOR)
    from motor_sysid.recording.field_reader import FieldReader

    read = FieldReader(VECTOR, ('vector.x',)).read
    values: list[float] = []

    def look() -> list[float]:
        values.extend(float(read(message.data)[0]) for message in voltage.drain())
        return values

    with nodes(**LOOP) as running:
        wait_for(lambda: any(abs(v) > 1 for v in look()), 'a voltage')
        assert running['pid'].end(INT, INT) == 0
        wait_for(lambda: look()[-3:] == [0.0] * 3, '0 V')


@pytest.mark.parametrize('storage', ['sqlite3', 'mcap'])
def test_a_bag_can_be_read_after_its_recorder_was_killed(storage: str, tmp_path: Path) -> None:
    recorder = parameters(path=tmp_path / 'bag', storage=storage)
    with nodes(motor=LOOP['motor'], recorder=recorder) as running:
        wait_for((tmp_path / 'bag').exists, 'the bag')
        wait_for(lambda: len(read_speed(tmp_path / 'bag')) > 120, 'a flushed second')
        running['recorder'].kill()
    record = load(tmp_path / 'bag').records[0]
    assert len(record) > 100
    assert record.dt == pytest.approx(0.005)


def test_a_full_disk_ends_the_recorder_with_one_line(tmp_path: Path) -> None:
    recorder = parameters(path=tmp_path / 'bag')
    with nodes(motor=LOOP['motor'], recorder=recorder) as running:
        wait_for(lambda: len(read_speed(tmp_path / 'bag')) > 120, 'a flushed second')
        node = running['recorder']
        resource.prlimit(node.process.pid, resource.RLIMIT_FSIZE, (2**15, 2**15))
        assert node.process.wait(40) == 2, node.output()
        assert node.output().count('[FATAL]') == node.output().count('disk I/O error') == 1
        assert 'Traceback' not in node.output()


def read_speed(path: Path) -> list[bytes]:
    try:
        return list(Bag(path).read(['/motor/speed'])['/motor/speed'])
    except Exception:  # noqa: BLE001 - while it is being written anything may be missing
        return []


def latest(topic: RawTopic, name: str) -> dict[str, str]:
    """Return the newest status of that name, empty if none has come."""
    found: dict[str, str] = {}
    for message in topic.drain():
        for status in deserialize_message(message.data, DiagnosticArray).status:
            if status.name == name:
                found = {pair.key: pair.value for pair in status.values}
    return found


def test_live_estimates_are_those_of_a_replay_and_nothing_is_lost_during_refits(
    other: Node, tmp_path: Path
) -> None:
    bag = tmp_path / 'bag'
    identifier = parameters(refit_period=0.5, refit_window=1.0, estimator='ekf')
    diagnostics = RawTopic(other, '/diagnostics', DIAGNOSTICS)
    health: dict[str, str] = {}

    def refits() -> int:
        health.update(latest(diagnostics, 'identifier: intake'))
        return int(health.get('refits', 0))

    with nodes(**LOOP, identifier=identifier, recorder=parameters(path=bag)) as running:
        with Monitor() as monitor:
            monitor.wait_until_heard(lambda: None)
            for _ in range(2):  # what was given before the first one may not be in the bag
                monitor.call('/identifier/reset', lambda: None)
                known = refits()  # the status may be a second, two refits, old
                wait_for(lambda known=known: refits() >= known + 4, 'refits of the new start')
        for name in ('pid', 'motor', 'identifier', 'recorder'):
            assert running[name].end() == 0, running[name].output()
    assert {health[key] for key in health if key.startswith('lost')} == {'0'}
    assert health['missing'] == health['out_of_order'] == health['overflow'] == '0'
    assert main(['replay', str(bag), '--check', '--csv', str(tmp_path / 'e.csv')]) == 0
    assert (tmp_path / 'e.csv').read_text().startswith('time [s],R [ohm],R_sigma [ohm]')
    result = replay(bag)
    assert result.check is not None
    assert result.check.difference == ''
    assert result.check.compared > 5
    assert len({event.first_stamp for event in result.estimates}) >= 2, 'before and after reset'


def test_a_node_that_dies_is_named_with_its_last_lines(tmp_path: Path) -> None:
    with node_processes(tmp_path) as processes:
        processes.start('pid', {'kp': -1.0})
        with pytest.raises(UserError, match='node `pid` ended with code 2') as caught:
            wait_for(lambda: processes.check(), 'its end')
    assert 'outside its range' in str(caught.value)


def test_what_need_not_be_on_time_gives_way(tmp_path: Path) -> None:
    mine = os.getpriority(os.PRIO_PROCESS, 0)
    with node_processes(tmp_path) as processes:
        for name, gives_way in (('pid', False), ('identifier', True)):
            processes.start(name, {}, gives_way=gives_way)
            its = os.getpriority(os.PRIO_PROCESS, processes.process_id(name))
            assert its == min(mine + 5 * gives_way, 19)


def is_running(process: Path) -> bool:
    """Tell whether a process of /proc is there and no zombie."""
    try:
        return 'State:\tZ' not in (process / 'status').read_text()
    except OSError:
        return False


def test_nodes_end_with_the_process_that_started_them(tmp_path: Path) -> None:
    code = (
        'import sys, pathlib, time\n'
        'from motor_sysid.nodes.launcher import NodeProcesses\n'
        'processes = NodeProcesses(pathlib.Path(sys.argv[1]))\n'
        "processes.start('pid', {})\n"
        "print(processes.process_id('pid'), flush=True)\n"
        'time.sleep(1000)\n'
    )
    parent = subprocess.Popen(
        [sys.executable, '-c', code, str(tmp_path)], stdout=subprocess.PIPE, text=True,
        env={**os.environ, 'PYTHONPATH': str(Path(__file__).resolve().parent.parent)},
    )  # fmt: skip
    assert parent.stdout is not None
    child = Path('/proc') / parent.stdout.readline().strip()
    wait_for(lambda: '[INFO]' in (tmp_path / 'pid.log').read_text(), 'the node')
    parent.kill()
    parent.wait(10)
    wait_for(
        lambda: not child.exists() or 'State:\tZ' in (child / 'status').read_text(), 'its end'
    )
    parent.stdout.close()


@pytest.mark.slow
def test_the_demo_names_what_it_hid(tmp_path: Path) -> None:
    out = tmp_path / 'demo'
    assert main(['demo', '--seconds', '12', '--out', str(out), '--storage', 'mcap']) == 0
    found = json.loads((out / 'diagnosis.json').read_text())
    assert set(found['effects']) == {'coulomb_friction', 'cogging_torque'}
    assert (out / 'report.html').stat().st_size > 10_000
    assert main(['replay', str(out / 'bag'), '--check']) == 0


def test_the_demo_refuses_what_it_cannot_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for arguments, message in (
        (['--hide', 'witchcraft'], 'witchcraft'),
        (['--hide', 'emf_harmonics'], 'which this brushed DC motor model does not have'),
        (['--seconds', '0'], 'outside 5 to 3600'),
        (['--rate', '9999'], 'outside 50 to 1000'),
        (['--seed', '-1'], '--seed -1 is no whole number from 0 to 2147483647'),
    ):
        assert main(['demo', '--out', str(tmp_path / 'x'), *arguments]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / 'x').exists()


def test_a_domain_that_any_participant_is_in_is_not_chosen(monkeypatch):
    """Nodes that outlived the first one hold the ports of later ones alone."""
    monkeypatch.delenv('ROS_DOMAIN_ID')
    domain = choose_domain()
    monkeypatch.delenv('ROS_DOMAIN_ID')
    assert choose_domain() == domain
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as third:
        third.bind(('', 7410 + 250 * domain + 2 * 2))
        monkeypatch.delenv('ROS_DOMAIN_ID')
        assert choose_domain() != domain


def test_the_domain_of_a_running_node_is_not_chosen(monkeypatch):
    """Of real DDS; the node is in the domain of these tests."""
    own = os.environ['ROS_DOMAIN_ID']
    context = Context()
    rclpy.init(context=context)
    try:
        node = Node('there', context=context)
        monkeypatch.setattr(os, 'getpid', lambda: int(own) - 1)
        monkeypatch.delenv('ROS_DOMAIN_ID')
        assert str(choose_domain()) != own
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)
