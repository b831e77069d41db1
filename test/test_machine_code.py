"""What is compiled is kept for one version of the package, and used by it alone."""

import subprocess
import sys
import textwrap

import pytest

CALLER = """
from made_here.inner import inner, kept


@kept()
def outer(x):
    return inner(x)
"""
INNER = """
from motor_sysid.machine_code import kept

GAIN = {gain}


@kept()
def inner(x):
    return GAIN * x
"""


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / 'made_here'
    made.mkdir()
    (made / '__init__.py').write_text('')
    (made / 'outer.py').write_text(CALLER)
    return tmp_path


def called(folder, gain: float) -> tuple[float, int]:
    """Return what the outer function makes of 3 in a fresh process, and how often it was kept.

    Python itself keeps no bytecode: it takes a file of the same length, changed within a second,
    for the same.
    """
    (folder / 'made_here' / 'inner.py').write_text(INNER.format(gain=gain))
    program = textwrap.dedent("""
        from made_here.outer import outer
        print(outer(3.0), sum(outer.stats.cache_hits.values()))
    """)
    environment = {'PATH': '/usr/bin', 'MOTOR_SYSID_CACHE': str(folder / 'cache')}
    done = subprocess.run(
        [sys.executable, '-B', '-c', program], cwd=folder, env=environment, check=True,
        capture_output=True, text=True,
    )  # fmt: skip
    value, hits = done.stdout.split()
    return float(value), int(hits)


def test_a_constant_of_another_file_is_never_that_of_an_earlier_version(folder):
    """Numba asks only whether the file of a function is the same; its callees are not asked."""
    assert called(folder, 2.0) == (6.0, 0)
    assert called(folder, 2.0) == (6.0, 1)
    assert called(folder, 5.0) == (15.0, 0)
    assert called(folder, 2.0) == (6.0, 1)


def test_numba_keeps_its_own_folder_for_what_others_compile():
    program = (
        'import numba; before = numba.config.CACHE_DIR; import motor_sysid.physics.kernel; '
        'assert numba.config.CACHE_DIR == before'
    )
    subprocess.run([sys.executable, '-c', program], check=True)
