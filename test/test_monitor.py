"""Condition monitoring: alarms at the stated rate, changes found at their size, causes named.

Motors come from the benchmark's simulator, which shares no equation with the package.  Seeds are
fixed; limits of counts are those that a binomial law exceeds once in a thousand.
"""

from functools import cache
import json
from pathlib import Path
import re
import shlex

import numpy as np
import pytest
from scipy.stats import binom
from sister_motors import model_of, recorded, steps, TYPE

from motor_sysid.cli import main
from motor_sysid.diagnosis.condition import conditions, Watch
from motor_sysid.diagnosis.condition.causes import CAUSES, role_of
from motor_sysid.diagnosis.condition.days import has_brushes, in_words
from motor_sysid.diagnosis.condition.drift import alarms, Drift, drift_of_estimates
from motor_sysid.diagnosis.condition.likely import likely
from motor_sysid.estimation.batch import fit, make_chain, Problem
from motor_sysid.physics.model import Model
from motor_sysid.physics.store import save_model
from motor_sysid.recording.save import write_record

PAGE = (Path(__file__).parents[1] / 'docs/monitoring.md').read_text(encoding='utf-8')
WARM, WORN, HOT = 'a warmer winding', 'worn brushes or a bad contact', 'a motor that is warm'
BEARING = 'a bearing that wears'


def day(seed, seconds=2.0, gain=1.0, **factors):
    """Return a record of the type with some parameters multiplied; `gain` is the current's."""
    rng = np.random.default_rng(seed)
    values = {name: v * factors.get(name.split('.')[-1], 1.0) for name, v in TYPE.items()}
    return recorded(values, steps(seconds, rng), rng, gain)


def fitted(record):
    start = model_of(TYPE)
    outputs = ('current', 'speed')
    return fit(Problem(start, [make_chain(record, start.kind, outputs)], outputs)).model


@cache
def reference():
    return fitted(day(1, 4.0))


def told(record, scatter=0.005):
    (found,) = conditions(reference(), [[record]], scatter=scatter)
    return {p.name: k in found.moved for k, p in enumerate(found.drift.parameters)}, found


@pytest.mark.parametrize('runs', [25, pytest.param(200, marks=pytest.mark.slow)])
def test_a_motor_that_stays_the_same_raises_alarms_as_often_as_stated(runs):
    """Without scatter, so that nothing but the standard errors keeps the rate."""
    alpha, false = 0.1, 0
    for k in range(runs):
        good = fitted(day(1000 + k, 1.0))
        false += bool(conditions(good, [[day(5000 + k, 1.0)]], alpha=alpha, scatter=0.0)[0].moved)
    assert false <= binom.ppf(0.999, runs, alpha)


@pytest.mark.parametrize(
    ('change', 'parameters', 'causes'),
    [
        ({'R': 1.1}, ['R'], [WARM, WORN, HOT]),
        ({'R': 1.157, 'k_t': 0.96}, ['R', 'k_t'], [HOT]),
        ({'k_t': 0.93}, ['k_t'], ['magnets that are hot or demagnetised']),
        ({'tau_c': 1.15}, ['coulomb_friction.tau_c'], [BEARING]),
        ({'b': 1.5, 'tau_c': 1.1}, ['b', 'coulomb_friction.tau_c'], [BEARING]),
        ({'J': 1.1}, ['J'], ['a larger load inertia']),
        ({'J': 0.9}, ['J'], ['a smaller load inertia']),
        ({'R': 0.9, 'k_t': 0.9, 'L': 0.81}, ['R', 'L', 'k_t'], ['turns that are shorted']),
    ],
)
def test_a_change_is_found_and_its_causes_are_named_and_no_others(change, parameters, causes):
    moved, found = told(day(2, **change))
    assert [name for name, is_moved in moved.items() if is_moved] == parameters
    words = [one.words for one in found.causes]
    assert len(words) == len(causes)
    assert all(any(word.startswith(cause) for word in words) for cause in causes)
    assert ('cannot tell which' in found.words) == (len(causes) > 1)


@pytest.mark.parametrize(
    ('signals', 'factor', 'cause'),
    [
        (('current',), 1.08, 'a current sensor that reads too much'),
        (('current',), 0.92, 'a current sensor that reads too little'),
        (('speed', 'position'), 1.08, 'a speed that reads too much'),
        (('speed', 'position'), 0.92, 'a speed that reads too little'),
        (('voltage',), 1.08, 'a supply that is lower'),
        (('voltage',), 0.92, 'a supply that is higher'),
    ],
)
def test_a_wrong_scale_moves_parameters_as_the_table_says(signals, factor, cause):
    record = day(3)
    for name in signals:
        record = record.with_signal(name, factor * record[name], record.units[name])
    (one,) = told(record)[1].causes
    assert one.words.startswith(cause)


def test_heat_is_told_in_kelvin_and_two_causes_at_once_as_two():
    words = told(day(4, R=1.0 + 30 * 0.00393))[1].words
    assert re.search(r'\+(29|30|31) ± \d K if it is of copper', words)
    both = told(day(4, R=1.1, tau_c=1.5))[1].causes
    assert both
    assert all(len(one.causes) == 2 and BEARING in one.words for one in both)


@pytest.mark.parametrize(
    ('kind', 'brushes'),
    [('brushed_dc', True), ('pmsm', False), ('pmsm_q', False), ('bldc', False)],
)
def test_only_motors_with_brushes_have_worn_ones(kind, brushes):
    model = Model.base(kind)
    assert has_brushes(model) is brushes
    drift = drift_of_estimates(model, {'R': (1.3 * model['R'], 0.01, 'ohm', True)})
    words = [one.words for one in likely(drift, brushes)]
    assert (WORN in words) is brushes
    assert ('a bad contact or a longer cable' in words) is not brushes


def test_a_cause_has_its_part_in_the_change():
    """A small change leaves little beside chance, whatever is said to have made it.

    Only `b` has moved, by 3.6 of its deviations; the rest is chance.
    """
    model = Model.base('brushed_dc')
    off = {'R': 0.3, 'L': -0.8, 'k_t': 0.1, 'J': 0.4, 'b': 3.6}
    drift = drift_of_estimates(
        model, {n: (model[n] * np.exp(0.02 * z), 0.0, '1', True) for n, z in off.items()}
    )
    assert alarms([drift], 0.01) == [[4]]
    words = [one.words for one in likely(drift, True)]
    assert [w.split(',')[0] for w in words] == [BEARING, 'a speed that reads too little']


def test_what_nothing_explains_is_said_to_be_so():
    moved, found = told(day(5, R=1.2, L=0.8, J=1.3, b=0.5))
    assert moved['R']
    assert moved['J']
    assert found.causes == ()
    assert 'no cause of the table explains this' in found.words


def test_days_share_one_false_alarm_rate():
    rng, alpha, runs = np.random.default_rng(0), 0.05, 400
    parameters = reference().parameters.free[:5]
    sigma = np.full(5, 0.03)
    false = 0
    for _ in range(runs):
        days = [
            Drift(parameters, np.ones(5), sigma * rng.standard_normal(5), np.diag(sigma**2))
            for _ in range(6)
        ]
        false += any(alarms(days, alpha))
    assert 0.2 * alpha * runs < false <= binom.ppf(0.999, runs, alpha)


def test_an_unchanged_motor_may_be_watched_for_ever():
    """Independent estimates, 150 looks: the rate of a watch that ever alarms is the one stated."""
    rng, alpha, runs, false = np.random.default_rng(1), 0.2, 40, 0
    good = model_of(TYPE)
    for _ in range(runs):
        watch = Watch(good, alpha, scatter=0.0)
        for _ in range(150):
            noise = 0.02 * rng.standard_normal(2)
            estimates = {
                name: (TYPE[name] * np.exp(e), 0.02 * TYPE[name], '', True)
                for name, e in zip(('R', 'k_t'), noise, strict=True)
            }
            if watch.look(estimates).moved:
                false += 1
                break
    assert false <= binom.ppf(0.999, runs, alpha)
    worse = {'R': (1.5 * TYPE['R'], 0.02 * TYPE['R'], 'ohm', True)}
    assert WARM in watch.look(worse).words
    for nothing in ((9.0, 0.1, 'ohm', False), (9.0, np.inf, 'ohm', True)):
        assert not watch.look({'R': nothing}).moved


@pytest.mark.parametrize('cause', CAUSES, ids=lambda c: c.words)
def test_the_table_speaks_of_roles_that_parameters_have(cause):
    models = [Model.base(key) for key in ('brushed_dc', 'pmsm', 'bldc')]
    models[0] = models[0].with_effect('coulomb_friction').with_effect('constant_load_torque')
    known = {role_of(p) for model in models for p in model.parameters} - {''}
    assert cause.words
    assert cause.check
    for direction in cause.directions:
        assert set(direction) <= known
        assert any(direction.values())


def test_the_example_of_the_page_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    save_model(reference(), 'good.yaml')
    for name, factor in (('monday', 1.0), ('friday', 1.12)):
        write_record(day(6, R=factor), Path(f'{name}.csv'))
    (command,) = re.findall(r'^motor-sysid (monitor .*)$', PAGE, re.MULTILINE)
    assert main([*shlex.split(command), '--json', 'found.json']) == 0
    said = capsys.readouterr().out
    assert 'monday.csv: no parameter has moved beyond chance' in said
    assert re.search(r'friday\.csv: R \+1[12].*warmer winding', said)
    assert 'to tell: record again when it has cooled' in said
    days = json.loads(Path('found.json').read_text())['days']
    assert [one['alarm'] for one in days] == [False, True]
    assert days[1]['parameters']['R']['change_percent'] == pytest.approx(12, abs=1)
    assert main(['monitor', 'good.yaml', 'monday.csv', '--alpha', '2']) == 2
    save_model(model_of(TYPE), 'guess.yaml')
    assert main(['monitor', 'guess.yaml', 'monday.csv']) == 0
    assert 'the reference has no sigmas' in capsys.readouterr().out


def test_nothing_watched_is_no_all_clear():
    nothing = Drift((), np.empty(0), np.empty(0), np.empty((0, 0)))
    assert in_words(nothing, [], ()).startswith('nothing could be compared')
