"""The programs in bench/, and the figures in docs/ that come from the results kept there."""

import json
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest

from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

ROOT = Path(__file__).resolve().parent.parent
BENCH, RESULTS = ROOT / 'bench', ROOT / 'bench' / 'results'


def run(name, *arguments):
    line = [sys.executable, BENCH / name, *arguments]
    return subprocess.run(list(map(str, line)), capture_output=True, text=True, check=False)


def test_the_page_tells_what_the_results_say(tmp_path):
    page, copy = ROOT / 'docs' / 'benchmark.md', tmp_path / 'page.md'
    copy.write_text(page.read_text(encoding='utf-8'), encoding='utf-8')
    for begins, options in (('diagnosis', []), ('earlier', ['--seeds'])):
        files = sorted(RESULTS.glob(f'{begins}_*.jsonl'))
        assert files
        done = run('diagnosis_rates.py', *files, '--markdown', copy, *options)
        assert done.returncode == 0, done.stderr
    assert copy.read_text(encoding='utf-8') == page.read_text(encoding='utf-8')


def test_other_methods_are_asked_about_cases_that_ran_without_them(tmp_path):
    (kept, *_) = sorted(RESULTS.glob('diagnosis_*.jsonl'))
    lines = kept.read_text(encoding='utf-8').splitlines(keepends=True)
    file = tmp_path / 'few.jsonl'
    file.write_text(''.join(lines[:3]), encoding='utf-8')
    done = run('diagnosis_peers.py', file, '--cases', 1)
    assert done.returncode == 0, done.stderr
    again = file.read_text(encoding='utf-8').splitlines(keepends=True)
    assert (again[0], again[2]) == (lines[0], lines[2])
    before, after = json.loads(lines[1]), json.loads(again[1])
    assert set(after['peers']) >= {'f_test'}
    assert {**after, 'peers': {}} == {**before, 'peers': {}}
    assert '1 of 1' in done.stdout
    assert '1 of 1' not in run('diagnosis_peers.py', file, '--cases', 1).stdout


def test_a_table_goes_between_its_marks_only(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(BENCH)
    from pages import filled, markdown  # type: ignore[import-not-found]

    page = tmp_path / 'page.md'
    page.write_text('before\n<!-- t -->\nold\n<!-- end of t -->\nafter\n')
    table = markdown(('a', 'b'), [('1', '')])
    assert filled(page, 't', table) == (
        'before\n<!-- t -->\n| a | b |\n| --- | --- |\n| 1 |  |\n<!-- end of t -->\nafter\n'
    )
    with pytest.raises(ValueError, match='no place for a table'):
        filled(page, 'other', table)


def test_the_page_tells_what_random_motors_were_told(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(BENCH)
    from random_motors import kept, table  # type: ignore[import-not-found]

    page = (ROOT / 'docs' / 'benchmark.md').read_text(encoding='utf-8')
    assert table(kept(sorted(RESULTS.glob('random_motors_*.jsonl')))) in page


def test_a_plain_motor_is_that_of_the_model_where_nothing_hides_in_it(monkeypatch):
    """Two integrations with nothing in common: steps of Euler's method, and the package's own."""
    monkeypatch.syspath_prepend(BENCH)
    from plain_motor import measure, Motor, Rig  # type: ignore[import-not-found]

    values = {'R': 1.2, 'L': 1e-3, 'k_t': 0.05, 'J': 4e-5, 'b': 2e-5}
    volts = np.where(np.arange(600) % 200 < 100, 12.0, -6.0)
    rig = Rig(24.0, 1e9, 1e9, 0.0, 1e-9, 1e3)
    plain = measure(Motor(*values.values()), rig, volts, 1e-3, np.zeros(volts.size))
    record = Record(1e-3 * np.arange(volts.size), {'voltage': volts}, {'voltage': 'V'})
    run = simulate(Model.base('brushed_dc', values), record, substeps=8).outputs
    for column, name in ((1, 'current'), (3, 'position')):
        expected = run[name] - run[name][0]
        off = plain[:, column] - plain[0, column] - expected
        assert np.max(np.abs(off)) < 2e-3 * np.max(np.abs(expected)), name


def test_random_motors_are_the_same_for_the_same_number(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(BENCH)
    from random_motors import CASES, draw, FILES

    def records(number, seed, name):
        draw(CASES[number], np.random.default_rng([seed, number]), tmp_path / name)
        return [(tmp_path / name / f'{file}.csv').read_text(encoding='utf-8') for file in FILES]

    first = records(3, 1, 'a')
    assert first == records(3, 1, 'b')
    assert first != records(3, 2, 'c')
    assert first[0].startswith('time [s],voltage [V],current [A],speed [rad/s],position [rad]\n')
