"""Motors of one type: the odd one is named with what is odd, and alike ones are left in peace."""

from html.parser import HTMLParser
import json
from pathlib import Path
import re
import shlex
import shutil

from bench_motor import measure, voltage_profile
import numpy as np
import pytest
from sister_motors import sister

from motor_sysid.cli import main
from motor_sysid.diagnosis import Verdict
from motor_sysid.errors import UserError
from motor_sysid.fleet import Fleet, Member, motors_in, odd_ones, spreads, survey
from motor_sysid.fleet.picture import body
from motor_sysid.fleet.survey import common
from motor_sysid.physics.model import Model
from motor_sysid.recording import load
from motor_sysid.recording.save import write_record
from motor_sysid.signals.record import Record

PAGE = (Path(__file__).resolve().parent.parent / 'docs' / 'fleet.md').read_text()
SECONDS = 4.0


def record(rng: np.random.Generator, rubs: float = 1.0, cogs: float = 0.0) -> Record:
    """Return what sensors see of one motor, with that many times the usual friction."""
    values = sister(rng, 0.05)
    base = {n: v for n, v in values.items() if '.' not in n}
    tau = rubs * values['coulomb_friction.tau_c']
    motor = Model.base('brushed_dc', {**base, 'omega_eps': 0.02, 'i_eps': 1e-3})
    motor = motor.with_effect('coulomb_friction', {'tau_c': tau})
    if cogs:
        motor = motor.with_effect('cogging_torque', {'n': 12, 'a_1': cogs})
    return measure(motor, voltage_profile('steps', SECONDS, rng), rng)


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write six legs, of which one rubs and one cogs, and one broken recording."""
    rng, made = np.random.default_rng(11), tmp_path_factory.mktemp('fleet')
    legs = made / 'legs'
    legs.mkdir()
    for k in range(1, 7):
        one = record(rng, rubs=3.0 if k == 3 else 1.0, cogs=3e-3 if k == 5 else 0.0)
        write_record(one, legs / f'leg_{k}.csv')
    (legs / 'leg_7.csv').write_text('time [s],voltage [V]\n0,nonsense\n')
    (legs / 'notes.txt').write_text('leg 3 was warm')
    return made


@pytest.fixture(scope='module')
def two(folder: Path) -> Path:
    """Return a folder with two of the legs that are alike."""
    made = folder / 'two'
    made.mkdir()
    for k in (1, 2):
        shutil.copy(folder / 'legs' / f'leg_{k}.csv', made)
    return made


@pytest.fixture(scope='module')
def toured(folder: Path) -> Path:
    """Run the commands of the page there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        (shell,) = re.findall(r'```sh\n(.*?)```', PAGE, flags=re.DOTALL)
        for line in shell.splitlines():
            program, *arguments = shlex.split(line.partition('#')[0])
            assert program == 'motor-sysid'
            assert main([*arguments, '--workers', '2']) == 0, line
    return folder


def test_the_odd_ones_are_named_with_what_is_odd(toured: Path) -> None:
    found = json.loads((toured / 'fleet.json').read_text())
    assert found['schema'] == 'motor_sysid/fleet/1'
    assert found['effects'] == ['coulomb_friction']
    odd = {one['name']: one['odd'] for one in found['members'] if one['odd']}
    assert set(odd) == {'leg_3', 'leg_5'}
    assert re.search(r'coulomb_friction.tau_c\) is .* times as much; the others', odd['leg_3'][0])
    assert any('has cogging torque beyond the others' in text for text in odd['leg_5'])
    assert [text.partition(':')[0] for text in found['unread']] == ['leg_7']
    friction = next(p for p in found['parameters'] if p['name'] == 'coulomb_friction.tau_c')
    assert friction['mean'] == pytest.approx(4e-3, rel=0.1)
    assert [one['name'] for one in friction['odd']] == ['leg_3']


class Rows(HTMLParser):
    """Counts what a page draws, and what is not closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.dots = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Count a dot, or remember a tag."""
        if tag not in ('meta', 'link', 'br'):
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Count a dot."""
        self.dots += tag == 'circle'

    def handle_endtag(self, tag: str) -> None:
        """Close what was opened last."""
        assert self.open.pop() == tag


def test_the_page_shows_every_motor_in_every_parameter(toured: Path) -> None:
    text = (toured / 'fleet.html').read_text()
    rows = Rows()
    rows.feed(text)
    assert not rows.open
    found = json.loads((toured / 'fleet.json').read_text())
    assert rows.dots == 6 * len(found['parameters'])
    assert text.count('<g class="odd"><title>leg_3') == 1


def test_a_given_model_is_what_all_are_held_against(
    two: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = str(tmp_path / 'model.yaml')
    fit = ['fit', str(two / 'leg_1.csv'), '--motor', 'brushed_dc']
    fit += ['--effect', 'coulomb_friction', '-o', model]
    assert main(fit) == 0
    capsys.readouterr()
    assert main(['fleet', str(two), '--model', model, '--workers', '1']) == 0
    said = capsys.readouterr().out
    assert 'model of all: linear + coulomb_friction' in said
    assert 'No motor differs from the others.' in said
    assert 'parameters are compared from 5 motors on' in said


def test_the_python_of_the_page_runs(
    two: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(two.parent)
    (code,) = re.findall(r'```python\n(.*?)```', PAGE, flags=re.DOTALL)
    of_two = code.replace("'legs'", "'two'")
    exec(compile(of_two, 'fleet.md', 'exec'), {})
    assert capsys.readouterr().out == 'leg_1\nleg_2\n'


def alike(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return values of alike motors and their standard errors, some well known and some not."""
    sigmas = 0.05 * rng.choice([0.02, 0.3, 1.0], count)
    return rng.normal(0, 0.05, count) + sigmas * rng.normal(size=count), sigmas


@pytest.mark.parametrize('count', [5, 8, 20])
def test_alike_motors_are_called_odd_as_seldom_as_stated(count: int) -> None:
    """Of 1500 fleets 5 % may; more than 6.3 % would be one chance in a hundred."""
    rng = np.random.default_rng(3)
    alarms = sum(bool(odd_ones(*alike(rng, count), 0.05)) for _ in range(1500))
    assert 30 <= alarms <= 95


def test_two_odd_ones_do_not_hide_each_other() -> None:
    rng = np.random.default_rng(5)
    values, sigmas = rng.normal(0, 0.05, 10), np.full(10, 0.005)
    values[[2, 7]] += 0.9
    assert {one.index for one in odd_ones(values, sigmas, 0.01)} == {2, 7}
    assert not odd_ones(values[:4], sigmas[:4], 0.01), 'too few to tell'


def test_a_motor_of_which_little_is_known_is_not_odd() -> None:
    rng = np.random.default_rng(6)
    values, sigmas = rng.normal(0, 0.05, 8), np.full(8, 0.005)
    values[4] += 0.6
    assert [one.index for one in odd_ones(values, sigmas, 0.01)] == [4]
    sigmas[4] = 0.3
    assert not odd_ones(values, sigmas, 0.01)


def test_motors_that_are_the_same_to_the_last_digit_are_alike() -> None:
    assert not odd_ones([1.0] * 6, [0.0] * 6, 0.01)


def test_the_model_of_all_has_what_most_have() -> None:
    coulomb, stribeck, drag = 'coulomb_friction', 'stribeck_friction', 'quadratic_drag'
    assert common([[coulomb], [stribeck], [coulomb], []]) == (coulomb,)
    assert common([[stribeck], [stribeck], [coulomb]]) == (stribeck,)
    assert set(common([[coulomb, drag], [drag, coulomb], [coulomb]])) == {coulomb, drag}
    assert common([[coulomb], []]) == ()
    load, step = 'constant_load_torque', 'load_torque_step'  # one adds to the other
    assert set(common([[load, step]] * 3)) == {load, step}
    assert common([[step], [step], [load]]) == (step,)


def member(name: str, friction: float, **other: object) -> Member:
    """Return a motor that was fitted."""
    model = Model.base('brushed_dc').with_effect('coulomb_friction')
    model = model.with_estimates(
        {'R': 1.0, 'coulomb_friction.tau_c': friction},
        {'R': 1e-3, 'coulomb_friction.tau_c': 0.02 * friction, 'L': np.inf},
    )
    given = {'verdict': Verdict.EFFECT_MISSING, 'effects': ('coulomb_friction',), **other}
    return Member(name, reason='', errors=(9.0, 1.0, 1.0), model=model, **given)  # type: ignore[arg-type]


def test_what_the_data_do_not_tell_is_not_compared() -> None:
    members = [member(f'<m{k}>', 0.01 * (1 + 0.02 * k)) for k in range(6)]
    found = spreads({one.name: one.model for one in members if one.model})
    assert {one.parameter for one in found} == {'R', 'coulomb_friction.tau_c'}
    fleet = Fleet('brushed_dc', ('coulomb_friction',), tuple(members), tuple(found))
    assert not any(fleet.oddities(one) for one in members)
    assert '<m1>' not in body(fleet)
    assert '&lt;m1&gt;' in body(fleet)


def test_a_motor_that_shows_less_or_something_unknown_is_odd() -> None:
    bare = member('bare', 1e-4, verdict=Verdict.COMPLETE, effects=(), less=('coulomb_friction',))
    odd = member('odd', 0.01, verdict=Verdict.UNKNOWN_EFFECT, effects=())
    fleet = Fleet('brushed_dc', ('coulomb_friction',), (member('usual', 0.01), bare, odd), ())
    assert fleet.oddities(fleet.members[0]) == []
    assert fleet.oddities(bare) == ['shows no Coulomb friction']
    assert fleet.oddities(odd) == ['something is missing that no known effect explains']


def test_motors_are_files_bags_and_folders(tmp_path: Path) -> None:
    for name in ('b.csv', 'a.csv.gz', 'c.mcap', '.hidden.csv', 'notes.txt'):
        (tmp_path / name).write_text('x')
    (tmp_path / 'd').mkdir()
    (tmp_path / 'd' / 'two.csv').write_text('x')
    (tmp_path / 'd' / 'one.npz').write_text('x')
    (tmp_path / 'empty').mkdir()
    found = motors_in(tmp_path)
    assert list(found) == ['a', 'b', 'c', 'd']
    assert [path.name for path in found['d']] == ['one.npz', 'two.csv']
    (tmp_path / 'd.csv').write_text('x')
    with pytest.raises(UserError, match='two motors `d`'):
        motors_in(tmp_path)


def test_folders_without_motors_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['fleet', str(tmp_path / 'none')]) == 2
    assert 'is no folder; DIR has' in capsys.readouterr().err
    assert main(['fleet', str(tmp_path)]) == 2
    assert 'has no recordings; it should hold one' in capsys.readouterr().err
    (tmp_path / 'a.csv').write_text('time [s],voltage [V]\n')
    assert main(['fleet', str(tmp_path)]) == 2
    assert 'error: a: ' in capsys.readouterr().err


def test_a_motor_whose_process_crashes_costs_no_other(two: Path) -> None:
    legs = motors_in(two)
    records = {name: load(paths[0]).records for name, paths in legs.items()}

    def all_but_the_first(tasks, work):
        return ((task, work(task)) for task in list(tasks)[-1:])

    found = survey(records, each=all_but_the_first)
    lost, other = found.members
    assert (lost.name, lost.verdict, lost.model) == ('leg_1', None, None)
    assert lost.reason == 'its diagnosis came to no end'
    assert other.model is not None
    assert not any(found.oddities(one) for one in found.members)


def test_a_fleet_of_which_nothing_can_be_diagnosed_says_why() -> None:
    still = Record(
        0.001 * np.arange(200), {'speed': np.zeros(200)}, {'speed': 'rad/s'}
    )  # no input
    with pytest.raises(UserError, match='no motor can be diagnosed: a: '):
        survey({'a': [still]})
