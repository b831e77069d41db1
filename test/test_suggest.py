"""The next experiment: it separates what data leave alike, and says so where nothing can.

The truth comes from the benchmark's simulator, which shares nothing with the models' integrator
and has dry friction as a true sign.
"""

from dataclasses import replace
import json
import sys

import numpy as np
import pytest

from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.sensors import measure, Sensors
from motor_sysid.benchmark.truth import Control, run
from motor_sysid.control.profile import SPEED
from motor_sysid.diagnosis import diagnose, Experiment, Limits, suggest, suggest_experiment
from motor_sysid.diagnosis.experiment.choose import QUICK
from motor_sysid.diagnosis.experiment.limits import limits_of, MARGIN
from motor_sysid.diagnosis.experiment.relax import would_help
from motor_sysid.diagnosis.experiment.rivals import fit_rivals, parse_rivals, rivals_of
from motor_sysid.diagnosis.experiment.stage import Stage
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import fit, refit
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

DT = 1e-3
MOTOR = Plant(2.1, 2.4e-3, 0.046, 2.6e-5, 1.3e-5)
SENSORS = Sensors(4096.0, 0.0, 0.012, 20 / 4096, 0.015)
RIVALS = ('constant_load_torque', 'asymmetric_coulomb_friction')
FIVE = (
    'constant_load_torque', 'asymmetric_coulomb_friction', 'coulomb_friction', 'none', 'iron_loss'
)
TRUTHS = {
    'constant_load_torque': MOTOR._replace(tau_l=6e-3),
    'asymmetric_coulomb_friction': MOTOR._replace(tau_plus=6e-3, tau_minus=3e-3),
}


def driven(plant: Plant, volts: np.ndarray, seed: int = 1) -> Record:
    """Return the record of a motor under a held voltage."""
    rng = np.random.default_rng(seed)
    return measure(run(plant, Control(volts), DT), SENSORS, DT, rng)


def forward(plant: Plant, seconds: float = 5.0) -> Record:
    """Return a record that begins and ends while the motor turns forward at changing speeds."""
    rng = np.random.default_rng(1)
    t = DT * np.arange(round((seconds + 1) / DT))
    heights, edges = rng.uniform(3, 9, 200), np.cumsum(rng.uniform(0.1, 0.4, 200))
    record = driven(plant, heights[np.searchsorted(edges, t)])
    assert np.min(record['speed'][1000:]) > 10
    return record.slice(1000, len(record))


def followed(plant: Plant, made: Experiment, seed: int = 2) -> Record:
    """Return the record of the suggested experiment, run on the true motor."""
    assert made.profile is not None
    volts = made.profile.sampled(DT)
    if made.profile.signal != SPEED:
        return driven(plant, volts, seed)
    gains = made.controller
    assert gains is not None
    control = Control(volts, gains.kp, gains.ki, 24.0, 0.01, SENSORS.counts)
    return measure(run(plant, control, DT), SENSORS, DT, np.random.default_rng(seed), volts)


@pytest.fixture(scope='module', params=sorted(TRUTHS))
def case(request) -> tuple[str, Record, tuple[Model, ...]]:
    record = forward(TRUTHS[request.param])
    base = fit_model([record]).model
    return request.param, record, fit_rivals(base, parse_rivals(RIVALS), [record])


def test_one_direction_is_answered_with_reversals_and_the_truth_is_then_named(case) -> None:
    truth, record, rivals = case
    made = suggest_experiment(rivals, record)
    assert made is not None
    assert made.decides
    values = made.profile.sampled(DT)
    assert np.sum(np.diff(np.sign(values[values != 0])) != 0) >= 3, 'reversals'
    assert 'separates constant load torque from asymmetric Coulomb friction' in made.summary
    assert f'after {made.profile.duration:.3g} s' in made.summary
    new = followed(TRUTHS[truth], made)
    assert diagnose([record, new], effects=list(RIVALS)).effects == (truth,)


def test_the_evidence_that_was_expected_is_found(case) -> None:
    """With the noise that was assumed, refits to the record of the true motor differ as said.

    A motor that only turned forward tells nothing of the friction backward, which counts as none:
    the true one is farther from its rival than what was promised.
    """
    truth, record, rivals = case
    made = suggest_experiment(rivals, record, quick=False)
    assert made is not None
    stage = Stage(rivals, [record], made.limits, 10_000)
    assert stage.dt == pytest.approx(DT)
    new = followed(TRUTHS[truth], made)
    costs = [
        fit(stage.problem(rival, [new]), stage.weighting, reweight=0).cost for rival in rivals
    ]
    found = costs[1 - RIVALS.index(truth)] - costs[RIVALS.index(truth)]
    promised = made.separations[0]
    assert promised.worst_delta_bic is not None
    assert promised.delta_bic >= promised.worst_delta_bic >= 40
    assert promised.delta_bic / 2 < found < 5 * promised.delta_bic


def test_what_no_record_tells_of_a_rival_is_nothing(case) -> None:
    _, _, (load, friction) = case
    assert friction['asymmetric_coulomb_friction.tau_c_minus'] == 0.0
    told = friction['asymmetric_coulomb_friction.tau_c_plus']
    assert told == pytest.approx(load['constant_load_torque.tau_l'], rel=0.01) != 0.0


def test_the_true_motor_stays_inside_the_limits(case) -> None:
    truth, record, rivals = case
    limits = Limits(input=8.0, speed=70.0, current=1.5, travel=30.0, time=4.0)
    made = suggest_experiment(rivals, record, limits)
    assert made is not None
    assert made.decides
    assert made.profile.duration <= 4.0
    for name, peak in made.peaks.items():
        assert peak <= MARGIN * limits.of(name) * (1 + 1e-6)
    new = followed(TRUTHS[truth], made)
    noise = 2 * np.pi / SENSORS.counts / DT
    assert np.max(np.abs(new['voltage'])) <= 8.0
    assert np.max(np.abs(new['speed'])) <= 70.0 + noise
    assert np.max(np.abs(new['current'])) <= 1.5 + 5 * SENSORS.current_noise
    assert np.max(np.abs(new['position'])) <= 30.0


def test_three_rivals_are_told_apart_in_words(case) -> None:
    _, record, rivals = case
    bare = fit_model([record]).model
    made = suggest_experiment((bare, *rivals), record)
    assert made is not None
    assert made.decides
    words = 'the model as it is, constant load torque and asymmetric Coulomb friction apart'
    assert made.purpose == f'to tell {words}'
    assert made.summary.startswith(f'tells {words}: expected dBIC')
    two = suggest_experiment((bare, rivals[0]), record)
    assert two is not None
    assert two.summary.startswith('separates the model as it is from constant load torque: ')


def test_rivals_that_are_left_out_are_named(case) -> None:
    _, record, rivals = case
    bare = fit_model([record]).model
    others = [bare.with_effect(key) for key in ('quadratic_drag', 'iron_loss')]
    made = suggest_experiment((bare, *rivals, *others), record)
    assert made is not None
    assert made.reasons[0] == 'Left out is iron loss: no more than 4 rivals are compared at once.'


@pytest.fixture
def asked(monkeypatch) -> list[tuple[str, ...]]:
    """Return the rivals that `suggest` has fitted; it proposes nothing."""
    fitted: list[tuple[str, ...]] = []
    nothing = Experiment(False, '', '', ('The end.',), Limits())
    entrance = sys.modules['motor_sysid.diagnosis.suggest']
    monkeypatch.setattr(entrance, 'fit_rivals', lambda _, sets, *rest: fitted.extend(sets))
    monkeypatch.setattr(entrance, 'suggest_experiment', lambda *_, **rest: nothing)
    return fitted


def test_a_diagnosis_may_name_more_rivals_than_are_compared(crawled, asked) -> None:
    record, model = crawled
    one = {'effect': FIVE[0], 'confusable_with': [*FIVE[1:3], 'gravity_load', 'iron_loss']}
    made = suggest(model, [record], diagnosis={'effects': [FIVE[0]], 'candidates': [one]})
    assert asked == [(key,) for key in (*FIVE[:3], 'gravity_load')]
    assert made.reasons[0].startswith('Left out is iron loss')
    assert made.reasons[-1] == 'The end.'


def test_a_diagnosis_that_names_no_rivals_is_said_to(crawled, asked) -> None:
    record, model = crawled
    nothing = {'effects': [], 'candidates': [{'effect': FIVE[0], 'passes': True}]}
    made = suggest(model, [record], diagnosis=nothing)
    assert made.reasons == (
        'The diagnosis names no rivals: this is for parameters instead.', 'The end.'
    )
    assert suggest(model, [record], parameters=['J']).reasons == ('The end.',)
    assert not asked


def test_a_motor_that_must_not_turn_back_is_not_told_to(case) -> None:
    """What decides then is a stop: a load turns the motor back, friction holds it."""
    _, record, rivals = case
    limits = limits_of([record], rivals[0].kind, reverse=False, time=4.0)
    made = suggest_experiment(rivals, record, limits)
    assert made is not None
    assert made.decides
    assert np.min(made.profile.sampled(DT)) >= 0


def test_the_limit_that_stands_in_the_way_is_named() -> None:
    record = forward(MOTOR)
    base = fit_model([record]).model
    rivals = (base, base.with_effect('quadratic_drag', {'k_d': 1.5e-7}))
    slow = limits_of([record], base.kind, speed=60.0, time=4.0)
    made = suggest_experiment(rivals, record, slow)
    assert made is not None
    assert not made.decides
    assert 'no admissible experiment separates the model as it is from quadratic' in made.summary
    (words,) = would_help(Stage(rivals, [record], slow, QUICK))
    assert 'twice the speed' in words
    assert 'current' not in words
    fast = suggest_experiment(rivals, record, slow.widened('speed'))
    assert fast is not None
    assert fast.decides


def test_what_is_the_same_to_every_sensor_is_called_so() -> None:
    """Coulomb friction and a smaller constant load together are friction with a direction."""
    plant = MOTOR._replace(tau_plus=5e-3, tau_minus=5e-3, tau_l=2e-3)
    record = forward(plant)
    base = fit_model([record]).model
    texts = ['coulomb_friction+constant_load_torque', 'asymmetric_coulomb_friction']
    models = list(fit_rivals(base, parse_rivals(texts), [record]))
    values = {'coulomb_friction.tau_c': 5e-3, 'constant_load_torque.tau_l': 2e-3}
    models[0] = models[0].with_values(values)
    made = suggest_experiment(models, record)
    assert made is not None
    assert not made.decides
    assert made.profile is None
    assert 'no admissible experiment separates' in made.summary
    assert 'one to the sensors' in ' '.join(made.reasons)
    assert 'tau_c_minus' in ' '.join(made.reasons), 'and it is told what takes over'


@pytest.fixture(scope='module')
def crawled() -> tuple[Record, Model]:
    """Return a record whose voltage creeps, so that it hardly shows inertia, and its model."""
    t = DT * np.arange(4000)
    record = driven(MOTOR, 6 + 2 * np.sin(2 * np.pi * 0.5 * t)).slice(1000, 4000)
    return record, fit_model([record]).model


def test_a_weak_parameter_becomes_sharp_as_was_said(crawled) -> None:
    record, model = crawled
    made = suggest_experiment([model], record, parameters=['J', 'b'])
    assert made is not None
    assert made.decides
    found = refit(model, [record, followed(MOTOR, made)], 'least_squares').model
    for row in made.sharpenings:
        truth = {'J': MOTOR.J, 'b': MOTOR.b}[row.name]
        assert row.sigma_after < row.sigma_before / 1.5
        after = found.parameters[row.name]
        assert abs(after.value - truth) < abs(model[row.name] - truth) + after.sigma
        assert after.sigma == pytest.approx(row.sigma_after, rel=1.0)
        assert abs(after.value - truth) < 4 * row.sigma_after + 0.01 * truth


def test_a_stray_sample_is_no_noise(crawled) -> None:
    record, model = crawled
    current = record['current'].copy()
    current[1500] += 10.0
    stray = record.with_signal('current', current, 'A')
    clean, found = (suggest_experiment([model], one).sharpenings for one in (record, stray))
    assert [row.name for row in found] == [row.name for row in clean]
    assert found[0].sigma_after == pytest.approx(clean[0].sigma_after, rel=0.05)


def test_the_least_known_parameters_are_asked_for_by_themselves(crawled) -> None:
    record, model = crawled
    made = suggest_experiment([model], [record])
    assert made is not None
    worst = max(
        (p for p in model.parameters.free if p.logarithmic), key=lambda p: p.sigma / p.value
    )
    assert worst.name in made.purpose


def test_a_parameter_that_nothing_shows_is_named_with_what_hides_it(crawled) -> None:
    """The scale of the current sensor against R, L, J and b: the torque is not measured."""
    record, model = crawled
    scaled = model.with_effect('current_sensor_scale')
    name = next(p.name for p in scaled.parameters if p.name.startswith('current_sensor_scale'))
    made = suggest_experiment([scaled], record, parameters=[name])
    assert made is not None
    assert not made.decides
    assert made.profile is None
    assert name in made.summary
    assert 'only in combination' in ' '.join(made.reasons)
    assert 'R' in ' '.join(made.reasons)


def test_the_answer_is_plain_values_and_the_same_every_time(case) -> None:
    _, record, rivals = case
    one, two = (suggest_experiment(rivals, record).to_dict() for _ in range(2))
    assert json.dumps(one) == json.dumps(two)
    assert {'profile', 'purpose', 'decides', 'summary', 'expected', 'parts'} <= set(one)
    assert all(isinstance(one[key], str) for key in ('profile', 'purpose', 'summary'))
    assert sum(part['seconds'] for part in one['parts']) == pytest.approx(one['duration_s'])


def test_nothing_is_suggested_for_a_model_without_free_parameters(crawled) -> None:
    record, model = crawled
    fixed = model.with_free([p.name for p in model.parameters], free=False)
    assert suggest_experiment([fixed], record) is None
    with pytest.raises(UserError, match='no free parameter'):
        suggest(fixed, [record], parameters=['J'])
    with pytest.raises(UserError, match='held fixed'):
        suggest(model, [record], parameters=['omega_eps'])
    with pytest.raises(UserError, match='no parameter `K`'):
        suggest(model, [record], parameters=['K'])


def test_rivals_come_from_names_or_from_a_diagnosis() -> None:
    assert parse_rivals(['none', 'coulomb_friction+quadratic_drag']) == (
        (), ('coulomb_friction', 'quadratic_drag'),
    )  # fmt: skip
    for texts, word in (
        (['coulomb_friction'], 'at least two'),
        (['coulomb_friction+iron_loss', 'iron_loss+coulomb_friction'], 'at least two'),
        (['a', 'none'], 'unknown effect'),
        (FIVE, 'no more than 4 are compared at once'),
    ):
        with pytest.raises(UserError, match=word):
            parse_rivals(texts)
    twice = ['iron_loss', 'coulomb_friction+coulomb_friction', 'iron_loss']
    assert parse_rivals(twice) == (('iron_loss',), ('coulomb_friction',))
    document = {
        'effects': ['coulomb_friction', 'cogging_torque'],
        'candidates': [
            {'effect': 'coulomb_friction', 'confusable_with': ['constant_load_torque']},
            {'effect': 'quadratic_drag', 'confusable_with': ['coulomb_friction']},
        ],
    }
    assert rivals_of(document) == (
        ('coulomb_friction', 'cogging_torque'), ('constant_load_torque', 'cogging_torque'),
    )  # fmt: skip
    assert rivals_of({'effects': [], 'candidates': []}) == ()
    refused, passing = ({**one, 'passes': p} for one, p in zip(
        document['candidates'], (False, True), strict=True
    ))  # fmt: skip
    assert rivals_of({'effects': [], 'candidates': [refused]}) == ()
    assert rivals_of({'effects': [], 'candidates': [refused, passing]}) == (
        ('quadratic_drag',), ('coulomb_friction',),
    )  # fmt: skip
    with pytest.raises(UserError, match='no diagnosis'):
        rivals_of({})


def test_a_special_case_beside_its_general_form_is_refused(crawled) -> None:
    record, model = crawled
    sets = parse_rivals(['coulomb_friction+asymmetric_coulomb_friction', 'none'])
    with pytest.raises(UserError, match='`coulomb_friction` is a special case of another effect'):
        fit_rivals(model, sets, [record])


def test_an_effect_that_would_push_where_it_must_brake_is_no_rival() -> None:
    """Drag that grows less than with speed looks like negative quadratic drag."""
    record = forward(MOTOR._replace(tau_plus=8e-3, tau_minus=8e-3))
    base = fit_model([record]).model
    with pytest.raises(UserError, match='`quadratic_drag` is no rival'):
        fit_rivals(base, parse_rivals(['quadratic_drag', 'coulomb_friction']), [record])


def test_limits_are_what_the_motor_has_done_unless_given(crawled) -> None:
    record, model = crawled
    limits = limits_of([record], model.kind, current=2.0, time=None)
    assert limits.current == 2.0
    assert limits.speed == pytest.approx(np.max(np.abs(record['speed'])) / MARGIN, rel=0.02)
    assert limits.input == pytest.approx(8.0 / MARGIN, rel=0.01)
    assert limits.travel == np.inf
    assert limits.time == 10.0
    assert replace(limits, reverse=False).widened('speed').speed == 2 * limits.speed
    for given, word in (({'speed': -1.0}, 'more than 0'), ({'torque': 1.0}, 'no limit `torque`')):
        with pytest.raises(UserError, match=word):
            limits_of([record], model.kind, **given)
