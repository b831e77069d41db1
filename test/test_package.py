"""The package agrees with itself: versions, dependencies, shipped files, documents, shape."""

import ast
import importlib.metadata
import io
from pathlib import Path
import re
import subprocess
import sys
import tokenize
import xml.etree.ElementTree as ElementTree

import pytest
import yaml

import motor_sysid
from motor_sysid.errors import UserError
from motor_sysid.resources import shipped_directory, shipped_file

ROOT = Path(__file__).resolve().parent.parent
SOURCES = sorted((ROOT / 'motor_sysid').rglob('*.py'))
LAUNCH_FILES = sorted((ROOT / 'launch').glob('*.py'))
SHIPPED = ('config', 'launch', 'msg_config')
DOCUMENTS = [*ROOT.glob('*.md'), *(ROOT / 'docs').rglob('*.md'), ROOT / 'bags' / 'README.md']

DEPENDENCIES = {
    'filterpy': ('filterpy', 'python3-filterpy-pip'),
    'llvmlite': ('numba', 'python3-numba'),  # of one release with numba, which chooses it
    'numba': ('numba', 'python3-numba'),
    'numpy': ('numpy', 'python3-numpy'),
    'rich': ('rich', 'python3-rich'),
    'rosbags': ('rosbags', 'python3-rosbags-pip'),
    'scipy': ('scipy', 'python3-scipy'),
    'yaml': ('PyYAML', 'python3-yaml'),
}
"""Imported module to its name in setup.py and its rosdep key in package.xml."""


def manifest() -> ElementTree.Element:
    """Return the root of package.xml."""
    return ElementTree.parse(ROOT / 'package.xml').getroot()


def tracked_files() -> list[Path]:
    """List the files under version control, or skip outside a clone."""
    listing = subprocess.run(
        ['git', 'ls-files', '-z'], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listing.returncode != 0:
        pytest.skip('not a git clone')
    paths = (ROOT / name for name in listing.stdout.split('\0') if name)
    return [path for path in paths if path.is_file()]


def imported_packages(paths: list[Path]) -> set[str]:
    """Return the top-level names of what these files import from outside the standard library."""
    names = set()
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name.split('.')[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                names.add(node.module.split('.')[0])
    return names - sys.stdlib_module_names - {'motor_sysid'}


def setup_arguments() -> dict[str, object]:
    """Return what setup.py passes to setup()."""
    script = (
        'import json, runpy, setuptools\n'
        'setuptools.setup = lambda **kw: print(json.dumps(kw))\n'
        "runpy.run_path('setup.py')\n"
    )
    done = subprocess.run(
        [sys.executable, '-c', script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return yaml.safe_load(done.stdout)


def requirement_name(requirement: str) -> str:
    """Return the bare name of a requirement."""
    return re.split(r'[\[<>=!~; ]', requirement)[0]


def test_versions_agree() -> None:
    assert manifest().findtext('version') == motor_sysid.__version__
    assert setup_arguments()['version'] == motor_sysid.__version__
    assert f'## [{motor_sysid.__version__}]' in (ROOT / 'CHANGELOG.md').read_text()
    try:
        installed = importlib.metadata.version('motor_sysid')
    except importlib.metadata.PackageNotFoundError:
        return
    assert installed == motor_sysid.__version__, 'run `make setup`'


def test_manifest_is_of_an_ament_python_package() -> None:
    root = manifest()
    assert root.get('format') == '3'
    assert root.findtext('name') == 'motor_sysid'
    assert root.findtext('license') == 'Apache-2.0'
    assert root.findtext('export/build_type') == 'ament_python'
    assert 'Apache License' in (ROOT / 'LICENSE').read_text()
    assert (ROOT / 'resource' / 'motor_sysid').is_file()


def test_every_import_is_declared() -> None:
    keys = {element.text for element in manifest().iter('exec_depend')}
    required = {requirement_name(r) for r in setup_arguments()['install_requires']}
    for name in imported_packages([*SOURCES, *LAUNCH_FILES]):
        distribution, key = DEPENDENCIES.get(name, (None, name))
        assert key in keys, f'{name}: add <exec_depend>{key}</exec_depend> to package.xml'
        assert distribution is None or distribution in required, f'{name}: add it to setup.py'


def test_nothing_is_declared_in_vain() -> None:
    imported = imported_packages(SOURCES)
    needed = {DEPENDENCIES[name][0] for name in imported if name in DEPENDENCIES}
    assert {requirement_name(r) for r in setup_arguments()['install_requires']} == needed


def test_launch_and_rclpy_are_no_requirements_of_pip() -> None:
    arguments = setup_arguments()
    names = {requirement_name(r) for r in arguments['install_requires']}
    for requirements in arguments['extras_require'].values():
        names |= {requirement_name(r) for r in requirements}
    assert not names & {'rclpy', 'launch', 'launch_ros'}, 'packages of those names are not ROS'


def test_every_entry_point_exists() -> None:
    for entry in setup_arguments()['entry_points']['console_scripts']:
        module, function = entry.split('=')[1].strip().split(':')
        path = ROOT.joinpath(*module.split('.'))
        path = path / '__init__.py' if path.is_dir() else path.with_suffix('.py')
        functions = [
            node.name
            for node in ast.parse(path.read_text()).body
            if isinstance(node, ast.FunctionDef)
        ]
        assert function in functions, entry


def test_all_shipped_files_are_installed() -> None:
    installed = {Path(name) for _, files in setup_arguments()['data_files'] for name in files}
    tracked = [path.relative_to(ROOT) for path in tracked_files()]
    for folder in SHIPPED:
        wanted = {path for path in tracked if path.parts[0] == folder}
        assert wanted, f'{folder} is empty'
        assert wanted <= installed


def test_shipped_files_are_found() -> None:
    for folder in SHIPPED:
        assert shipped_directory(folder) == ROOT / folder
    assert shipped_file('msg_config', 'emps') == ROOT / 'msg_config' / 'emps.yaml'
    with pytest.raises(UserError, match=r'no `nonsense`; it has .*emps\.yaml'):
        shipped_file('msg_config', 'nonsense')


YAML_FILES = [p for folder in SHIPPED for p in sorted((ROOT / folder).rglob('*.y*ml'))]


@pytest.mark.parametrize('path', YAML_FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_yaml_file_parses(path: Path) -> None:
    assert isinstance(yaml.safe_load(path.read_text()), dict)


def targets(document: Path) -> set[str]:
    """Return the relative link targets of a Markdown document, code blocks left out."""
    text = re.sub(r'```.*?```|`[^`\n]*`', '', document.read_text(), flags=re.DOTALL)
    found = re.findall(r'\]\(<?([^)\s>]+)>?[^)]*\)', text)
    found += re.findall(r'(?:src|href)="([^"]+)"', text)
    return {target for target in found if not re.match(r'[a-z]+:', target)}


def anchors(document: Path) -> set[str]:
    """Return the anchors of a Markdown document's headings."""
    headings = re.findall(r'^#+ +(.+?) *$', document.read_text(), flags=re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', h.lower()).replace(' ', '-') for h in headings}


@pytest.mark.parametrize('document', DOCUMENTS, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_link_resolves(document: Path) -> None:
    for target in targets(document):
        name, _, anchor = target.partition('#')
        path = (document.parent / name).resolve() if name else document
        assert path.exists(), f'{target} does not exist'
        assert not anchor or anchor in anchors(path), f'{target}: no such heading'


FORBIDDEN = re.compile(
    r'(?<![\w.])/(?:home|root|work|Users)/\w'  # somebody's own directories
    r'|\bX{3}\b|\bFIXME\b|\bTODO\b'  # unfinished work belongs in an issue
)


def test_no_file_names_a_directory_of_its_author() -> None:
    faults = []
    for path in tracked_files():
        if path.suffix in ('.lock', '.png', '.mcap', '.db3') or path == Path(__file__):
            continue
        for number, line in enumerate(path.read_text(errors='replace').splitlines(), 1):
            if FORBIDDEN.search(line):
                faults.append(f'{path.relative_to(ROOT)}:{number}: {line.strip()[:80]}')
    assert not faults


def test_locks_name_no_index_and_pin_everything_by_hash() -> None:
    for lock in ('requirements.lock', 'requirements-jazzy.lock'):
        text = (ROOT / lock).read_text()
        assert '://' not in text
        assert 'index-url' not in text
        pins = re.findall(r'^[a-z0-9].*?(?=^[a-z0-9]|\Z)', text, flags=re.MULTILINE | re.DOTALL)
        assert len(pins) > 20
        assert all('==' in pin and '--hash=sha256:' in pin for pin in pins)
        assert any(']==' in pin for pin in pins), 'pip asks for a hash of what an extra names'


def test_locks_cover_every_requirement() -> None:
    arguments = setup_arguments()
    required = arguments['install_requires'] + arguments['extras_require']['test']
    for lock in ('requirements.lock', 'requirements-jazzy.lock'):
        text = (ROOT / lock).read_text()
        pinned = re.findall(r'^([a-z0-9-]+)(?:\[.*\])?==', text, flags=re.MULTILINE)
        missing = {requirement_name(r).lower() for r in required} - set(pinned)
        assert not missing, f'{lock}: run `make lock`'


LONG_FUNCTIONS = {
    'run_block': 'the integrator, compiled as one function: a call inside its loops costs speed',
}
"""The functions that may be longer, each with its reason."""


def code_lines(node: ast.AST, code: set[int]) -> int:
    """Count the lines of a function that hold code: no docstring, comment or blank line."""
    lines = set(range(node.lineno, node.end_lineno + 1)) & code
    first = node.body[0]
    if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
        lines -= set(range(first.lineno, first.end_lineno + 1))
    return len(lines)


@pytest.mark.parametrize('path', SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_and_functions_stay_small(path: Path) -> None:
    text = path.read_text()
    assert text.count('\n') <= 400, 'about 300 lines a file: find the second idea in it'
    skip = (tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    code = {n for t in tokens if t.type not in skip for n in range(t.start[0], t.end[0] + 1)}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            size = code_lines(node, code)
            small = size <= 50 or node.name in LONG_FUNCTIONS
            assert small, f'{node.name} has {size} lines of code; think again at 40'
