"""What the integration does wrong counts for no effect, and finer steps are followed cheaply."""

from dataclasses import replace
from types import SimpleNamespace

from bench_motor import a_motor, measure, records, voltage_profile
import numpy as np
import pytest
from test_trials import prepared, refitted

from motor_sysid.benchmark.cases import draw
from motor_sysid.benchmark.scenarios import named_case
from motor_sysid.diagnosis import diagnose
from motor_sysid.diagnosis.search.gates import INEXACT
import motor_sysid.diagnosis.search.integration_steps as steps
from motor_sysid.diagnosis.search.integration_steps import _secant, asked_finer, refined
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.physics.model import SpeedSensor

FRICTION = {'coulomb_friction': {'tau_c': 6e-3}}


def test_evidence_must_exceed_what_the_integration_does_wrong():
    """All of the misfit may be the integration's; then nothing is evidence."""
    bench, rung = prepared(records(FRICTION, seconds=3.0), SpeedSensor.DIFFERENCE)
    assert refitted('coulomb_friction', bench, rung)[0].passes
    trial, _ = refitted('coulomb_friction', replace(bench, wrong=1.0), rung)
    assert trial.note == INEXACT


def test_steps_that_are_fine_enough_do_nothing_wrong():
    bench, rung = prepared(records(FRICTION, seconds=3.0), SpeedSensor.DIFFERENCE)
    friction = rung.model.with_effect('coulomb_friction', {'tau_c': 5e-3})
    assert refined(climb(friction, bench), bench)[1].wrong == 0.0


def test_what_coarse_steps_follow_badly_is_asked_again_in_finer_ones():
    bench, rung = prepared(records(FRICTION, seconds=3.0), SpeedSensor.DIFFERENCE)
    waves = rung.model.with_effect('cogging_torque', {'a_1': 0.05, 'b_1': 0.0, 'n': 96.0})
    smooth, bent = (SimpleNamespace(rung=SimpleNamespace(model=m)) for m in (rung.model, waves))
    assert asked_finer(rung, [], bench) == (rung, bench)
    assert asked_finer(rung, [smooth], bench) == (rung, bench)
    finer, asked = asked_finer(rung, [smooth, bent], bench)
    assert finer.substeps == asked.substeps > bench.substeps
    assert finer.model.effects == rung.model.effects


@pytest.mark.parametrize(('waves', 'finer'), [(2.0, False), (400.0, True)])
def test_a_wave_that_coarse_steps_see_little_of_is_asked_again_in_finer_ones(waves, finer):
    """However small it seems: long steps average it out."""
    bench, rung = prepared(records(FRICTION, seconds=3.0), SpeedSensor.DIFFERENCE)
    small = rung.model.with_effect('torque_ripple', {'a': 1e-6, 'b': 0.0, 'n': waves})
    trial = SimpleNamespace(rung=SimpleNamespace(model=small))
    found, asked = asked_finer(rung, [trial], bench)
    assert (found.substeps, asked.substeps > bench.substeps) == (asked.substeps, finer)
    there = replace(rung, result=replace(rung.result, model=small))
    assert asked_finer(there, [trial], bench) == (there, bench)
    if finer:
        radians = waves * bench.scales.speed * bench.scales.sample / asked.substeps
        assert radians <= 2 * steps.QUICK or asked.substeps == steps.UTMOST


def test_many_waves_within_a_sample_are_followed():
    """Four of them pass in a sample at full speed, and nothing of the motor smooths them."""
    true = a_motor({'torque_ripple': {'a': 0.1, 'b': 0.0, 'n': 150.0}}).with_values({'L': 2e-5})
    rng = np.random.default_rng(1)
    data = [measure(true, voltage_profile('triangle', 3.0, rng), rng, substeps=256)]
    bench, rung = prepared(data, SpeedSensor.DIFFERENCE, L=2e-5)
    ripple = rung.model.with_effect('torque_ripple', {'a': 0.1, 'b': 0.0, 'n': 150.0})
    found, finer = refined(climb(ripple, bench), bench)
    assert finer.substeps == steps.UTMOST
    assert found.model['torque_ripple.a'] == pytest.approx(0.1, rel=0.1)


def test_steps_are_as_fine_as_faster_held_out_data_ask_for():
    """At a tenth of the speed a sample is short for 40 waves a turn; not at full speed."""
    true = a_motor({'torque_ripple': {'a': 0.1, 'b': 0.0, 'n': 40.0}}).with_values({'L': 2e-5})
    rng = np.random.default_rng(1)
    volts = voltage_profile('triangle', 3.0, rng)
    slow, fast = (measure(true, size * volts, rng, substeps=64) for size in (0.1, 1.0))
    bench, rung = prepared([slow], SpeedSensor.DIFFERENCE, [fast], L=2e-5)
    ripple = rung.model.with_effect('torque_ripple', {'a': 0.1, 'b': 0.0, 'n': 40.0})
    assert steps._fine_enough(ripple, replace(bench, held=()))[0] <= steps.FINER
    assert steps._fine_enough(ripple, bench)[0] > steps.FINER


@pytest.mark.slow
def test_a_ripple_faster_than_the_steps_is_no_delay():
    """45 waves a turn at 1 kHz, no position: half a sample of delay fits what is left of it."""
    scenario, number = named_case('single/torque_ripple/10/0')
    case = draw(scenario, 171, number)
    offered = ('torque_ripple', 'input_delay')
    found = diagnose(case.train, case.valid, motor='brushed_dc', effects=offered)
    assert found.effects == ('torque_ripple',)


def test_finer_steps_are_followed_with_the_derivatives_of_the_coarser(monkeypatch):
    """The fit is where one from anew ends, within a tenth of a standard error, and settled."""
    bench, rung = prepared(records(FRICTION, seconds=3.0), SpeedSensor.DIFFERENCE)
    rung = climb(rung.model.with_effect('coulomb_friction', {'tau_c': 5e-3}), bench)
    rung = climb(steps._sharper(rung.model), bench)
    fine = replace(bench, substeps=8)
    sigma = np.array([p.sigma for p in rung.model.parameters.free])
    anew = climb(rung.model, fine, rung.result.weighting, briefly=True)
    monkeypatch.setattr(steps, 'climb', lambda *args, **kwargs: pytest.fail('was fitted anew'))
    found, unsettled = steps._followed(rung, fine, sigma)
    assert not np.any(unsettled)
    for p in found.model.parameters.free:
        assert p.value == pytest.approx(anew.model[p.name], abs=0.1 * p.sigma)
    assert found.result.cost == pytest.approx(anew.result.cost, rel=1e-3)


def test_a_last_step_that_spoils_the_fit_is_not_taken(monkeypatch):
    """It is not fitted again, and derivatives of what is not seen know nothing of large steps."""
    bench, rung = prepared(records(FRICTION, seconds=3.0), SpeedSensor.DIFFERENCE)
    rung = climb(rung.model.with_effect('coulomb_friction', {'tau_c': 5e-3}), bench)
    names = [p.name for p in rung.model.parameters.free]
    astray = np.where(np.array(names) == 'L', 10.0, 0.0)
    monkeypatch.setattr(steps, 'newton_step', lambda *_: astray)
    monkeypatch.setattr(steps, 'BRIEF', np.inf)
    found, unsettled = steps._followed(rung, bench, np.full(len(names), 1e-9))
    assert found.model['L'] == pytest.approx(rung.model['L'])
    assert found.held.error_percent == pytest.approx(rung.held.error_percent)
    assert unsettled[names.index('L')] > 0.0


def test_where_no_step_lowers_the_error_the_fit_says_so(monkeypatch):
    """It is as good as it gets then, and not out of steps."""
    bench, rung = prepared(records(FRICTION, seconds=3.0), SpeedSensor.DIFFERENCE)
    names = [p.name for p in rung.model.parameters.free]
    astray = np.where(np.array(names) == 'R', 1.0, 0.0)
    monkeypatch.setattr(steps, 'newton_step', lambda *_: astray)
    monkeypatch.setattr(steps, 'BRIEF', -np.inf)
    found, _ = steps._followed(rung, bench, np.full(len(names), 1e-9))
    assert found.model['R'] == pytest.approx(rung.model['R'])
    assert found.result.success
    told = f'after {steps.CHORDS + 1} steps no step lowers the error any more'
    assert found.result.reason == told


def test_where_known_derivatives_lead_nowhere_new_ones_are_taken():
    """Derivatives of half the size lead twice as far as they should, to and fro."""
    bench, rung = prepared(records(FRICTION, seconds=3.0), SpeedSensor.DIFFERENCE)
    rung = climb(rung.model.with_effect('coulomb_friction', {'tau_c': 5e-3}), bench)
    wrong = [replace(one, slope=0.5 * one.slope) for one in rung.near]
    astray = rung.model.with_values({'R': 1.01 * rung.model['R']})
    begun = replace(rung, result=replace(rung.result, model=astray), near=tuple(wrong))
    sigma = np.array([p.sigma for p in rung.model.parameters.free])
    found, unsettled = steps._followed(begun, bench, sigma)
    assert not np.any(unsettled)
    for p in rung.model.parameters.free:
        assert found.model[p.name] == pytest.approx(p.value, abs=0.5 * p.sigma)


@pytest.mark.parametrize(('errors', 'taken'), [((0.4, 0.3, 0.3), 1), ((0.4, 0.3, 0.1), 4)])
def test_finer_steps_that_come_no_nearer_are_not_taken(errors, taken, monkeypatch):
    """A law that chatters is as wrong in any steps; one that does not gets the finest allowed."""
    bench, rung = prepared(records(FRICTION, seconds=3.0), SpeedSensor.DIFFERENCE)
    model = rung.model.with_effect('coulomb_friction', {'tau_c': 5e-3})
    of = dict(zip((1, 2, 4), errors, strict=True))

    def residuals(model, bench, number=0):
        error = of.get(number or bench.substeps, 0.0)
        return [np.array([[1.0 + error], [1.0 - error]])]

    monkeypatch.setattr(steps, '_residuals', residuals)
    found, right = steps._steps(model, bench, 4, steps._small)
    assert found == taken
    assert not right


def test_a_step_teaches_the_curvature_along_it():
    """Two steps along the axes of a bowl tell it; a gradient that rises says nothing."""
    bowl, known = np.diag([4.0, 0.5]), np.eye(2)
    for step in np.eye(2):
        known = _secant(known, step, bowl @ step)
        assert known @ step == pytest.approx(bowl @ step)
    assert known == pytest.approx(bowl)
    assert _secant(known, np.array([1.0, 0.0]), np.array([-1.0, 0.0])) is known


def test_a_model_is_run_once_in_the_finest_steps_and_a_few_runs_are_kept(monkeypatch):
    ran = []

    def compare(model, chains, outputs, *, substeps):
        ran.append((model.parameters.values()['R'], chains, substeps))
        return SimpleNamespace(residuals=[np.full((2, 1), len(ran))])

    def model(value):
        return SimpleNamespace(
            speed_sensor='ideal', parameters=SimpleNamespace(values=lambda: {'R': value})
        )

    monkeypatch.setattr(steps, 'compare', compare)
    bench = SimpleNamespace(train=('a',), outputs=('current',), substeps=1, runs={})
    other = SimpleNamespace(**{**vars(bench), 'train': ('b',)})
    first = steps._residuals(model(1.0), bench, steps.FINEST)
    assert steps._residuals(model(1.0), bench, steps.FINEST) is first
    for value, where, count in ((2.0, bench, steps.FINEST), (1.0, other, steps.FINEST),
                                (1.0, bench, 2 * steps.FINEST), (1.0, bench, 1)):  # fmt: skip
        assert steps._residuals(model(value), where, count) is not first
    assert len(ran) == 5
    for value in range(2 * steps.KEPT_RUNS):
        steps._residuals(model(float(value)), bench, steps.FINEST)
    assert len(bench.runs) == steps.KEPT_RUNS
