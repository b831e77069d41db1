"""Imports go one way, and only the nodes know ROS."""

import ast
from collections.abc import Iterator
from pathlib import Path
import re

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / 'motor_sysid'

LIBRARY = {
    'signals': set(),
    'physics': {'signals'},
    'recording': {'signals'},
    'estimation': {'signals', 'physics'},
    'structures': {'signals', 'physics'},
    'control': {'signals', 'physics', 'estimation', 'structures'},
    'export': {'signals', 'physics', 'control'},
    'diagnosis': {'signals', 'physics', 'estimation', 'structures', 'control'},
    'fleet': {'signals', 'physics', 'diagnosis', 'recording'},
}
ALLOWED = {
    **LIBRARY,
    'nodes': set(LIBRARY),
    'workbench': set(LIBRARY),
    'benchmark': set(LIBRARY),
    'cli': set(LIBRARY),
}
"""Room to the rooms it may import; itself and the modules beside the rooms go without saying."""

LAZILY = {'cli': {'nodes', 'workbench', 'benchmark'}}
"""Rooms that may be imported inside a function only: one verb needs them, `--help` does not."""

SEARCH = {'result', 'where', 'candidates', 'search'}
DIAGNOSIS = {
    'result': set(),
    'where': {'result'},
    'candidates': {'result', 'where'},
    'search': {'result', 'where', 'candidates'},
    'verdict': SEARCH,
    'calibration': SEARCH,
    'change': SEARCH,
    'condition': SEARCH,
    'fitting': SEARCH,
    'experiment': {*SEARCH, 'fitting'},
}
"""The same for the rooms inside diagnosis, and for the one module beside them that a room uses;
the other modules stand on top."""

ROS = {
    'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'rcl_interfaces', 'rclpy',
    'rosgraph_msgs', 'sensor_msgs', 'std_msgs', 'std_srvs',
}  # fmt: skip

SOURCES = sorted(PACKAGE.rglob('*.py'))
INSIDE = 'motor_sysid.diagnosis.'
INNER = sorted((PACKAGE / 'diagnosis').rglob('*.py'))


def imported(tree: ast.AST, lazily: bool = False) -> Iterator[tuple[str, bool]]:
    """Yield (dotted module, imported inside a function) for each import; types only are free."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, lazily) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'line {node.lineno}: write the import in full'
            yield from ((f'{node.module}.{alias.name}', lazily) for alias in node.names)
        elif not (isinstance(node, ast.If) and 'TYPE_CHECKING' in ast.unparse(node.test)):
            inside = lazily or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
            yield from imported(node, inside)


def room_of(path: Path) -> str:
    """Return the room that a source file belongs to, '' beside them."""
    parts = path.relative_to(PACKAGE).parts
    return parts[0] if len(parts) > 1 else ''


def faults(path: Path) -> list[str]:
    """List the imports of one file that go the wrong way."""
    room, found = room_of(path), []
    for name, lazily in imported(ast.parse(path.read_text())):
        top, *rest = name.split('.')
        if top in ROS and room != 'nodes':
            found.append(f'{name}: only nodes know ROS')
        target = rest[0] if rest else ''
        if top != 'motor_sysid' or target not in ALLOWED or room in ('', target):
            continue
        if target in ALLOWED[room] or (lazily and target in LAZILY.get(room, ())):
            continue
        found.append(f'{room} must not import {name}')
    return found


def faults_inside(path: Path) -> list[str]:
    """List the imports of one file of diagnosis that go the wrong way inside it."""
    room = path.relative_to(PACKAGE / 'diagnosis').parts[0].removesuffix('.py')
    names = [name for name, _ in imported(ast.parse(path.read_text()))]
    targets = [(name, name.split('.')[2]) for name in names if name.startswith(INSIDE)]
    if room not in DIAGNOSIS:
        return []
    allowed = {room, *DIAGNOSIS[room]}
    return [f'{room} must not import {name}' for name, to in targets if to not in allowed]


def rooms_in(folder: Path) -> set[str]:
    """Return the names of the packages in a folder."""
    return {p.name for p in folder.iterdir() if p.is_dir() and list(p.glob('*.py'))}


def test_every_room_has_its_rule() -> None:
    assert rooms_in(PACKAGE) <= set(ALLOWED)
    assert rooms_in(PACKAGE / 'diagnosis') <= set(DIAGNOSIS)


@pytest.mark.parametrize('path', SOURCES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_one_way(path: Path) -> None:
    assert not faults(path)


@pytest.mark.parametrize('path', INNER, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_one_way_inside_diagnosis(path: Path) -> None:
    assert not faults_inside(path)


def test_only_the_doctor_and_what_stands_above_know_its_checks() -> None:
    """They look at signals and motors, which do not look back."""
    below = [*(PACKAGE / 'signals').glob('*.py'), *(PACKAGE / 'physics').rglob('*.py')]
    for path in set(below) - {PACKAGE / 'signals' / 'doctor.py'}:
        names = [name for name, _ in imported(ast.parse(path.read_text()))]
        assert not [n for n in names if n.startswith('motor_sysid.signals.checks')], path.name


@pytest.mark.parametrize('room', sorted(rooms_in(PACKAGE / 'diagnosis')))
def test_a_room_of_diagnosis_names_its_files(room: str) -> None:
    folder = PACKAGE / 'diagnosis' / room
    said = ast.get_docstring(ast.parse((folder / '__init__.py').read_text())) or ''
    files = {p.stem for p in folder.glob('*.py')} - {'__init__'}
    assert files <= set(re.findall(r'`(\w+)`', said))


def test_wrong_imports_are_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), 'PACKAGE', tmp_path)
    (tmp_path / 'signals').mkdir()
    (tmp_path / 'cli').mkdir()
    low, top = tmp_path / 'signals' / 'a.py', tmp_path / 'cli' / 'b.py'
    low.write_text('import rclpy\nfrom motor_sysid.physics.model import Model\n')
    wrong, right = 'import motor_sysid.nodes.motor', 'def f():\n    import motor_sysid.nodes.pid'
    top.write_text(f'{wrong}\n\n{right}\n')
    assert len(faults(low)) == 2
    assert faults(top) == ['cli must not import motor_sysid.nodes.motor']


def test_wrong_imports_inside_diagnosis_are_seen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(globals(), 'PACKAGE', tmp_path)
    (tmp_path / 'diagnosis' / 'where').mkdir(parents=True)
    low, top = tmp_path / 'diagnosis' / 'where' / 'a.py', tmp_path / 'diagnosis' / 'engine.py'
    wrong = 'from motor_sysid.diagnosis.search import rung\nimport motor_sysid.diagnosis.engine'
    low.write_text(f'from motor_sysid.diagnosis.result.curves import Curve\n{wrong}\n')
    top.write_text(f'{wrong}\n')
    assert faults_inside(low) == [
        'where must not import motor_sysid.diagnosis.search.rung',
        'where must not import motor_sysid.diagnosis.engine',
    ]
    assert not faults_inside(top)
