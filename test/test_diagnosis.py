"""A hidden effect is found, named, added, and the error falls; nothing is found where nothing is.

Seeds are fixed, so a test either passes always or never; docs/benchmark.md has the rates over many
seeds, motors and sizes.
"""

import json

from bench_motor import a_motor, CURRENT_NOISE, measure, MOTOR, records, voltage_profile
import numpy as np
import pytest

from motor_sysid.benchmark.equivalences import same_as
from motor_sysid.diagnosis import diagnose, Diagnosis, Verdict
from motor_sysid.diagnosis.fitting import add_effect, bare, bench_of, compare_model, fit_model
from motor_sysid.diagnosis.result.document import diagnosis_document
from motor_sysid.diagnosis.search.refusals import refuse_short
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.diagnosis.search.trial import Level
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

HIDDEN = {
    'coulomb_friction': {'tau_c': 6e-3},
    'asymmetric_coulomb_friction': {'tau_c_plus': 8e-3, 'tau_c_minus': 4e-3},
    'quadratic_drag': {'k_d': 4e-7},
    'constant_load_torque': {'tau_l': 6e-3},
    'gravity_load': {'tau_sin': 6e-3, 'tau_cos': 2e-3},
    'cogging_torque': {'a_1': 4e-3, 'b_1': 3e-3, 'b_2': 1e-3, 'n': 11},
    'input_delay': {'delay': 3.4e-3},
    'brush_voltage_drop': {'v_b': 0.5},
    'armature_heating': {'h': 3e-2, 't_th': 5.0},
    'stribeck_friction': {'tau_c': 3e-3, 'tau_s': 6e-3, 'omega_s': 8.0},
}
LONG = (
    'armature_heating', 'asymmetric_coulomb_friction', 'brush_voltage_drop', 'stribeck_friction',
)
"""Effects that take a part of `make test` out of proportion."""


@pytest.mark.parametrize(
    'key', [pytest.param(k, marks=[pytest.mark.slow] * (k in LONG)) for k in sorted(HIDDEN)]
)
def test_a_hidden_effect_is_named_and_the_error_falls(key):
    *train, held = records({key: HIDDEN[key]})
    found = diagnose(train, [held])
    assert found.verdict in (Verdict.EFFECT_MISSING, Verdict.AMBIGUOUS)
    assert frozenset(found.effects) in same_as(frozenset({key}))
    errors = [step.validation_error_percent for step in found.steps]
    assert errors[-1] < 0.9 * errors[0]
    assert errors[-1] < 1.1 * found.noise_floor_percent


def test_wrong_base_parameters_come_back():
    *train, held = records({'coulomb_friction': {'tau_c': 6e-3}})
    found = diagnose(train, [held])
    base, final = found.steps[0].model, found.model
    assert base['b'] > 2 * MOTOR['b']
    assert final['b'] == pytest.approx(MOTOR['b'], rel=0.05)
    assert final['coulomb_friction.tau_c'] == pytest.approx(6e-3, rel=0.02)
    assert any('viscous friction' in line and 'too large' in line for line in found.reasons)


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_a_complete_model_is_called_complete(seed):
    *train, held = records({}, seed=seed)
    found = diagnose(train, [held])
    assert found.verdict is Verdict.COMPLETE
    assert found.effects == ()
    assert len(found.steps) == 1
    model = found.model
    for name in ('R', 'L', 'k_t', 'J'):
        p = model.parameters[name]
        assert p.value == pytest.approx(MOTOR[name], rel=0.01)
        assert p.sigma is not None
        assert 0 < p.sigma < 0.01 * p.value


def test_two_effects_are_both_named():
    hidden = {'coulomb_friction': HIDDEN['coulomb_friction'],
              'cogging_torque': HIDDEN['cogging_torque']}  # fmt: skip
    *train, held = records(hidden)
    found = diagnose(train, [held])
    assert set(found.effects) == set(hidden)
    assert found.steps[-1].validation_error_percent < 1.1 * found.noise_floor_percent
    assert found.model['cogging_torque.n'] == 11


def test_the_true_effect_out_of_the_catalogue_is_not_blamed_on_a_stranger():
    """Trap: if the truth is not among the candidates, the nearest neighbour wins confidently."""
    *train, held = records({'cogging_torque': HIDDEN['cogging_torque']})
    others = ['brush_voltage_drop', 'armature_heating', 'input_delay']
    found = diagnose(train, [held], effects=others)
    assert found.verdict is Verdict.UNKNOWN_EFFECT
    assert found.effects == ()
    assert any('catalogue' in line for line in found.reasons)


def test_without_validation_records_a_stretch_is_held_back():
    train = records({'coulomb_friction': HIDDEN['coulomb_friction']})
    found = diagnose(train)
    assert found.effects == ('coulomb_friction',)
    assert found.roles == ('train',) * 3 + ('validate',) * 3
    assert len(found.records[0]) == round(0.8 * 6000)


def test_the_same_data_give_the_same_answer_to_the_bit():
    *train, held = records({'coulomb_friction': HIDDEN['coulomb_friction']}, seconds=3.0)
    one, two = (json.dumps(diagnosis_document(diagnose(train, [held]))) for _ in range(2))
    assert one == two


def test_turning_the_other_way_round_gives_the_mirrored_answer():
    """Odd symmetry: all signals negated, the same motor."""
    *train, held = records({'coulomb_friction': HIDDEN['coulomb_friction']}, seconds=4.0)
    mirrored = [
        Record(r.time, {n: -v for n, v in r.signals.items()}, r.units) for r in (*train, held)
    ]
    a, b = diagnose(train, [held]), diagnose(mirrored[:-1], mirrored[-1:])
    assert a.effects == b.effects
    for name in ('R', 'k_t', 'J', 'coulomb_friction.tau_c'):
        assert a.model[name] == pytest.approx(b.model[name], rel=1e-4)


@pytest.mark.slow
def test_a_later_start_of_the_clock_changes_nothing():
    *train, held = records({'coulomb_friction': HIDDEN['coulomb_friction']}, seconds=3.0)
    shifted = [Record(r.time + 1.7e9, r.signals, r.units) for r in (*train, held)]
    a, b = diagnose(train, [held]), diagnose(shifted[:-1], shifted[-1:])
    assert a.effects == b.effects
    assert a.model['R'] == pytest.approx(b.model['R'], rel=1e-4)


def test_speed_and_voltage_alone_name_friction_in_volts():
    def without_current(r: Record) -> Record:
        return r.select(['voltage', 'speed', 'position'])

    *train, held = [
        without_current(r) for r in records({'coulomb_friction': HIDDEN['coulomb_friction']})
    ]
    found = diagnose(train, [held])
    assert found.model.motor == 'brushed_dc_reduced'
    assert found.effects[0] == 'coulomb_friction'
    in_volts = 6e-3 * MOTOR['R'] / MOTOR['k_t']
    assert found.model['coulomb_friction.tau_c'] == pytest.approx(in_volts, rel=0.1)


@pytest.fixture(scope='module')
def friction() -> Diagnosis:
    *train, held = records({'coulomb_friction': HIDDEN['coulomb_friction']})
    return diagnose(train, [held])


def test_the_document_keeps_its_contract(friction):
    document = diagnosis_document(friction)
    assert document['schema'] == 'motor_sysid/diagnosis/1'
    assert document['verdict'] == 'effect_missing'
    assert document['effects'] == ['coulomb_friction']
    first, last = document['steps'][0], document['steps'][-1]
    assert first['effects'] == []
    assert last['effects'] == ['coulomb_friction']
    assert first['validation_error_percent'] > last['validation_error_percent']
    best = document['candidates'][0]
    assert best['effect'] == 'coulomb_friction'
    assert best['equation'] == 'mechanical'
    assert best['parameters']['tau_c']['unit'] == 'N m'
    assert {w['axis'] for w in document['where']} >= {'speed', 'current', 'position', 'time'}
    for where in document['where']:
        assert len(where['bins']) == len(where['error_percent']) + 1
    assert document['reasons']
    assert json.dumps(document)


def test_the_noise_floor_is_that_of_the_sensors(friction):
    assert friction.noise_sigma['current'] == pytest.approx(CURRENT_NOISE, rel=0.1)
    quantum = 2 * np.pi / 4096 / 1e-3
    assert friction.noise_sigma['speed'] == pytest.approx(quantum / np.sqrt(6), rel=0.15)


def test_evidence_curve_shows_the_step_at_zero_speed(friction):
    curve = friction.steps[0].candidates[0].curve
    assert curve is not None
    assert curve.axis == 'speed'
    assert curve.law is not None
    near = np.abs(curve.x) < 40
    jump = curve.mean[near & (curve.x < 0)].max() - curve.mean[near & (curve.x > 0)].min()
    assert jump == pytest.approx(2 * 6e-3, rel=0.35)
    assert np.corrcoef(curve.law, curve.mean)[0, 1] > 0.9


def test_by_hand_fit_then_add_gives_what_the_diagnosis_gives(friction):
    *train, held = records({'coulomb_friction': HIDDEN['coulomb_friction']})
    linear = fit_model(train, [held])
    before, trial = add_effect(linear.model, 'coulomb_friction', train, [held])
    assert trial.passes
    assert trial.rung.validation.error_percent < before.validation.error_percent
    assert trial.rung.model['coulomb_friction.tau_c'] == pytest.approx(
        friction.model['coulomb_friction.tau_c'], rel=1e-3
    )
    comparison, where = compare_model(trial.rung.model, [held])
    assert comparison.error_percent == pytest.approx(trial.rung.validation.error_percent, rel=0.01)
    assert where


def test_what_takes_the_place_of_an_effect_that_the_model_had_is_named():
    train = records({'stribeck_friction': HIDDEN['stribeck_friction']}, seconds=4.0)
    known = fit_model(train, motor='brushed_dc', effects=('coulomb_friction',)).model
    found = diagnose(train, model=known, effects=['stribeck_friction', 'cogging_torque'])
    assert found.model.effects == found.effects == ('stribeck_friction',)
    assert found.verdict is Verdict.EFFECT_MISSING


def test_what_effects_explain_counts_by_hand_too():
    """A further law of the same thing may be their misfit, and has to explain enough beside."""
    train = records({'coulomb_friction': {'tau_c': 6e-3}}, seconds=2.0)
    model = fit_model(train, motor='brushed_dc', effects=('coulomb_friction',)).model
    bench, _ = bench_of(train, (), model, None, {}, 0.2)
    rung = climb(model, bench)
    linear = bare(rung, bench)
    assert linear is not None
    assert linear.model.effects == ()
    assert Level.of(rung, bench, rung.result.weighting, linear).explained > 1000.0
    assert bare(linear, bench) is None


def test_a_moment_at_which_nothing_moved_is_known_no_better_than_that():
    """An inertia that changed while the motor rested from 1.5 to 4.5 s: at any of these times."""
    rng = np.random.default_rng(3)
    volts = voltage_profile('steps', 8.0, rng)
    volts[1500:4500] = 0.0
    record = measure(a_motor({'inertia_change': {'g': 0.5, 't_on': 3.0}}), volts, rng)
    found = diagnose([record], motor='brushed_dc', effects=['inertia_change'])
    p = found.model.parameters['inertia_change.t_on']
    assert abs(p.value - 3.0) < 1.96 * p.sigma
    assert p.sigma < 3.0 / 1.5


def test_a_superfluous_effect_does_not_pass():
    *train, held = records({})
    linear = fit_model(train, [held])
    _, trial = add_effect(linear.model, 'quadratic_drag', train, [held])
    assert not trial.passes
    assert trial.note


def with_gap(record, name):
    values = record[name].copy()
    values[100:103] = np.nan
    return Record(record.time, {**{n: record[n] for n in record}, name: values}, record.units)


@pytest.mark.parametrize(
    ('spoil', 'words'),
    [
        (lambda r: r.slice(0, 50), 'samples'),
        (lambda r: r.select(['current', 'speed']), 'input'),
        (lambda r: r.select(['voltage', 'current']), 'speed or position'),
        (lambda r: with_gap(r, 'current'), '`current` of .* has 3 values of 2000 that'),
    ],
)
def test_records_that_cannot_be_used_are_refused_in_words(spoil, words):
    record = records({}, kinds=['steps'], seconds=2.0)[0]
    with pytest.raises(UserError, match=words):
        diagnose([spoil(record)], motor='brushed_dc')


def test_short_records_count_together():
    whole = records({}, kinds=['steps'], seconds=2.0)[0]
    short = [whole.slice(k, k + 90) for k in (0, 300, 600)]
    refuse_short(short, [])
    with pytest.raises(UserError, match='180 samples to fit; a diagnosis needs at least 200'):
        refuse_short(short[:2], short)
    with pytest.raises(UserError, match='has 40 samples; a diagnosis needs at least 50 in each'):
        refuse_short([whole, whole.slice(0, 40)], [])


@pytest.mark.parametrize('names', [('voltage', 'current', 'speed'), ('voltage', 'speed')])
def test_a_constant_input_is_insufficient_data(names):
    count = 4000
    rng = np.random.default_rng(0)
    signals = {
        'voltage': np.full(count, 6.0),
        'current': 0.2 + 0.01 * rng.normal(size=count),
        'speed': 120.0 + 0.5 * rng.normal(size=count),
    }
    record = Record(
        1e-3 * np.arange(count), signals, {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'}
    )
    found = diagnose([record.select(names)])
    assert found.verdict is Verdict.INSUFFICIENT_DATA
    assert found.effects == ()
    assert found.experiment


def test_an_effect_that_makes_no_sense_is_refused():
    with pytest.raises(UserError, match='does not have'):
        Model.base('mechanical_axis').with_effect('brush_voltage_drop')


def test_a_load_that_swings_with_a_harmonic_is_named_with_it():
    """A pump does not turn as a sine; what was left swung at three times its frequency."""
    size = {'b': 0.0}
    hidden = {
        'periodic_load': {'a': 6e-3, 'f': 1.7, **size},
        'periodic_load_2': {'a': 1.2e-3, 'f': 5.1, **size},
    }
    *train, held = records(hidden)
    found = diagnose(train, [held], effects=list(hidden))
    assert found.effects == tuple(hidden)
    assert found.model['periodic_load_2.f'] == pytest.approx(5.1, rel=1e-3)
    assert found.steps[-1].validation_error_percent < 1.1 * found.noise_floor_percent
