"""Records whose supply, payload or zero is not the same, and what is missing beside."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from bench_motor import CURRENT_OFFSET, measure, MOTOR, voltage_profile
import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.own_values import _joined, brought_together, FINE
from motor_sysid.diagnosis.result.document import diagnosis_document
from motor_sysid.diagnosis.search.bench import base_fit, make_bench, prepared, with_scales
from motor_sysid.diagnosis.search.by_record import CERTAIN, Differing, differing
from motor_sysid.diagnosis.search.may_differ import INPUT
from motor_sysid.diagnosis.verdict.between_records import difference_of
from motor_sysid.estimation.batch import make_chain
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.signals.record import Provenance, Record

OUTPUTS = ('speed', 'current')
COULOMB = {'coulomb_friction': {'tau_c': 0.006}}
DEAD_TIME = {'inverter_dead_time': {'v_d': 0.5}}
SAME = ({}, {}, {})
WARMER = ({}, {'R': 1.08}, {'R': 1.03})
WEAKER = (1.0, 0.92, 0.97)
LOADS = tuple({'constant_load_torque': {'tau_l': tau}} for tau in (0.002, -0.001, 0.004))
RUBBED = tuple({'coulomb_friction': {'tau_c': tau}} for tau in (0.006, 0.009, 0.005))
ZERO = CURRENT_OFFSET


def recorded(
    effects: Mapping[str, Mapping[str, float]] | None = None,
    scales: Sequence[Mapping[str, float]] = SAME,
    gains: Sequence[float] = (1.0, 1.0, 1.0),
    seconds: float = 8.0,
    own: Sequence[Mapping[str, Mapping[str, float]]] = SAME,
    zeros: Sequence[float] = (0.0, 0.0, 0.0),
) -> list[Record]:
    """Return a record of each kind of excitation, of a motor that is not the same in each.

    What is recorded is the voltage without its gain, and the current with a zero of its own.
    """
    found = []
    for k, kind in enumerate(('steps', 'triangle', 'sines')):
        rng = np.random.default_rng([k, 5])
        volts = voltage_profile(kind, seconds, rng)
        values = {name: value * scales[k].get(name, 1.0) for name, value in MOTOR.items()}
        model = Model.base('brushed_dc', values)
        for key, given in {**(effects or {}), **own[k]}.items():
            model = model.with_effect(key, given)
        record = measure(model, gains[k] * volts, rng).with_signal('voltage', volts, 'V')
        found.append(record.shifted('current', zeros[k]))
    return found


def what_differs(records: Sequence[Record], **effects: Mapping[str, float]) -> Differing:
    """Return what differs between records for a model that knows the effects."""
    model = Model.base('brushed_dc', MOTOR, speed_sensor=SpeedSensor.DIFFERENCE)
    for key, values in effects.items():
        model = model.with_effect(key, values)
    ready = prepared(records, 'brushed_dc', MOTOR)
    chains = [make_chain(r, model.kind, OUTPUTS) for r in ready]
    found = differing(model, chains, OUTPUTS, FINE)
    assert found is not None
    return found


@pytest.mark.parametrize('effects', [{}, COULOMB], ids=['complete', 'coulomb'])
@pytest.mark.parametrize(
    ('name', 'scales', 'gains', 'values'),
    [
        ('R', WARMER, (1.0, 1.0, 1.0), (1.0, 1.08, 1.03)),
        (INPUT, SAME, WEAKER, (1.0, 0.92, 0.97)),
        ('J', ({}, {'J': 1.3}, {}), (1.0, 1.0, 1.0), (1.0, 1.3, 1.0)),
    ],
)
def test_what_differs_is_told_and_by_how_much(effects, name, scales, gains, values):
    """One step of Gauss and Newton: within a tenth of the difference."""
    found = what_differs(recorded(effects, scales, gains), **effects)
    assert found.name == name
    assert found.matters
    assert found.delta_bic > 2 * CERTAIN
    off = 0.12 * np.abs(np.array(values) - 1.0)
    assert np.all(np.abs(found.values / found.values[0] - values) < off + 0.002)


@pytest.mark.parametrize(
    ('name', 'records', 'values'),
    [
        ('current_offset', {'zeros': (0.0, -0.04, 0.06)}, np.array([0.0, -0.04, 0.06]) + ZERO),
        ('constant_load_torque.tau_l', {'own': LOADS}, (0.002, -0.001, 0.004)),
        ('coulomb_friction.tau_c', {'own': RUBBED}, (0.006, 0.009, 0.005)),
    ],
)
def test_zeros_loads_and_friction_may_differ_too(name, records, values):
    """A step of Gauss and Newton is right for what adds to a signal; friction sticks."""
    known = COULOMB if name.startswith('coulomb') else {}
    found = what_differs(recorded({}, **records), **known)
    assert (found.name, found.relative) == (name, False)
    assert found.matters
    assert found.delta_bic > 2 * CERTAIN
    near = 0.2 if known else 0.03
    assert found.values == pytest.approx(np.array(values), rel=near, abs=2e-5)
    assert found.sigmas[0] == 0.0
    assert np.all(found.least < 0.1 * np.ptp(values))


@pytest.mark.parametrize('effects', [{}, COULOMB, DEAD_TIME], ids=str)
def test_records_of_one_motor_do_not_differ(effects):
    found = what_differs(recorded(effects), **effects)
    assert not found.matters


def test_one_record_has_nothing_to_differ_from():
    model = Model.base('brushed_dc', MOTOR)
    (record, *_) = recorded(seconds=2.0)
    assert differing(model, [make_chain(record, model.kind, OUTPUTS)], OUTPUTS) is None


@pytest.mark.parametrize(
    ('effects', 'scales', 'gains'),
    [
        pytest.param(COULOMB, WARMER, (1.0, 1.0, 1.0), id='warm winding'),
        pytest.param(DEAD_TIME, SAME, WEAKER, id='weak battery', marks=pytest.mark.slow),
    ],
)
def test_an_effect_is_named_beside_what_differs_between_records(effects, scales, gains):
    found = diagnose(recorded(effects, scales, gains), motor='brushed_dc')
    (key,) = effects
    (name, value), = effects[key].items()
    assert (found.verdict, found.effects) == (Verdict.EFFECT_MISSING, (key,))
    assert not found.unknown
    assert found.model[f'{key}.{name}'] == pytest.approx(value, rel=0.01)
    what = 'R (armature resistance)' if scales is WARMER else 'The input is not as strong'
    assert found.reasons[1].startswith(what)
    assert 'make up for that' in found.reasons[2]


@pytest.mark.slow
def test_nothing_is_named_for_it():
    """Of the model that fits all records something was unknown, and no more was said."""
    found = diagnose(recorded({}, SAME, WEAKER), motor='brushed_dc')
    assert (found.verdict, found.effects) == (Verdict.UNKNOWN_EFFECT, ())
    assert found.reasons[0].startswith('The input is not as strong in all records')
    (told,) = found.differences
    assert (told.name, told.words) == (INPUT, found.reasons[0])
    assert [each.value for each in told.values] == pytest.approx(WEAKER, rel=0.005)
    assert all(each.searched for each in told.values)
    assert 'No effect of the catalogue is missing beside that' in found.reasons[1]
    assert found.model['k_t'] == pytest.approx(MOTOR['k_t'], rel=0.005)


def test_records_with_another_payload_are_left_out():
    """No input makes up for an inertia: it is measured, and the others are searched."""
    found = diagnose(recorded(COULOMB, ({}, {'J': 1.3}, {})), motor='brushed_dc')
    assert (found.verdict, found.effects) == (Verdict.EFFECT_MISSING, ('coulomb_friction',))
    said = found.reasons[1]
    assert said.startswith('J (inertia of rotor and load) is not the same in all records')
    assert 'it is +30 % (95 %: +29 to +31 %) in record 2 and the same within' in said
    assert found.reasons[2] == 'Searched, and shown, over record 1 and record 3 alone'
    (told,) = diagnosis_document(found)['differences']
    assert (told['name'], told['unit'], told['words']) == ('J', 'kg m^2', said)
    first, other, last = told['values']
    assert [each['searched'] for each in told['values']] == [True, False, True]
    assert first['value'] == first['low'] == first['high'] == pytest.approx(MOTOR['J'], rel=0.01)
    assert other['low'] < 1.3 * first['value'] < other['high'] < 1.33 * first['value']
    assert last['value'] == pytest.approx(MOTOR['J'], rel=0.01)
    assert found.model['J'] == pytest.approx(MOTOR['J'], rel=0.005)


@pytest.mark.parametrize('factors', [(1.5, 1, 1), (2, 1, 1), (1, 1, 1.5), (1, 3, 1), (3, 1, 1)])
def test_a_payload_that_is_far_off_takes_no_other_record_with_it(factors):
    """One step of Gauss and Newton is some percents off there, wherever the odd record stands."""
    scales = tuple({'J': float(factor)} for factor in factors)
    records = prepared(recorded({}, scales, seconds=4.0), 'brushed_dc', {})
    bench = make_bench(records, [], motor('brushed_dc'))
    model = base_fit(records, bench.kind, bench.train, bench.outputs, {}).model
    own = brought_together(model, with_scales(bench, model), records)
    assert own.kept == tuple(k for k, factor in enumerate(factors) if factor == 1)


def test_a_difference_may_grow_once_the_first_record_is_left_out():
    """The records that were left out keep the value that they had."""
    model = Model.base('brushed_dc', MOTOR)
    first = Differing(INPUT, np.array([1.0, 0.6, 0.62]), np.zeros(3), True, 0.005, 1e3, 0.5, model)
    further = replace(first, values=np.array([np.nan, 1.0, 1.01]))
    (joined,) = _joined((first,), further)
    assert joined.values == pytest.approx([1.0, 0.6, 0.6262])
    records = recorded(seconds=1.0)
    assert '-37 %' in difference_of(joined, records).words


@pytest.mark.slow
def test_a_current_sensor_may_be_set_to_zero_anew_for_each_record():
    found = diagnose(recorded(COULOMB, zeros=(0.0, -0.04, 0.06)), motor='brushed_dc')
    assert (found.verdict, found.effects) == (Verdict.EFFECT_MISSING, ('coulomb_friction',))
    assert not found.unknown
    said = found.reasons[1]
    assert said.startswith('current_offset (offset of the current sensor) is not the same in all')
    assert said.endswith('A sensor that is set to zero anew for each record looks like that')
    assert 'with signals that make up for that' in found.reasons[2]
    assert found.model['current_offset'] == pytest.approx(ZERO, abs=5e-4)
    (told,) = found.differences
    off = [each.value - told.values[0].value for each in told.values]
    assert off == pytest.approx([0.0, -0.04, 0.06], abs=5e-4)


@pytest.mark.slow
def test_a_friction_may_be_another_in_each_record():
    """Of what is left the largest part is alike: one record, which is searched alone."""
    found = diagnose(recorded({}, own=RUBBED), motor='brushed_dc')
    assert (found.verdict, found.effects) == (Verdict.EFFECT_MISSING, ('coulomb_friction',))
    (told,) = found.differences
    assert told.words.startswith('coulomb_friction.tau_c (Coulomb torque) is not the same in all')
    assert '9.0' in told.words
    assert sum(each.searched for each in told.values) == 1
    for each, true in zip(told.values, (0.006, 0.009, 0.005), strict=True):
        assert each.value == pytest.approx(true, rel=0.01)


@pytest.mark.slow
def test_what_the_catalogue_lacks_is_not_named_for_records_that_were_left_out():
    """Of a friction that acts in one record only none of the others tells."""
    records = recorded({})
    (stiff,) = recorded({'quadratic_drag': {'k_d': 4e-7}})[:1]
    known = [key for key in catalogue() if key not in ('quadratic_drag', 'coulomb_friction')]
    found = diagnose([stiff, *records[1:]], motor='brushed_dc', effects=known)
    assert found.effects == ()
    assert found.verdict is Verdict.UNKNOWN_EFFECT


def test_it_is_said_of_which_record_and_how_surely():
    model = Model.base('brushed_dc', MOTOR)
    sources = ('cold.csv', 'warm.csv')
    records = [
        replace(r, provenance=Provenance(source))
        for r, source in zip(recorded(seconds=1.0), sources, strict=False)
    ]
    values, sigmas = np.array([2.1, 2.268]), np.array([0.0, 0.0021])
    warm = Differing('R', values, sigmas, True, 0.01, 900.0, 0.5, model)
    said = difference_of(warm, records).words
    assert 'against cold.csv (2.1 ohm), it is +8 % (95 %: +7.6 to +8.4 %) in warm.csv' in said
    weak = replace(warm, name=INPUT, values=np.array([1.0, 0.92]), sigmas=sigmas / 2.1)
    assert 'it is -8 % (95 %: -8.4 to -7.6 %) in warm.csv' in difference_of(weak, records).words
    alike = replace(warm, values=np.array([2.1, 2.1004]))
    assert 'it is the same within 0.2 % in warm.csv' in difference_of(alike, records).words
    load = replace(
        warm, name='constant_load_torque.tau_l', relative=False, least=1e-4,
        values=np.array([1e-6, 4e-3]), sigmas=np.array([0.0, 5e-5]),
    )  # fmt: skip
    said = difference_of(load, records).words
    assert 'it is next to nothing in cold.csv, 4 mN m (95 %: 3.82 mN m to 4.18 mN m) in w' in said
    loaded = replace(load, values=np.array([4e-3, 4.02e-3]), sigmas=np.array([0.0, 2e-5]))
    said = difference_of(loaded, records).words
    assert 'it is 4 mN m in cold.csv, the same within 59 µN m in warm.csv' in said
    one_file = [replace(r, provenance=Provenance('log.csv')) for r in records]
    assert 'against record 1' in difference_of(weak, one_file).words
