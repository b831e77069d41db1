"""The benchmark of the paper: its plant twice, its statements, its methods, gates and report."""

import json

import numpy as np
import pytest

from motor_sysid.benchmark import workers
from motor_sysid.benchmark.paper import motor, truth
from motor_sysid.benchmark.paper.fitting import profiled, recommended, told_by
from motor_sysid.benchmark.paper.gates import efficient_p95, gates
from motor_sysid.benchmark.paper.methods import characteristic_points, METHODS
from motor_sysid.benchmark.paper.plant import seen, simulate, TRUE
from motor_sysid.benchmark.paper.printed_bats import PrintedBats
from motor_sysid.benchmark.paper.published import CLOSED, ESTIMATES, OPEN
from motor_sysid.benchmark.paper.report import as_dict, Results, tables
from motor_sysid.benchmark.paper.runs import ANYWHERE, one, somewhere, Task
from motor_sysid.benchmark.paper.stability import stability
from motor_sysid.benchmark.paper.statements import statements
from motor_sysid.benchmark.paper.store import Done, PaperFile
from motor_sysid.benchmark.paper.studies import CALM, OUTSIDE, PRINTED, READINGS, record
from motor_sysid.benchmark.paper.studies import OPEN as OPEN_LOOP
from motor_sysid.benchmark.paper.suite import describe, page, plan, run, work
from motor_sysid.benchmark.store import ResultsFile
from motor_sysid.cli import main
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.optimizers import OPTIMIZERS


@pytest.mark.parametrize('loop', [OPEN_LOOP, OUTSIDE, CALM], ids=['open', 'outside', 'inside'])
@pytest.mark.parametrize('tau', [1.0, 0.4637, 0.003])
def test_the_sampled_plant_is_the_integrated_one(loop, tau):
    plant = np.array([5.0, 3.0, 1.2, 4.0, tau])
    reference = np.repeat([1.0, -0.5, 2.0], 250)
    _, y = truth.run(plant, reference, loop)
    found = simulate(plant[np.newaxis, :], reference, loop)[0]
    assert np.max(np.abs(found - y)) < 1e-9 * np.max(np.abs(y))


def test_overdamped_and_critical_plants_are_exact_too():
    for a1 in (2 * np.sqrt(5.0), 9.0, 60.0):
        plant = np.array([5.0, a1, 1.0, 5.0, 0.5])
        _, y = truth.run(plant, np.ones(400), OPEN_LOOP)
        found = simulate(plant[np.newaxis, :], np.ones(400), OPEN_LOOP)[0]
        np.testing.assert_allclose(found, y, rtol=0, atol=1e-8)


def test_the_noise_of_a_closed_loop_is_fed_back():
    study, quiet = record('D3', 20, 0), record('D3', None, 0)
    assert np.std(study.drive - quiet.drive) > 0.01
    assert np.std(study.measured - quiet.measured) > 0.5 * study.sigma


def test_the_printed_loop_is_unstable():
    found = stability(PRINTED)
    assert found.unstable_poles == 4
    assert found.crossover == pytest.approx(10.52, abs=0.01)
    assert found.delay_margin == pytest.approx(0.1416, abs=1e-4)
    assert found.gain_limit == pytest.approx(0.147, abs=1e-3)
    assert stability(CALM).unstable_poles == 0
    said = dict(statements())
    assert 'unstable' in said['printed closed loop']
    assert said['identifiable'].startswith('4 of 5')
    assert '4 of 7 from speed alone, 6 of 7' in said['a motor with K_t = K_e']


def test_bounds_are_those_of_independent_derivatives():
    study = READINGS['R1'].study()
    told = told_by(study, TRUE, 0.01)
    steps = TRUE[[0, 1, 3, 4]] * 1e-3
    slopes = []
    for k, step in zip((0, 1, 3, 4), steps, strict=True):
        moved = [TRUE.copy(), TRUE.copy()]
        moved[0][k] += step
        moved[1][k] -= step
        runs = [truth.run(m, study.drive, OPEN_LOOP)[1] for m in moved]
        slopes.append((runs[0] - runs[1]) / (2 * step))
    exact = 0.01 * np.sqrt(np.diag(np.linalg.inv(np.array(slopes) @ np.array(slopes).T)))
    np.testing.assert_allclose(told.bound, exact, rtol=1e-3)
    percent = 100 * exact / TRUE[[0, 1, 3, 4]]
    np.testing.assert_allclose(percent, [0.93, 0.76, 0.94, 0.26], rtol=0.02)


def test_the_recommended_fit_finds_any_plant():
    for seed in range(4):
        found = recommended(record('D2', None, seed, somewhere(seed)))
        np.testing.assert_allclose(seen(found.candidate), seen(somewhere(seed)), rtol=1e-5)


def test_the_recommended_fit_is_efficient():
    """Mean square of 48 scores, four to a run: 1 +- 0.3, and nothing is beyond 4 sigmas."""
    scores = np.array([one(Task('D4@30', 'best', seed, 1))[0].scores for seed in range(12)])
    assert 0.3 < np.mean(scores**2) < 2.0
    assert np.max(np.abs(scores)) < 4.5


def test_starts_need_no_knowledge():
    starts = profiled(record('D2', 20, 0))
    assert min(abs(s[4] - 1.0) for s in starts) < 0.5
    points = characteristic_points(READINGS['R1'].study())
    np.testing.assert_allclose(points, TRUE, rtol=0.15)
    assert np.all(characteristic_points(record('D1', 20, 0)) > 0)


@pytest.mark.parametrize('method', METHODS)
def test_every_method_keeps_its_budget(method):
    (found,) = one(Task('R1', method, 3, 1))
    searches = method not in ('ls', 'best')
    assert found.simulations <= 1500 + (600 if 'polished' in method or 'wide' in method else 0) + (
        0 if searches else 2000
    )
    assert found.itae < 3.0
    if method.endswith('polished') or method in ('best', 'wide', 'wide_pso'):
        assert found.itae < 1e-6
        assert found.worst < 1e-3
    again = one(Task('R1', method, 3, 1))[0]
    assert again.errors == found.errors


def test_the_printed_bats_flee():
    """The velocity grows without end where the corrected ones settle."""
    spreads = []
    for made in (PrintedBats, OPTIMIZERS['ba']):
        bats = made(3, 30, 50, np.random.default_rng(0))
        for _ in range(49):
            points = bats.ask()
            bats.tell(np.sum((points - 0.2) ** 2, axis=1))
        spreads.append(float(np.mean(np.abs(bats.ask()) > 0.999)))
    assert spreads[0] > 0.3
    assert spreads[1] < 0.05


def test_what_is_printed_is_copied_right():
    assert OPEN['GWO'].mean == 0.108766
    assert CLOSED['PSO'].least == 0.003471
    assert all(p.least <= p.mean <= p.most for t in (OPEN, CLOSED) for p in t.values()
               if np.isfinite(p.least))  # fmt: skip
    worst = {n: np.max(np.abs(seen(np.array(e)) / seen(TRUE) - 1)) for n, e in ESTIMATES.items()}
    assert min(worst.values()) > 0.2


def test_the_motor_is_fitted_to_its_noise():
    found = motor.fitted(40, 0)
    assert found.worst < 2.0
    assert max(abs(s) for s in found.scores) < 4.0


@pytest.fixture(scope='module')
def results():
    studies = [('R1', m) for m in ('pso', 'gwo', 'pso_polished', 'best')]
    studies += [('D2@30', 'best'), ('D2@clean', 'best'), (ANYWHERE, 'best')]
    runs = [run for study, method in studies for run in one(Task(study, method, 0, 3))]
    hidden = motor.HiddenRun(0.05, 0, 0.0, 1, True, 0.0502, 1.01, 99.9)
    quiet = motor.HiddenRun(0.0, 1, 0.4, 0, False, 0.0, 1.0, 99.9)
    return Results(runs, [motor.fitted(30, 0)], [hidden, quiet])


def test_gates_pass_and_fail(results):
    found = {g.title: g for g in gates(results.runs, results.motors, results.hidden)}
    assert found['Noise-free, a plant of its own for each seed: recommended fit'].passed
    assert found['ITAE of every polished run and the recommended fit, R1'].passed
    assert found['Hidden Coulomb torque is flagged and among the first three'].passed
    assert found['No false flag without it'].passed
    (noise,) = (g for t, g in found.items() if 'D2 at 30 dB' in t and 'percentile' in t)
    assert noise.passed is (float(noise.measured.split()[0]) <= 2.1)
    bad = motor.HiddenRun(0.05, 0, 0.5, 7, False, 0.09, 3.0, 80.0)
    failed = [g.passed for g in gates([], [], [bad])]
    assert failed == [False, False]
    assert 1.0 < efficient_p95('D2', 30) < 3.0
    assert noise.few
    assert [g.few for g in gates([], results.motors * 10, [])] == [False, False]


def test_the_report_shows_everything(results):
    found = {t.title: t for t in tables(results)}
    assert next(iter(found)) == 'Gates'
    assert {row[1].text for row in found['Gates'].rows} == {'pass', 'few runs'}
    reading = found[READINGS['R1'].title]
    (pso,) = (row for row in reading.rows if row[0].text.startswith('PSO (w 0.7, c 1.5)')
              and 'least' not in row[0].text)  # fmt: skip
    assert '0.1164 / 0.0417' in [cell.text for cell in pso]
    assert all(len(row) == len(t.head) for t in found.values() for row in t.rows)
    html = page(results)
    assert html.count('<svg') == 2
    assert 'Validation, as in Table 6' in html
    document = json.loads(json.dumps(as_dict(results)))
    assert document['schema'] == 'motor_sysid/paper_benchmark/1'
    assert len(document['runs']) == 21


def test_the_plan_covers_what_is_asked():
    tasks = plan(30)
    assert len({describe(t) for t in tasks}) == len(tasks) - 23
    assert sum(isinstance(t, Task) for t in tasks) > 200
    quick = plan(3, quick=True)
    assert len(quick) < 70
    assert work(next(t for t in quick if isinstance(t, Task) and t.method == 'ls'))


def test_options_of_the_other_benchmark_are_refused(capsys):
    assert main(['benchmark', 'paper', '--seed', '3']) == 2
    assert '--seed is for `benchmark diagnosis`' in capsys.readouterr().err


def test_runs_survive_the_file(tmp_path, results):
    path, kinds = tmp_path / 'runs.jsonl', (results.runs[:2], results.motors, results.hidden)
    done = [Done(f'task {k}', tuple(runs)) for k, runs in enumerate(kinds)]
    with PaperFile(path) as file:
        for each in done:
            file.add(each)
    assert list(PaperFile.read(path)[1].values()) == done
    with pytest.raises(UserError, match=r'runs\.jsonl is no results file'):
        ResultsFile(path, 0)


def test_a_stopped_benchmark_runs_only_what_is_left(tmp_path, monkeypatch):
    asked, told = [], []
    tasks = [Task('R1', method, 0, 1) for method in ('ls', 'best', 'pso')]

    def each(left, do, **options):
        for task in left:
            if len(asked) == 2:
                asked.append('interrupted')
                raise KeyboardInterrupt
            asked.append(task.method)
            yield task, workers.Lost('its process died', 1.0) if asked == ['ls'] else do(task)

    monkeypatch.setattr(workers, 'each', each)
    path = tmp_path / 'paper.jsonl'
    with pytest.raises(KeyboardInterrupt), PaperFile(path) as file:
        run(tasks, file)
    with PaperFile(path) as file:
        found = run(tasks, file, progress=lambda *said: told.append(said))
    assert asked == ['ls', 'best', 'interrupted', 'ls', 'pso']
    assert told == [('R1: ls', 2, 3), ('R1: pso', 3, 3)]
    assert sorted(r.method for r in found.runs) == ['best', 'ls', 'pso']


def test_a_task_that_is_lost_costs_no_other(tmp_path, monkeypatch):
    def each(left, do, **options):
        for k, task in enumerate(left):
            yield task, do(task) if k else workers.Lost('stopped after 900 s', 900.0)

    monkeypatch.setattr(workers, 'each', each)
    tasks = [Task('R1', method, 0, 1) for method in ('ls', 'best')]
    with PaperFile(tmp_path / 'paper.jsonl') as file:
        with pytest.raises(UserError, match=r'1 of 2 tasks .* \(R1: ls: stopped after 900 s\)'):
            run(tasks, file)
        assert list(file.results) == ['R1/best/0/1']


@pytest.mark.slow
def test_the_command_line_runs_it(tmp_path):
    said = tmp_path / 'said.json'
    options = ['--quick', '--runs', '1', '--workers', '2', '--json', str(said)]
    assert main(['benchmark', 'paper', *options, '--page', str(tmp_path / 'page.html')]) == 0
    assert json.loads(said.read_text())['gates']
    assert (tmp_path / 'page.html').read_text().startswith('<!doctype html>')


def test_no_hidden_torque_is_no_reason_to_add_one():
    """An effect that a fit has no use for leaves no parameter behind; that is no fault."""
    said = motor.hidden(0.0, 5)
    assert not said.flagged
    assert said.found < 0.01
    assert 0.9 < said.chi2 < 1.1
