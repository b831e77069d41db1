"""The benchmark of the online estimators: its records, its scores and its tables."""

import json
import math

import numpy as np
import pytest

from motor_sysid.benchmark.estimator_tables import estimator_tables, page
from motor_sysid.benchmark.estimators import as_dict, compare_estimators, Score
from motor_sysid.benchmark.perturbations import PERTURBATIONS, perturbed_run
from motor_sysid.cli import main
from motor_sysid.physics.effects import catalogue

SECONDS = 1.5


@pytest.mark.parametrize('one', PERTURBATIONS, ids=lambda p: p.code)
def test_every_perturbation_changes_the_record(one):
    run, same = (perturbed_run(one, 0, SECONDS, 1) for _ in range(2))
    assert all(np.array_equal(run.record[name], same.record[name]) for name in run.record)
    assert set(one.effects) <= set(catalogue())
    assert np.abs(run.record['speed']).max() > 0.1 * run.sheet.top_speed
    plain = perturbed_run(PERTURBATIONS[0], 0, SECONDS, 1)
    assert one.code == 'P0' or not np.array_equal(run.record['current'], plain.record['current'])


def test_the_truth_is_that_of_the_moment():
    runs = {one.code: perturbed_run(one, 0, SECONDS, 0) for one in PERTURBATIONS}
    inertia, load = runs['P10a'].true['J'], runs['P2'].true['constant_load_torque.tau_l']
    assert inertia[-1] == pytest.approx(1.5 * inertia[0])
    assert abs(load[-1]) == pytest.approx(0.3 * runs['P2'].sheet.torque)
    heat = runs['P9'].true['R']
    assert 1.1 < heat.max() / heat[0] < 1.5
    for name, values in runs['P0'].true.items():
        assert np.ptp(values) == 0, name


@pytest.fixture(scope='module')
def scores():
    codes = [one for one in PERTURBATIONS if one.code in ('P0', 'P10a')]
    return compare_estimators(codes, 1, SECONDS, keys=('rls', 'mras', 'sliding_mode'))


def test_scores_tell_what_was_found_from_what_was_not(scores):
    """A long memory does not follow an inertia that steps."""
    found = {(one.estimator, one.perturbation): one for one in scores}
    assert len(found) == len(scores) == 6
    for key in ('rls', 'mras'):
        assert found[key, 'P0'].error < 0.03
        assert found[key, 'P0'].settled < 1.5
    poor = found['rls', 'P10a']
    assert poor.error > max(0.03, 5 * found['rls', 'P0'].error)
    assert math.isinf(poor.settled)
    assert found['rls', 'P0'].relative_cost == 1.0
    assert 0.3 < found['mras', 'P0'].relative_cost < 3
    load = found['sliding_mode', 'P0']
    assert math.isnan(load.error)
    assert load.load_error < 0.05


def test_tables_and_json_hold_every_score(scores):
    errors, settling, costs = estimator_tables(scores)
    assert errors.head == ('estimator', 'P0', 'P10a')
    assert [row[0].text for row in errors.rows] == ['rls', 'mras']
    assert settling.rows[0][2].text == '-'
    assert [row[0].text for row in costs.rows] == ['rls', 'mras', 'sliding_mode']
    html = page(scores)
    assert html.startswith('<!doctype html>')
    assert 'P0 none · P10a discontinuity: inertia steps by 50 %' in html
    assert html.count('<table') == 3
    saved = json.loads(json.dumps(as_dict(scores), allow_nan=False))
    assert [row['estimator'] for row in saved['scores']] == [one.estimator for one in scores]


def test_a_median_counts_what_never_settles_as_late():
    one = Score('rls', 'P0', 0, 0.01, 0.0, 1.0, 1.0, 1e-4, 1.0)
    never = Score('rls', 'P0', 1, 0.5, 0.0, math.inf, 1.0, 1e-4, 1.0)
    assert estimator_tables([one, one, never])[1].rows[0][1].text == '1.0'
    assert estimator_tables([one, never])[1].rows[0][1].text == '-'


def test_options_of_the_diagnosis_are_refused(capsys):
    assert main(['benchmark', 'estimators', '--no-peers']) == 2
    assert '--no-peers is no option' in capsys.readouterr().err
