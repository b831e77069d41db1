"""Imports go one way, and only the nodes know ROS."""

import ast
from collections.abc import Iterator
from pathlib import Path

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
    'diagnosis': {'signals', 'physics', 'estimation', 'structures', 'control'},
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

ROS = {
    'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'rcl_interfaces', 'rclpy',
    'rosgraph_msgs', 'sensor_msgs', 'std_msgs', 'std_srvs',
}  # fmt: skip

SOURCES = sorted(PACKAGE.rglob('*.py'))


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


def test_every_room_has_its_rule() -> None:
    rooms = {p.name for p in PACKAGE.iterdir() if p.is_dir() and list(p.glob('*.py'))}
    assert rooms <= set(ALLOWED)


@pytest.mark.parametrize('path', SOURCES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_go_one_way(path: Path) -> None:
    assert not faults(path)


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
