"""How an effect is refitted: from where, with which sensor, what is asked of the last fit."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from bench_motor import a_motor, measure, MOTOR, records
import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose
from motor_sysid.diagnosis.search import refit
from motor_sysid.diagnosis.search.bench import (
    Bench,
    FEW_ROWS,
    make_bench,
    ROUGH_ROWS,
    with_scales,
)
from motor_sysid.diagnosis.search.gates import NO_EVIDENCE
from motor_sysid.diagnosis.search.integration_steps import exact
from motor_sysid.diagnosis.search.moments import with_honest_moments
from motor_sysid.diagnosis.search.refit import (
    leads_lower,
    of_a_kind,
    try_beside,
    try_effect,
    try_thoroughly,
)
from motor_sysid.diagnosis.search.rounds import scored
from motor_sysid.diagnosis.search.rung import climb, lost, Rung
from motor_sysid.diagnosis.search.starts import best_per_effect
from motor_sysid.diagnosis.search.trial import Level, searching, Trial
from motor_sysid.estimation.batch import (
    fit,
    Linearization,
    make_chain,
    observed_outputs,
    Problem,
    Weighting,
)
from motor_sysid.estimation.batch.information import Information
from motor_sysid.estimation.batch.uncertainty import describe
from motor_sysid.physics.effects import add_effect_file, catalogue, effect
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.signals.record import Record

START = {**MOTOR, 'omega_eps': 0.4, 'i_eps': 1e-2}


def prepared(
    data: list[Record], sensor: SpeedSensor, held: Sequence[Record] = (), **values: float
) -> tuple[Bench, Rung]:
    """Return the data with the linear motor, fitted with that speed sensor."""
    bench = make_bench(data, held, motor('brushed_dc'))
    model = Model.base('brushed_dc', {**START, **values}, speed_sensor=sensor)
    bench = with_scales(bench, model)
    return bench, climb(model, bench)


def refitted(key: str, bench: Bench, rung: Rung) -> tuple[Trial, Level]:
    """Return the trial of an effect, and what it was compared with."""
    scores = scored(rung, bench, [effect(key)], lambda text: None)
    level = Level.of(rung, bench, scores.weighting)
    return try_effect(best_per_effect(scores.singles, 1)[0], level, bench), level


# --- from where a refit begins


@pytest.mark.parametrize('wrong', [SpeedSensor.IDEAL, SpeedSensor.DIFFERENCE])
def test_a_refit_finds_the_speed_sensor_that_the_records_do_not_tell(wrong):
    data = records({'coulomb_friction': {'tau_c': 6e-3}}, kinds=('steps', 'triangle'), seconds=3.0)
    bench, rung = prepared([r.select(['voltage', 'current', 'speed']) for r in data], wrong)
    assert set(bench.sensors) == {SpeedSensor.IDEAL, SpeedSensor.DIFFERENCE}
    found, _ = refitted('coulomb_friction', bench, rung)
    assert found.rung.model.speed_sensor is SpeedSensor.DIFFERENCE
    told, _ = refitted('coulomb_friction', replace(bench, sensors=(wrong,)), rung)
    assert told.rung.model.speed_sensor is wrong


@pytest.mark.parametrize(('right', 'wrong'), [(50.0, 40.0), (40.0, 50.0)])
def test_where_another_speed_sensor_fits_better_the_evidence_decides(monkeypatch, right, wrong):
    """Its errors are smaller as they are, and larger once a load that comes and goes is known."""
    data = records({'coulomb_friction': {'tau_c': 6e-3}}, kinds=('steps', 'triangle'), seconds=3.0)
    bench, rung = prepared([r.select(['voltage', 'current', 'speed']) for r in data],
                           SpeedSensor.DIFFERENCE)  # fmt: skip
    evidence = {SpeedSensor.DIFFERENCE: right, SpeedSensor.IDEAL: wrong}
    monkeypatch.setattr(
        refit, 'misfit', lambda fit: float(fit.model.speed_sensor is SpeedSensor.DIFFERENCE)
    )
    whole = refit.judged

    def judged(one, new, *rest):
        gain = evidence[new.model.speed_sensor]
        return replace(whole(one, new, *rest), delta_bic=gain, note='')

    monkeypatch.setattr(refit, 'judged', judged)
    scores = scored(rung, bench, [effect('coulomb_friction')], lambda text: None)
    level = Level.of(rung, bench, scores.weighting)
    found = refit.try_roughly(best_per_effect(scores.singles, 1)[0], level, bench)
    assert found.delta_bic == 50.0
    assert evidence[found.rung.model.speed_sensor] == 50.0


@pytest.mark.parametrize('above', [True, False])
def test_an_earlier_fit_of_the_same_effects_stays_where_nothing_does_better(monkeypatch, above):
    """Teeth that strike have a valley for every blow: the next fit may end in a worse one."""
    data = records({'coulomb_friction': {'tau_c': 6e-3}}, kinds=('steps', 'triangle'), seconds=3.0)
    bench, rung = prepared(data, SpeedSensor.DIFFERENCE)
    scores = scored(rung, bench, [effect('coulomb_friction')], lambda text: None)
    level = Level.of(rung, bench, scores.weighting)
    starts = best_per_effect(scores.singles, 1)[0]
    earlier = refit.try_roughly(starts, level, bench)
    assert earlier.passes
    elsewhere = replace(earlier, delta_bic=-600.0, note=NO_EVIDENCE)
    monkeypatch.setattr(refit, '_followed', lambda *fit: elsewhere)
    monkeypatch.setattr(refit, '_is_above', lambda *fit: above)
    found = refit.try_roughly(starts, level, bench, earlier.rung.result, give_up=True)
    assert found.passes
    assert found.delta_bic == pytest.approx(earlier.delta_bic, rel=0.01)
    assert not refit.try_roughly(starts, level, bench, give_up=True).passes


def test_an_earlier_fit_with_wider_boxes_is_begun_with_inside_of_these():
    """What was fitted beside other effects may have gone where this model has no room."""
    data = records({'coulomb_friction': {'tau_c': 6e-3}}, kinds=('steps', 'triangle'), seconds=3.0)
    bench, rung = prepared(data, SpeedSensor.DIFFERENCE)
    scores = scored(rung, bench, [effect('stribeck_friction')], lambda text: None)
    level = Level.of(rung, bench, scores.weighting)
    (starts,) = best_per_effect(scores.singles, 1)
    here = starts[0].variant.model.parameters['stribeck_friction.omega_s']
    far = {'tau_c': 6e-3, 'tau_s': 0.0, 'omega_s': 10 * here.upper}
    wide = replace(rung.result, model=rung.model.with_effect('stribeck_friction', far))
    found = refit.try_roughly(starts, level, bench, wide)
    assert here.lower <= found.rung.model['stribeck_friction.omega_s'] <= here.upper


def test_a_delay_begins_from_the_first_guess_of_the_motor_too(monkeypatch):
    """The inductance that made up for it hardly finds back."""
    data = records({'input_delay': {'delay': 3.4e-3}}, kinds=('steps',), seconds=3.0)
    bench, rung = prepared(data, SpeedSensor.DIFFERENCE)
    assert rung.model['L'] > 2 * MOTOR['L']
    begun = {**bench.begun, 'L': 1.1e-3, 'k_t': 0.0444}
    starts: list[Model] = []

    def spy(problem, *given, **named):
        starts.append(problem.model)
        return fit(problem, *given, **named)

    monkeypatch.setattr(refit, 'fit', spy)
    found, _ = refitted('input_delay', replace(bench, begun=begun), rung)
    anew = [m for m in starts if m['L'] == 1.1e-3 and m['k_t'] == 0.0444]
    assert anew
    assert all('input_delay' in m.effects for m in anew)
    assert found.rung.model['L'] == pytest.approx(MOTOR['L'], rel=0.02)


def test_every_delay_is_tried_beside_a_winding_that_makes_up_for_nothing(monkeypatch):
    data = records({'input_delay': {'delay': 3.4e-3}}, kinds=('steps',), seconds=3.0)
    bench, rung = prepared(data, SpeedSensor.DIFFERENCE)
    quick = refit.QUICK * rung.model['R'] * data[0].dt
    begun: list[tuple[float, float]] = []

    def spy(problem, *given, **named):
        begun.append((problem.model['input_delay.delay'], problem.model['L']))
        return fit(problem, *given, **named)

    monkeypatch.setattr(refit, 'fit', spy)
    variants = scored(rung, bench, [effect('input_delay')], lambda text: None)
    level = Level.of(rung, bench, variants.weighting)
    starts = best_per_effect(variants.singles, 1)[0]
    refit.try_roughly(starts, level, bench)
    delays = {one.variant.model['input_delay.delay'] for one in starts}
    assert len(delays) > 1
    assert {delay for delay, inductance in begun if inductance == quick} == delays
    begun.clear()
    refit.try_roughly(starts, replace(level, cost=float(level.rows)), bench)
    assert begun
    assert all(inductance != quick for _, inductance in begun)


@pytest.mark.parametrize(
    ('much', 'above', 'followed'),
    [(False, True, False), (True, True, True), (False, False, True)],
)
def test_what_begins_above_the_model_itself_is_given_up(monkeypatch, much, above, followed):
    """Not where much is left: parameters that are far astray take more steps to come back."""
    data = records({'coulomb_friction': {'tau_c': 6e-3}}, kinds=('steps', 'triangle'), seconds=3.0)
    bench, rung = prepared(data, SpeedSensor.DIFFERENCE)
    scores = scored(rung, bench, [effect('coulomb_friction')], lambda text: None)
    level = Level.of(rung, bench, scores.weighting)
    monkeypatch.setattr(refit, 'misfit', lambda fit: float(bool(fit.model.effects) is above))
    monkeypatch.setattr(refit, 'leaves_much', lambda rung, bench: much)
    starts = best_per_effect(scores.singles, 1)[0]
    found = refit.try_roughly(starts, level, bench, give_up=True)
    assert (found.rung is not rung) is followed
    assert (found.note == NO_EVIDENCE) is not followed
    assert refit.try_roughly(starts, level, bench).rung is not rung


def test_few_rows_tell_from_where_a_fit_begins(monkeypatch):
    rows: list[int] = []

    def spy(problem, *given, **named):
        rows.append(sum(len(stretch.judged) for stretch in problem.stretches))
        return fit(problem, *given, **named)

    data = records({'coulomb_friction': {'tau_c': 6e-3}}, kinds=('steps', 'triangle'), seconds=9.0)
    bench, rung = prepared(data, SpeedSensor.DIFFERENCE)
    scores = scored(rung, bench, [effect('coulomb_friction')], lambda text: None)
    level = Level.of(rung, bench, scores.weighting)
    monkeypatch.setattr(refit, 'fit', spy)
    refit.try_roughly(best_per_effect(scores.singles, 1)[0], level, bench)
    assert min(rows) < 1.5 * FEW_ROWS < max(rows) < 1.5 * ROUGH_ROWS


def test_what_remembers_for_long_is_held_against_the_model_on_the_same_data(monkeypatch):
    rows: dict[bool, set[int]] = {True: set(), False: set()}

    def spy(problem, *given, **named):
        count = sum(len(stretch.judged) for stretch in problem.stretches)
        rows[bool(problem.model.effects)].add(count)
        return fit(problem, *given, **named)

    data = records({}, kinds=('steps', 'triangle'), seconds=9.0)
    bench, rung = prepared(data, SpeedSensor.DIFFERENCE)
    scores = scored(rung, bench, [effect('armature_heating')], lambda text: None)
    level = Level.of(rung, bench, scores.weighting)
    monkeypatch.setattr(refit, 'fit', spy)
    refit.try_roughly(best_per_effect(scores.singles, 1)[0], level, bench, give_up=True)
    assert rows[False] == rows[True]
    assert min(rows[True]) > 1.5 * FEW_ROWS


def test_only_what_ends_below_a_model_on_some_of_the_data_leads_lower():
    bench, rung = prepared(records({}, kinds=('steps', 'triangle'), seconds=3.0),
                           SpeedSensor.DIFFERENCE)  # fmt: skip
    far = rung.model.with_values({'L': 50 * rung.model['L']}).with_free(['L'], free=False)
    valley = climb(far, bench)
    assert leads_lower(rung.model, valley, bench)
    assert not leads_lower(rung.model, rung, bench)
    assert not leads_lower(far, rung, bench)


# --- what a trial comes to


@pytest.fixture(scope='module')
def cogging() -> tuple[Bench, Rung]:
    hidden = {'cogging_torque': {'a_1': 4e-3, 'b_1': 3e-3, 'n': 11}}
    return prepared(records(hidden, kinds=('steps', 'triangle'), seconds=3.0),
                    SpeedSensor.DIFFERENCE)  # fmt: skip


def test_a_wave_pays_for_the_orders_that_were_searched(cogging):
    bench, rung = cogging
    found, level = refitted('cogging_torque', bench, rung)
    assert found.rung.model['cogging_torque.n'] == 11
    rows = sum(len(part) for part in rung.training.residuals)
    price = level.gain(found.rung, bench) - found.delta_bic
    assert price == pytest.approx(searching(effect('cogging_torque'), rows), rel=0.01)
    assert price == pytest.approx(2 * np.log(400), rel=0.01)


@pytest.fixture
def runaway(tmp_path: Path) -> Iterator[str]:
    file = tmp_path / 'runaway.py'
    file.write_text(
        '"""A torque that grows with the cube of the speed, and drives."""\n'
        'from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale\n'
        'CARD = Card(title="runaway", equation="tau = r omega^3", symptom="It runs away.",\n'
        '    reference="-", enters=Enters.MECHANICAL,\n'
        '    amplitudes=(Amplitude("r", "N m s^3/rad^3", "gain", Scale.TORQUE, positive=True,\n'
        '                          trials=(1.0, 3.0)),))\n'
        'def torque(omega, r):\n'
        '    """Torque in N m."""\n'
        '    return r * omega * omega * omega\n'
    )
    add_effect_file(file)
    yield 'runaway'
    catalogue().pop('runaway', None)


@pytest.mark.filterwarnings('ignore::RuntimeWarning')
def test_a_trial_that_runs_away_ends_alone(runaway):
    data = records({'coulomb_friction': {'tau_c': 6e-3}}, kinds=('steps', 'triangle'), seconds=3.0)
    bench, rung = prepared(data, SpeedSensor.DIFFERENCE)
    trial, _ = refitted(runaway, bench, rung)
    assert trial.note == 'cannot be simulated'
    found = diagnose(data, effects=[runaway, 'coulomb_friction'])
    assert found.effects == ('coulomb_friction',)


@pytest.mark.filterwarnings('ignore::RuntimeWarning')
def test_derivatives_beyond_all_numbers_are_said_and_do_not_raise():
    """Their squares overflow, and no decomposition takes that."""
    data = records({}, kinds=('steps',), seconds=2.0)
    bench, rung = prepared(data, SpeedSensor.DIFFERENCE)
    problem, calm = bench.problem(rung.model), Weighting(np.ones(len(bench.outputs)))
    near = problem.linearize(problem.vector())
    wild = [replace(one, slope=one.slope * 1e200) for one in near]
    spread = describe(problem, problem.vector(), calm, wild)
    assert spread.unidentifiable == ('the model cannot be simulated',)
    assert np.all(np.isinf(spread.sigma))


@pytest.mark.parametrize('bad', [np.nan, np.inf, 1e200])
@pytest.mark.parametrize('spoilt', ['residual', 'start'])
def test_a_run_without_bound_is_left_as_it_is(bad, spoilt):
    rng = np.random.default_rng(3)
    parts = {'residual': rng.normal(size=(50, 1)), 'start': rng.normal(size=(50, 1, 2))}
    parts[spoilt][20:] = bad
    near = Linearization(parts['residual'], np.empty((50, 1, 0)), parts['start'], np.empty(0))
    found = Problem.settled(near, Weighting(np.ones(1)))
    assert np.array_equal(found, parts['residual'], equal_nan=True)


def test_open_initial_states_are_set_to_their_best():
    rng = np.random.default_rng(3)
    noise, start = rng.normal(size=(50, 1)), rng.normal(size=(50, 1, 2))
    near = Linearization(noise + start @ [0.7, -2.0], np.empty((50, 1, 0)), start, np.empty(0))
    left = Problem.settled(near, Weighting(np.ones(1)))
    assert np.abs(start[:, 0].T @ left).max() < 1e-10
    assert np.std(left) < 1.1


@pytest.mark.parametrize(
    ('cost', 'after', 'widens', 'more'),
    [
        (1.05, 1.00, False, True), (1.03, 1.001, False, True), (1.03, 1.01, False, False),
        (1.015, 1.00, False, False), (1.03, 0.90, False, False),
        (1.03, 0.90, True, True), (1.03, 1.00, True, False),
    ],
)  # fmt: skip
def test_a_wider_law_that_leaves_less_than_noise_knows_the_noise_better(
    cost, after, widens, more
):
    level = Level(None, None, 1000.0 * cost, 1000)
    assert level.leaves(widens, 1000.0 * after) is more


@pytest.mark.parametrize(
    ('cost', 'after', 'explained', 'mends'),
    [
        (1.35, 1.02, 9.0, True), (1.35, 1.10, 9.0, False),  # what is left is noise, or is not
        (1.08, 1.01, 9.0, True), (1.08, 1.03, 9.0, False),  # nearly all of a little, or not
        (1.04, 1.00, 9.0, False),  # too little
        (1.02, 0.97, 0.1, True),  # teeth beside a shaft: half as much again as it explains
        (1.02, 0.97, 1.0, False),  # a twentieth: the shaft's law is not that exact
        (1.02, 0.97, 0.0, False),  # nothing is explained that it could widen
    ],
)  # fmt: skip
def test_a_wider_law_mends_by_what_it_leaves_or_adds(cost, after, explained, mends):
    level = Level(None, None, 1000.0 * cost, 1000, 1000.0 * explained)
    assert level.mends(1000.0 * after) is mends


# --- the last fit


def test_the_last_fit_takes_signs_and_steps_that_move_no_parameter_by_its_error():
    hidden = {'coulomb_friction': {'tau_c': 6e-3}}
    bench, rung = prepared(records(hidden, seconds=3.0), SpeedSensor.DIFFERENCE)
    rung = climb(rung.model.with_effect('coulomb_friction', {'tau_c': 5e-3}), bench)
    last, fine = exact(rung, bench)
    sharper = last.model.with_values({'omega_eps': 0.1 * last.model['omega_eps']})
    finest = climb(sharper, replace(bench, substeps=64))
    assert last.substeps == fine.substeps
    assert last.model['omega_eps'] < 0.2 * rung.model['omega_eps']

    def moved(found: Rung) -> float:
        return max(
            abs(p.value - finest.model[p.name]) / (p.sigma or np.inf)
            for p in found.model.parameters.free
        )

    assert moved(last) < 0.35 < 0.25 * moved(rung)


def test_a_linear_model_needs_no_finer_steps(cogging):
    bench, rung = cogging
    assert exact(rung, bench)[1] is bench


def still_between(
    first: float, last: float, moment: float
) -> tuple[Problem, Weighting, Information]:
    """Return a motor at rest between two times, whose inertia has grown at a moment."""
    model = a_motor({'inertia_change': {'g': 0.5, 't_on': moment, 'rise': 1e-3}})
    time = 1e-3 * np.arange(4000)
    volts = np.where((time > first) & (time < last), 0.0, 5 * np.sign(np.sin(15 * time)))
    record = measure(model, volts, np.random.default_rng(5)).uniform()
    outputs = observed_outputs(model.kind, [record])
    values = {**START, 'current_offset': 0.015}
    known = Model.base('brushed_dc', values, speed_sensor=SpeedSensor.DIFFERENCE).with_effect(
        'inertia_change', {'g': 0.5, 't_on': moment, 'rise': 1e-3}
    )
    problem = Problem(known, [make_chain(record, model.kind, outputs)], outputs, substeps=2)
    fitted = fit(problem, iterations=3)
    fine = Problem(fitted.model, problem.chains, outputs, substeps=2)
    return fine, fitted.weighting, fitted.information


def sigma_of_moment(model: Model) -> float:
    sigma = model.parameters['inertia_change.t_on'].sigma
    assert sigma is not None
    return sigma


def test_a_moment_at_which_nothing_moved_is_known_no_better_than_that():
    problem, weighting, bound = still_between(1.5, 2.5, 2.1)
    honest = sigma_of_moment(with_honest_moments(problem, weighting, bound))
    assert 0.25 * 0.7 < honest < 0.25 * 1.3


def test_a_moment_in_motion_is_known_but_not_beyond_what_a_sample_resolves():
    problem, weighting, bound = still_between(0.0, 0.0, 2.1)
    honest = sigma_of_moment(with_honest_moments(problem, weighting, bound))
    assert 0.99e-3 / np.sqrt(12) < honest < 20e-3


def test_moments_that_are_not_fitted_keep_their_errors():
    problem, weighting, bound = still_between(0.0, 0.0, 2.1)
    fixed = problem.model.with_free(['inertia_change.t_on'], free=False)
    held = Problem(fixed, problem.chains, problem.outputs, substeps=2)
    before = fixed.parameters['inertia_change.t_on'].sigma
    after = with_honest_moments(held, weighting, bound).parameters['inertia_change.t_on'].sigma
    assert after == before


# --- what was lost while an effect was missing


def test_a_friction_that_fell_to_nothing_comes_back_with_the_effect_that_was_missing():
    data = records({'coulomb_friction': {'tau_c': 6e-3}}, kinds=('steps', 'triangle'), seconds=3.0)
    bench, _ = prepared(data, SpeedSensor.DIFFERENCE)
    lowest = next(p.lower for p in motor('brushed_dc').parameters if p.name == 'b')
    model = Model.base('brushed_dc', {**START, 'b': lowest}, speed_sensor=SpeedSensor.DIFFERENCE)
    assert lost(model, bench) == {'b': bench.begun['b']}
    assert lost(model.with_values({'b': 1e-6}), bench) == {}
    found = climb(model.with_effect('coulomb_friction', {'tau_c': 5e-3}), bench)
    assert found.model['b'] == pytest.approx(MOTOR['b'], rel=0.2)


def test_a_fit_in_full_begins_with_blunt_signs_and_ends_with_sharp_ones():
    data = records({'coulomb_friction': {'tau_c': 6e-3}}, kinds=('steps', 'triangle'), seconds=3.0)
    bench, rung = prepared(data, SpeedSensor.DIFFERENCE, omega_eps=0.05)
    assert bench.blunt['omega_eps'] > 0.05
    scores = scored(rung, bench, [effect('coulomb_friction')], lambda text: None)
    level = Level.of(rung, bench, scores.weighting)
    trial = try_thoroughly(scores.singles[0], level, bench)
    assert trial.passes
    assert trial.rung.model['omega_eps'] == 0.05
    assert trial.rung.model['coulomb_friction.tau_c'] == pytest.approx(6e-3, rel=0.05)


def test_a_fit_that_went_astray_begins_again_where_one_of_its_kind_ended():
    """Brushes and dead time push the same voltage by the sign of the current."""
    data = records({'brush_voltage_drop': {'v_b': 1.0}}, kinds=('steps', 'triangle'), seconds=3.0)
    bench, base = prepared(data, SpeedSensor.DIFFERENCE)
    brushes, level = refitted('brush_voltage_drop', bench, base)
    other, _ = refitted('inverter_dead_time', bench, base)
    assert of_a_kind(brushes, other)
    assert not of_a_kind(brushes, refitted('coulomb_friction', bench, base)[0])
    astray = replace(brushes, delta_bic=0.0, rung=base)
    again = try_beside(astray, other, level, bench)
    assert again.passes
    assert again.delta_bic == pytest.approx(brushes.delta_bic, rel=0.01)
    assert try_beside(replace(brushes, delta_bic=1e9), other, level, bench).delta_bic == 1e9


@pytest.mark.parametrize('rough', [True, False])
def test_a_drift_takes_nothing_from_a_friction_that_is_not_there(rough, monkeypatch):
    """Viscous friction grows, and a drag bends the other friction below nothing.

    The fit to all of the data may tell that for certain where the rough one does not.
    """
    if not rough:
        monkeypatch.setattr(refit, '_undrained', lambda found, *_: found)
    truth = {'friction_drift': {'d_v': 8e-6}, 'quadratic_drag': {'k_d': 1e-7}}
    bench, rung = prepared(records(truth, kinds=('steps', 'triangle'), seconds=4.0),
                           SpeedSensor.DIFFERENCE)  # fmt: skip
    found, _ = refitted('friction_drift', bench, rung)
    drift = found.rung.model.parameters
    assert drift['friction_drift.d_c'].value >= 0.0
    assert drift['friction_drift.d_v'].value == pytest.approx(8e-6, rel=0.3)
    assert found.passes


@pytest.mark.parametrize('t_d', [1.5, 1e5])
def test_a_drift_comes_to_an_end_only_where_that_leaves_clearly_less(t_d):
    truth = {'friction_drift': {'d_v': 2e-5, 't_d': t_d}}
    bench, rung = prepared(records(truth, kinds=('steps', 'triangle'), seconds=4.0),
                           SpeedSensor.DIFFERENCE)  # fmt: skip
    found, _ = refitted('friction_drift', bench, rung)
    drift = found.rung.model.parameters
    assert found.passes
    assert drift['friction_drift.t_d'].free is (t_d == 1.5)
    if t_d == 1.5:
        assert drift['friction_drift.t_d'].value == pytest.approx(t_d, rel=0.1)
    assert drift['friction_drift.d_v'].value == pytest.approx(2e-5, rel=0.1)


def test_what_a_drift_may_take_from_is_free_again_once_it_is_there():
    bench, rung = prepared(records({}, kinds=('steps',), seconds=2.0), SpeedSensor.DIFFERENCE)
    held = rung.model.with_effect('friction_drift', {'d_c': 0.0}, bench.scales)
    held = held.with_free(['friction_drift.d_c'], free=False)
    rung = replace(rung, result=replace(rung.result, model=held), near=())
    for key, free in (('coulomb_friction', True), ('quadratic_drag', False)):
        scores = scored(rung, bench, [effect(key)], lambda text: None)
        one = best_per_effect(scores.singles, 1)[0][0]
        model = refit._opened(one.variant.model, rung.model, one)
        assert model.parameters['friction_drift.d_c'].free is free
