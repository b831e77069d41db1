"""Transfer: a sister motor's model makes up for a record that is short or tells little.

Motors come from the benchmark's simulator, which shares no equation with the package.  Seeds are
fixed; limits of counts are those that a binomial law exceeds once in a thousand.
"""

import json
from pathlib import Path
import re
import shlex

import numpy as np
import pytest
from scipy.stats import binom
from sister_motors import lazy, model_of, recorded, sister, steps, TYPE

from motor_sysid.cli import main
from motor_sysid.diagnosis.where.compare import compare
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import believed, fit, make_chain, Prior, Problem, transfer
from motor_sysid.estimation.batch.sisters import of_the_motor
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motors
from motor_sysid.physics.store import load_model, save_model
from motor_sysid.recording.save import write_record

SPREAD, OUTPUTS = 0.12, ('current', 'speed')
PAGE = (Path(__file__).parents[1] / 'docs/transfer.md').read_text(encoding='utf-8')


def problem(model, record, prior=None):
    return Problem(model, [make_chain(record, model.kind, OUTPUTS)], OUTPUTS, prior=prior)


def drawn(seed, spread=SPREAD):
    """Return a prior from one sister, and the true values of another motor of the type."""
    rng = np.random.default_rng(seed)
    model, prior = believed([model_of(sister(rng, spread))], spread)
    return model, prior, sister(rng, spread), rng


def held_out_error(model, record):
    return compare(model, [make_chain(record, model.kind, OUTPUTS)], OUTPUTS).error_percent


@pytest.mark.parametrize(('drive', 'least'), [(lazy, 0.8), (steps, -0.02)])
def test_a_second_of_data_predicts_better_with_a_sister(drive, least):
    """Alone, a record that tells little is fitted by a motor that it is not."""
    gains = []
    for seed in range(5):
        model, prior, truth, rng = drawn(seed)
        record = recorded(truth, drive(1.0, rng), rng)
        other = recorded(truth, steps(3.0, rng), rng)
        alone = held_out_error(fit(problem(model, record)).model, other)
        found = transfer(problem(model, record, prior))
        gains.append(1 - held_out_error(found.result.model, other) / alone)
    assert sum(gain > -0.03 for gain in gains) >= 4
    assert np.median(gains) > least


def test_errors_are_as_large_as_their_sigmas_and_data_take_over():
    """RMS of error over sigma over 24 motors and six parameters; shares go where the data are."""
    ratios, shares = [], {name: [] for name in TYPE}
    for seed in range(24):
        model, prior, truth, rng = drawn(100 + seed)
        found = transfer(problem(model, recorded(truth, lazy(1.0, rng), rng), prior))
        for one in found.shares:
            if one.name in TYPE:
                ratios.append((one.value - truth[one.name]) / one.sigma)
                shares[one.name].append(one.data)
        assert [s.data for s in found.shares if s.name == 'current_offset'] == [1.0]
    assert 0.8 < np.sqrt(np.mean(np.square(ratios))) < 1.25
    assert np.median(shares['k_t']) > 0.9
    assert np.median(shares['coulomb_friction.tau_c']) < 0.2


@pytest.mark.parametrize(
    ('runs', 'drive'),
    [(30, steps), pytest.param(200, steps, marks=pytest.mark.slow),
     pytest.param(80, lazy, marks=pytest.mark.slow)],
)  # fmt: skip
def test_a_motor_that_obeys_the_prior_contradicts_it_as_often_as_stated(runs, drive):
    alpha, false = 0.05, 0
    for seed in range(runs):
        model, prior, truth, rng = drawn(200 + seed)
        record = recorded(truth, drive(1.0, rng), rng)
        false += bool(transfer(problem(model, record, prior), alpha).contradicted)
    assert false <= binom.ppf(0.999, runs, alpha)


@pytest.mark.parametrize(('name', 'factor'), [('R', 2.5), ('k_t', 0.4), ('J', 4.0)])
def test_a_motor_of_another_type_is_noticed_and_the_parameter_named(name, factor):
    for seed in range(3):
        model, prior, truth, rng = drawn(300 + seed, 0.08)
        other = {**truth, name: factor * truth[name]}
        found = transfer(problem(model, recorded(other, steps(1.0, rng), rng), prior))
        assert name in found.contradicted
        assert found.p_value < 0.01
        assert any('contradict' in text for text in found.result.warnings)


def test_without_information_the_prior_stays_and_with_much_it_goes():
    model, prior, truth, rng = drawn(7)
    still = recorded(truth, np.zeros(1000), rng)
    found = transfer(problem(model, still, prior))
    for one in found.shares:
        if one.name in ('k_t', 'J', 'b'):
            assert one.value == pytest.approx(one.prior, rel=0.02)
            assert one.data < 0.1
    long = recorded(truth, steps(10.0, rng), rng)
    weighed, alone = transfer(problem(model, long, prior)).result, fit(problem(model, long))
    for name in TYPE:
        sigma = alone.model.parameters[name].sigma
        assert abs(weighed.model[name] - alone.model[name]) < 0.5 * sigma + 1e-3 * TYPE[name]


def test_a_fleet_tells_its_mean_and_spread():
    rng = np.random.default_rng(5)
    fleet = [model_of(sister(rng, 0.3)) for _ in range(40)]
    model, prior = believed(fleet, 0.05)
    sigma = dict(zip(prior.names, np.sqrt(1 / np.diag(prior.precision)), strict=True))
    assert sigma['R'] == pytest.approx(0.3, rel=0.3)
    assert model['R'] == pytest.approx(np.exp(np.mean(np.log([m['R'] for m in fleet]))))
    single, alone = believed(fleet[:1], 0.05, {'b': 0.5})
    assert single['R'] == pytest.approx(fleet[0]['R'])
    width = dict(zip(alone.names, np.sqrt(1 / np.diag(alone.precision)), strict=True))
    assert width['R'] == pytest.approx(np.sqrt(2) * 0.05)
    assert width['b'] == pytest.approx(np.sqrt(2) * 0.5)
    assert 'current_offset' not in alone.names


def test_what_a_sister_did_not_see_has_no_prior_and_her_sigma_counts():
    seen = model_of(TYPE).with_estimates({}, {'R': 0.21, 'L': np.inf})
    _, prior = believed([seen], 0.05)
    assert 'L' not in prior.names
    variance = 1 / prior.precision[prior.names.index('R'), prior.names.index('R')]
    assert variance == pytest.approx(2 * 0.05**2 + 0.1**2)


@pytest.mark.parametrize('kind', motors())
def test_offsets_of_sensors_are_no_property_of_a_motor(kind):
    model = Model.base(kind)
    for key in ('current_sensor_offset', 'coulomb_friction'):
        model = model.with_effect(key) if model.admits(effect(key)) else model
    names = {p.name for p in of_the_motor(model)}
    assert names
    assert not any('offset' in name or 'error' in name for name in names)
    assert 'coulomb_friction.tau_c' in names


def test_a_prior_is_placed_among_the_free_parameters_only():
    prior = Prior(('b', 'R', 'gone'), np.array([1.0, 2.0, 3.0]), np.diag([4.0, 5.0, 6.0]))
    free = model_of(TYPE).parameters.free
    mean, precision = prior.placed(free, np.full(len(free), 2.0))
    names = [p.name for p in free]
    assert mean[names.index('b')] == 0.5
    assert precision[names.index('b'), names.index('b')] == 16.0
    assert precision[names.index('R'), names.index('R')] == 20.0
    assert np.count_nonzero(precision) == 2


def test_strangers_and_senseless_spreads_are_refused():
    with pytest.raises(UserError, match='same effects'):
        believed([model_of(TYPE), Model.base('brushed_dc')])
    with pytest.raises(UserError, match=r'give 0\.1'):
        believed([model_of(TYPE)], 30.0)
    with pytest.raises(UserError, match='no parameter `nu`'):
        believed([model_of(TYPE)], spreads={'nu': 0.1})
    with pytest.raises(UserError, match='at least one'):
        believed([])


def test_the_example_of_the_page_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    for name in ('sister1.yaml', 'sister2.yaml'):
        save_model(model_of(sister(rng, 0.1)), name)
    truth = sister(rng, 0.1)
    write_record(recorded(truth, steps(1.3, rng), rng), Path('short.csv'))
    (command,) = re.findall(r'^motor-sysid (fit short.*)$', PAGE, re.MULTILINE)
    assert main([*shlex.split(command), '--json', 'fit.json']) == 0
    said = capsys.readouterr().out
    assert 'data and prior agree' in said
    assert load_model('new.yaml')['k_t'] == pytest.approx(truth['k_t'], rel=0.02)
    assert load_model('new.yaml').provenance['prior'] == 'sister1.yaml, sister2.yaml'
    told = json.loads(Path('fit.json').read_text())['prior']
    assert told['contradicted'] == []
    assert 0 <= told['shares']['b']['data_share'] <= 1
    assert main(['fit', 'short.csv', '--prior', 'sister1.yaml', '--motor', 'pmsm']) == 2
    assert main(['fit', 'short.csv', '--spread', '0.2']) == 2
    twice = ['--prior', 'sister1.yaml', '--prior', './sister1.yaml']
    assert main(['fit', 'short.csv', *twice]) == 2
    assert '--prior names one file twice' in capsys.readouterr().err
