"""The programs in bench/, and the figures in docs/ that come from the results kept there."""

import json
from pathlib import Path
import subprocess
import sys

import pytest

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
