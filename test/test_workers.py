"""Tests of one group run in one worker."""

import os
from pathlib import Path
import subprocess
import sys

import pytest
from workers import group_of

pytest.importorskip('xdist')
ONE = """
import os, pathlib, time
import pytest

@pytest.mark.parametrize('k', range(4))
def test_it(k):
    with pathlib.Path('seen').open('a') as seen:
        seen.write(f"{pathlib.Path(__file__).stem} {os.environ['PYTEST_XDIST_WORKER']}\\n")
    time.sleep(0.05)
"""


def test_groups_are_files_and_all_that_is_live():
    assert group_of('test/test_fleet.py') == 'test_fleet'
    assert group_of('test_nodes_time.py') == group_of('test_nodes_step.py') == 'live'


def test_each_group_has_one_worker(tmp_path: Path):
    names = ('test_nodes_a', 'test_nodes_b', 'test_c', 'test_d')
    for name in names:
        (tmp_path / f'{name}.py').write_text(ONE)
    command = [sys.executable, '-m', 'pytest', '-n', '2', '--dist', 'loadfile', '-p', 'workers']
    command += ['-p', 'no:cacheprovider', '--no-loadscope-reorder', '--rootdir', '.', '.']
    environment = {k: v for k, v in os.environ.items() if not k.startswith('PYTEST_')}
    environment['PYTHONPATH'] = str(Path(__file__).parent)
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    lines = [line.split() for line in (tmp_path / 'seen').read_text().splitlines()]
    workers = {name: {worker for file, worker in lines if file == name} for name in names}
    assert len(lines) == 4 * len(names)
    assert all(len(found) == 1 for found in workers.values())
    assert workers['test_nodes_a'] == workers['test_nodes_b']
    assert len(set.union(*workers.values())) == 2
