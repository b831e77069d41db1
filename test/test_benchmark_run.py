"""Running the benchmark: workers that crash, files that go on, one real case from end to end."""

import json
from multiprocessing import Pipe
from pathlib import Path

from benchmark_tools import no_start, result, work
import pytest

from motor_sysid.benchmark import diagnosis, workers
from motor_sysid.benchmark.diagnosis import one, run, Task
from motor_sysid.benchmark.outcome import Outcome, Result
from motor_sysid.benchmark.scenarios import case_name, schedule
from motor_sysid.benchmark.store import merged, ResultsFile
from motor_sysid.errors import UserError


def test_every_task_is_answered_and_a_lost_worker_costs_one_task():
    tasks = [1, 13, 2, 7, 3, 5, 4]
    answers = dict(workers.each(tasks, work, workers=2, limit=3.0))
    assert set(answers) == set(tasks)
    assert {k: v for k, v in answers.items() if isinstance(v, int)} == {1: 1, 2: 4, 3: 9, 4: 16}
    lost = {k: v.reason for k, v in answers.items() if isinstance(v, workers.Lost)}
    assert lost == {13: 'its process died', 5: 'its process died', 7: 'stopped after 3 s'}


def test_workers_that_cannot_start_are_an_error_and_no_endless_loop():
    with pytest.raises(RuntimeError, match='did not start'):
        list(workers.each([1, 2], work, workers=1, limit=3.0, warm_up=no_start))


def test_nothing_to_do_starts_no_worker():
    assert list(workers.each([], work, workers=2, limit=1.0, warm_up=no_start)) == []


def test_results_survive_the_file(tmp_path: Path):
    path = tmp_path / 'results.jsonl'
    written = [result(('coulomb_friction',)), result(error='x', outcome=Outcome.FAILED)]
    with ResultsFile(path, 3) as file:
        for each in written:
            file.add(each)
    assert list(ResultsFile.read(path)[1].values()) == written
    with ResultsFile(path, 3) as file:
        assert list(file.results.values()) == written
    assert merged([path])[1] == written


def test_a_line_that_was_cut_off_is_run_again(tmp_path: Path):
    path = tmp_path / 'results.jsonl'
    with ResultsFile(path, 0) as file:
        file.add(result(number=1))
        file.add(result(number=2))
    path.write_bytes(path.read_bytes()[:-20])
    with ResultsFile(path, 0) as file:
        assert [r.case for r in file.results.values()] == [result(number=1).case]
        file.add(result(number=3))
    assert len(ResultsFile.read(path)[1]) == 2


def test_two_benchmarks_do_not_write_to_one_file(tmp_path: Path):
    path = tmp_path / 'results.jsonl'
    with ResultsFile(path, 0) as file:
        file.add(result(number=1))
        with pytest.raises(UserError, match=r'another benchmark writes to .*results\.jsonl'):
            ResultsFile(path, 0, fresh=True)
    with ResultsFile(path, 0) as file:
        assert len(file.results) == 1, 'the one that was refused took nothing away'


def test_a_file_of_another_seed_or_program_is_refused(tmp_path: Path):
    path = tmp_path / 'results.jsonl'
    ResultsFile(path, 0).__exit__(None, None, None)
    with pytest.raises(UserError, match='another seed'):
        ResultsFile(path, 1)
    head = json.loads(path.read_text())
    path.write_text(json.dumps({**head, 'program': 'older'}) + '\n')
    with pytest.raises(UserError, match=r'another program.*--fresh'):
        ResultsFile(path, 0)
    ResultsFile(path, 0, fresh=True).__exit__(None, None, None)
    assert ResultsFile.read(path)[1] == {}


@pytest.mark.parametrize('content', ['', 'nonsense\n', '{"schema": "other"}\n', '[1]\n'])
def test_what_is_no_results_file_is_named(tmp_path: Path, content: str):
    path = tmp_path / 'other.jsonl'
    path.write_text(content)
    with pytest.raises(UserError, match=r'other\.jsonl is no results file'):
        ResultsFile.read(path)


def test_a_stopped_benchmark_runs_only_what_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    asked: list[str] = []

    def each(tasks, *arguments, **options):
        for task in tasks:
            asked.append(task.case)
            if len(asked) == 3:
                raise KeyboardInterrupt
            yield task, Result(task.case, 'complete', (), 0.0, True)

    monkeypatch.setattr(workers, 'each', each)
    names = [case_name(*which) for which in schedule(6)]
    path = tmp_path / 'results.jsonl'
    with pytest.raises(KeyboardInterrupt), ResultsFile(path, 0) as file:
        run(6, file)
    assert asked == names[:3]
    with ResultsFile(path, 0) as file:
        assert [r.case for r in run(6, file)] == names
    assert asked[3:] == names[2:]


def test_a_worker_that_is_lost_is_counted_as_a_failure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def each(tasks, *arguments, **options):
        for task in tasks:
            yield task, workers.Lost('its process died', 2.0)

    monkeypatch.setattr(workers, 'each', each)
    with ResultsFile(tmp_path / 'results.jsonl', 0) as file:
        (found,) = run(1, file)
    assert found.outcome is Outcome.FAILED
    assert found.error == 'its process died'


def test_a_diagnosis_that_raises_is_counted_as_a_failure(monkeypatch: pytest.MonkeyPatch):
    def raises(*arguments, **options):
        raise ValueError('no')

    monkeypatch.setattr(diagnosis, 'diagnose', raises)
    found = one(Task('complete/1', 0))
    assert found.outcome is Outcome.FAILED
    assert found.error == 'ValueError: no'
    assert found.motor


@pytest.mark.slow
def test_one_case_from_end_to_end():
    found = one(Task('single/coulomb_friction/10/0', 0, ('f_test',)))
    assert found.error == ''
    assert found.outcome is Outcome.RIGHT
    assert found.named == ('coulomb_friction',)
    assert found.after < 0.5 * found.before
    assert found.after < 1.05 * found.reference
    assert abs(found.sigmas['coulomb_friction.tau_c']) < 4
    assert abs(found.base_after['b']) < 0.2 * abs(found.base_before['b'])
    assert found.peers['f_test'].error == ''
    assert Result.from_dict(json.loads(json.dumps(found.as_dict()))) == found


def test_a_worker_whose_parent_has_died_ends_quietly(monkeypatch):
    """It may be in the midst of a task then, or before its first one."""
    monkeypatch.setattr(workers.signal, 'signal', lambda *which: None)
    done = []
    mine, theirs = Pipe()

    def work(task):
        done.append(task)
        mine.close()
        return task

    mine.send('one')
    workers._serve(theirs, work, None)
    assert done == ['one']
    mine, theirs = Pipe()
    mine.close()
    workers._serve(theirs, work, None)
    assert done == ['one']
