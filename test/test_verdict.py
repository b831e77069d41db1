"""Who wins a round, what is doubted, what a ladder comes to: the rules, one at a time."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from motor_sysid.diagnosis.result.result import Verdict
from motor_sysid.diagnosis.search.gates import (
    NO_EVIDENCE,
    SURE,
    TOO_LITTLE,
    UNCERTAIN,
    UNPHYSICAL,
    UNSTEADY,
)
from motor_sysid.diagnosis.search.ranking import (
    doubts,
    holds_its_own,
    may_rival,
    rivals_alone,
    rivals_of,
    winner_of,
)
from motor_sysid.diagnosis.search.synonyms import other_names
from motor_sysid.diagnosis.search.trial import searching, Trial
from motor_sysid.diagnosis.verdict.evidence import as_trifles, half_a_sample, notes_of
from motor_sysid.diagnosis.verdict.verdict import (
    besides,
    contested,
    last_goes,
    verdict_of,
)
from motor_sysid.diagnosis.where import predictable, remainder
from motor_sysid.diagnosis.where.remainder import examine_remainder, Remainder
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.physics.parameters import Parameter, ParameterSet
from motor_sysid.physics.scales import scales_of
from motor_sysid.signals import Record

FLOOR = 1.0
MOTOR = {'R': 1.0, 'L': 1e-3, 'k_t': 0.05, 'J': 1e-5, 'b': 1e-5}
UNITS = {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'}
NOISE = Remainder({}, FLOOR, 1.05 * FLOOR, 1.05, 0.0)
LEFT = Remainder({}, FLOOR, 4.0, 4.0, 0.9)


WAVES = np.random.default_rng(2).normal(size=(2, 1000))
"""Two changes of an output that have nothing in common."""


def run(change, model=None):
    """Return a fit that changes an output by so much, and the model that it is of."""
    runs = SimpleNamespace(predictions=({'speed': 10.0 + change},))
    return SimpleNamespace(model=model, training=runs, validation=SimpleNamespace(predictions=()))


def fitted(key, values=None, beside=()):
    """Return a model with an effect, at given values, and with others."""
    t = 1e-3 * np.arange(1000)
    columns = {'voltage': np.sin(9 * t), 'current': np.sin(9 * t), 'speed': np.sin(9 * t)}
    scales = scales_of('brushed_dc', MOTOR, [Record(t, columns, UNITS)])
    model = Model.base('brushed_dc', MOTOR)
    for other in beside:
        model = model.with_effect(other, {}, scales)
    return model.with_effect(key, values or {}, scales)


def trial(
    key, delta_bic, *, note='', excess=1.0, inherits=False, gain=10.0, change=WAVES[0],
    values=None, beside=(),
):  # fmt: skip
    """Return the trial of an effect as it came out."""
    variant = SimpleNamespace(effect=effect(key), inherits=inherits)
    model = fitted(key, values, beside)
    fit = run(change, model)
    return Trial(SimpleNamespace(variant=variant), fit, delta_bic, gain, 1.0, note, excess)


BASE = run(0.0 * WAVES[0])


NAMED = {'a': 'coulomb_friction', 'b': 'quadratic_drag', 'c': 'iron_loss', 'd': 'supply_sag'}
"""Effects by the names that they have in these tests."""


def rung(
    error_percent, unidentifiable=(), *, effects=(), friction=1e-5, training=5.0, untold=()
):  # fmt: skip
    """Return a fit with those errors and a viscous friction told to a tenth.

    Of its effects those that are `untold` are no further than their standard error from zero.
    """
    b = Parameter('b', 'N m s/rad', friction, 1e-12, 10.0, '', sigma=0.1 * friction)
    keys = tuple(NAMED.get(one, one) for one in effects)
    own = [
        Parameter(f'{key}.{a.name}', a.unit, 1.0, -10.0, 10.0, '',
                  sigma=1.0 if one in untold else 0.1)
        for one, key in zip(effects, keys, strict=True) for a in effect(key).card.amplitudes
    ]  # fmt: skip
    return SimpleNamespace(
        model=SimpleNamespace(
            effects=keys, parameters=ParameterSet((b, *own)), kind=motor('brushed_dc')
        ),
        held=SimpleNamespace(
            error_percent=error_percent, channel_percent={'speed': error_percent}
        ),
        training=SimpleNamespace(error_percent=training),
        result=SimpleNamespace(unidentifiable=unidentifiable, undetermined=unidentifiable),
    )


def verdict(*rungs, left=NOISE, rivals=None, accounted=1.0, doubted=False):
    return verdict_of([(one, []) for one in rungs], left, rivals or {}, accounted, doubted)


# --- who wins


def test_the_best_wins():
    passing = [trial('quadratic_drag', 500.0), trial('cogging_torque', 400.0)]
    assert winner_of(passing).key == 'quadratic_drag'


@pytest.mark.parametrize(('gain', 'wins'), [(260.0, 'coulomb_friction'),
                                            (240.0, 'stribeck_friction')])  # fmt: skip
def test_a_special_case_goes_first_where_it_explains_half(gain, wins):
    passing = [trial('stribeck_friction', 500.0), trial('coulomb_friction', gain)]
    assert winner_of(passing).key == wins


def test_special_cases_are_followed_to_the_end_of_their_chain():
    passing = [
        trial('lugre_friction', 500.0), trial('stribeck_friction', 400.0),
        trial('coulomb_friction', 240.0),
    ]  # fmt: skip
    assert winner_of(passing).key == 'coulomb_friction'


@pytest.mark.parametrize(('gain', 'wins'), [(495.0, 'quadratic_drag'),
                                            (480.0, 'lugre_friction')])  # fmt: skip
def test_of_equals_one_that_keeps_what_the_model_has_goes_first(gain, wins):
    passing = [trial('lugre_friction', 500.0, inherits=True), trial('quadratic_drag', gain)]
    assert winner_of(passing).key == wins


def test_a_special_case_goes_before_equals():
    passing = [
        trial('lugre_friction', 500.0, inherits=True), trial('quadratic_drag', 495.0),
        trial('stribeck_friction', 400.0),
    ]  # fmt: skip
    assert winner_of(passing).key == 'stribeck_friction'


@pytest.mark.parametrize(
    ('behind', 'excess', 'rivals'),
    [
        (9.0, 1.0, ('cogging_torque',)),
        (11.0, 1.0, ()),
        (19.0, 1.05, ()),
        (19.0, 1.2, ('cogging_torque',)),
        (21.0, 1.2, ()),
    ],
)
def test_a_rival_is_close_behind_and_closer_where_only_noise_is_left(behind, excess, rivals):
    """Within 10, or within 2 % of the winner's 1000 where it leaves more than noise."""
    best = trial('quadratic_drag', 1000.0, excess=excess)
    assert rivals_of(best, [best, trial('cogging_torque', 1000.0 - behind)], BASE) == rivals


@pytest.mark.parametrize(
    ('before', 'keys', 'found'),
    [
        (15.0, ('coulomb_friction',), Verdict.EFFECT_MISSING),  # 0.93 of what is beyond noise
        (15.0, ('supply_sag', 'drive_coast'), Verdict.UNKNOWN_EFFECT),
        (20.0, ('supply_sag', 'drive_coast'), Verdict.EFFECT_MISSING),  # 0.96
    ],
)
def test_two_effects_that_leave_something_predictable_must_explain_more_than_one(
    before, keys, found
):
    """Together they may stand for another: a bridge that clips, say."""
    errors = [before, *((9.0,) if len(keys) > 1 else ()), 4.0]
    ladder = [rung(error, effects=keys[:k]) for k, error in enumerate(errors)]
    assert verdict(*ladder, left=LEFT) is found


def test_what_a_pair_came_to_has_the_rivals_that_it_has_alone():
    """Two effects at once, of which one went again: which one of them may be chance."""
    mine, other = trial('friction_drift', 60.0), trial('iron_loss', 64.0)
    base = run(0.0 * WAVES[0], Model.base('brushed_dc', MOTOR))
    assert rivals_alone([(base, [other, mine]), (mine.rung, [])]) == {
        'friction_drift': ('iron_loss',)
    }
    both = trial('friction_drift', 60.0, beside=('iron_loss',))
    assert rivals_alone([(base, [other, mine]), (both.rung, [])]) == {}


@pytest.mark.parametrize(
    ('note', 'rival'), [('', True), (UNCERTAIN, True), (NO_EVIDENCE, False), (UNPHYSICAL, False)]
)
def test_an_effect_of_uncertain_size_may_rival(note, rival):
    """A delay and a lag that explain the same are rivals, though one alone is sure of its size."""
    assert may_rival(trial('input_delay', 995.0, note=note)) is rival


@pytest.mark.parametrize(
    ('gain', 'note', 'rival'),
    [
        ((0.9, 0.2), TOO_LITTLE, True), ((5.2, 4.8), TOO_LITTLE, True),
        ((6.0, 4.8), TOO_LITTLE, False), ((0.4, -0.2), TOO_LITTLE, False),
        ((0.9, 0.2), NO_EVIDENCE, False),
    ],
)  # fmt: skip
def test_where_held_out_data_say_little_of_the_winner_they_rule_out_no_rival(gain, note, rival):
    """They lower its error, and that of the other by nearly as much, but not enough to pass."""
    best = trial('coulomb_friction', 1000.0, gain=gain[0])
    other = trial('iron_loss', 1100.0, note=note, gain=gain[1])
    assert may_rival(other, best) is rival
    assert not may_rival(other)


@pytest.mark.parametrize(
    ('behind', 'gain', 'first'),
    [
        (19.0, 20.0, 'speed_sensor_offset'),  # an error of 80 % in place of 90
        (19.0, 10.8, 'constant_load_torque'), (21.0, 20.0, 'constant_load_torque'),
    ],
)  # fmt: skip
def test_of_what_has_much_the_same_evidence_what_runs_clearly_better_goes_first(
    behind, gain, first
):
    """Within 2 % of the evidence, however little a noise model that is astray says is left."""
    best = trial('constant_load_torque', 1000.0, gain=10.0, excess=0.8)
    other = trial('speed_sensor_offset', 1000.0 - behind, gain=gain, excess=0.8)
    assert winner_of([best, other]).key == first


def test_a_special_case_is_no_rival():
    best = trial('stribeck_friction', 1000.0)
    assert rivals_of(best, [best, trial('coulomb_friction', 999.0)], BASE) == ()
    best = trial('coulomb_friction', 1000.0)
    assert rivals_of(best, [best, trial('stribeck_friction', 999.0)], BASE) == ()


def test_the_same_law_under_another_name_is_no_rival():
    """Coulomb friction beside a constant load is asymmetric Coulomb friction."""
    load = trial('constant_load_torque', 1000.0)
    wider = trial('asymmetric_coulomb_friction', 1001.0, inherits=True)
    assert winner_of([wider, load]) is load
    assert rivals_of(load, [wider, load], BASE) == ()
    fresh = trial('asymmetric_coulomb_friction', 1001.0)
    assert rivals_of(load, [fresh, load], BASE) == ('asymmetric_coulomb_friction',)


def test_what_changes_other_things_in_the_outputs_is_no_rival():
    """Two effects that gain alike by different changes are both missing."""
    best = trial('input_delay', 1000.0)
    half = trial('lugre_friction', 999.0, change=0.8 * WAVES[0] + 0.3 * WAVES[1])
    other = trial('lugre_friction', 999.0, change=WAVES[1])
    assert rivals_of(best, [best, half], BASE) == ('lugre_friction',)
    assert rivals_of(best, [best, other], BASE) == ()


def test_a_gain_that_is_lost_in_noise_has_every_rival_that_is_near():
    """Within 2 % of the evidence, whatever else they change; what lowers the error has none."""
    def near(behind):
        return trial('lugre_friction', 1000.0 - behind, change=WAVES[1])

    for gain, behind, rivals in [
        (0.5, 19.0, ('lugre_friction',)), (0.5, 21.0, ()), (2.0, 9.0, ()),
    ]:  # fmt: skip
        best = trial('input_delay', 1000.0, gain=gain)
        assert rivals_of(best, [best, near(behind)], BASE) == rivals


@pytest.mark.parametrize(('bend', 'wins'), [(1.0, 'lugre_friction'),
                                            (0.0, 'stribeck_friction')])  # fmt: skip
def test_bristles_that_do_not_bend_are_a_special_case(bend, wins):
    """A shape on its lower bound makes a law the special case, however little that explains."""
    p = fitted('lugre_friction').parameters['lugre_friction.z_s']
    z_s = p.lower * (p.upper / p.lower) ** (0.5 * bend)
    passing = [
        trial('lugre_friction', 500.0, values={'z_s': z_s}), trial('stribeck_friction', 190.0)
    ]  # fmt: skip
    assert winner_of(passing).key == wins


def test_an_offset_of_the_speed_is_a_load_unless_something_depends_on_the_motion():
    offset, load = trial('speed_sensor_offset', 1000.0), trial('constant_load_torque', 999.0)
    assert rivals_of(offset, [offset, load], BASE) == ()
    assert rivals_of(load, [load, offset], BASE) == ()
    offset = trial('speed_sensor_offset', 1000.0, beside=('coulomb_friction',))
    load = trial('constant_load_torque', 999.0, beside=('coulomb_friction',))
    assert rivals_of(offset, [offset, load], BASE) == ('constant_load_torque',)


def test_the_other_name_is_told():
    both = fitted('constant_load_torque', beside=('brush_voltage_drop', 'coulomb_friction'))
    (line,) = other_names(both)
    assert 'together are the same law as asymmetric Coulomb friction' in line
    assert other_names(fitted('asymmetric_coulomb_friction')) == [line]
    assert other_names(fitted('coulomb_friction', beside=('gravity_load',))) == []
    for key in ('speed_sensor_offset', 'constant_load_torque'):
        (line,) = other_names(fitted(key, beside=('brush_voltage_drop',)))
        assert 'constant load torque is the same law as speed sensor offset' in line
        known = fitted(key).with_free(['current_offset'], free=False)
        assert other_names(known) == []
    counts = fitted('constant_load_torque').with_speed_sensor(SpeedSensor.DIFFERENCE)
    assert other_names(counts) == []


def test_a_dead_time_that_brushes_may_make_is_told_as_both():
    (line,) = other_names(fitted('inverter_dead_time'))
    assert line == (
        'brush voltage drop that is as gradual is the same law as inverter dead time: no record '
        'tells which of the two it is.'
    )
    assert other_names(fitted('inverter_dead_time'), ['brush_voltage_drop']) == []
    assert other_names(fitted('stribeck_friction')) == []
    six_step = Model.base('bldc_six_step', MOTOR).with_effect('inverter_dead_time', {'v_d': 0.2})
    assert other_names(six_step) == []


@pytest.mark.parametrize('named', [True, False])
def test_what_a_fit_says_of_a_model_that_is_not_shown_is_not_told(named):
    model = fitted('coulomb_friction')
    said = [
        SimpleNamespace(unidentifiable=[f'{k} a'], warnings=[f'{k} b'], model=model)
        for k in (0, 1)
    ]
    ladder = [(SimpleNamespace(result=result), []) for result in said]
    bench = SimpleNamespace(records=[{}], outputs=('speed',), sensors=tuple(SpeedSensor))
    assert notes_of(ladder, bench, named=named) == (f'{named:d} a', f'{named:d} b')


def test_half_a_sample_is_told_where_nothing_but_the_speed_tells():
    record = Record(np.arange(3) * 4e-3, {'speed': np.zeros(3)}, UNITS)
    units = {**UNITS, 'position': 'rad'}
    beside = Record(record.time, dict.fromkeys(('speed', 'position'), np.zeros(3)), units)
    late = fitted('input_delay')
    both = SpeedSensor.IDEAL, SpeedSensor.DIFFERENCE
    bench = SimpleNamespace(records=[record], outputs=('speed',), sensors=both)
    (words,) = half_a_sample(late, bench)
    assert 'of the moment; if it is its mean' in words
    assert 'input_delay.delay is 2 ms shorter' in words
    (words,) = half_a_sample(late.with_speed_sensor(SpeedSensor.DIFFERENCE), bench)
    assert 'input_delay.delay is 2 ms longer' in words
    known = [
        SimpleNamespace(records=[beside], outputs=('speed',), sensors=both),
        SimpleNamespace(records=[record], outputs=('current', 'speed'), sensors=both),
        SimpleNamespace(records=[record], outputs=('speed',), sensors=both[:1]),
    ]
    assert [half_a_sample(late, one) for one in known] == [(), (), ()]
    assert half_a_sample(fitted('coulomb_friction'), bench) == ()


# --- what is doubted


@pytest.mark.parametrize(('share', 'doubted'), [(0.25, ['coulomb_friction']), (0.15, [])])
def test_an_effect_is_doubted_if_another_explains_a_fifth_on_top_of_it(share, doubted):
    on_top = [trial('cogging_torque', share * 1000.0, note='no evidence')]
    assert doubts(on_top, {'coulomb_friction': 1000.0}) == doubted


def test_each_effect_is_measured_by_its_own_gain():
    gains = {'coulomb_friction': 1000.0, 'armature_heating': 100.0}
    assert doubts([trial('cogging_torque', 50.0)], gains) == ['armature_heating']


def test_what_physics_forbids_casts_no_doubt():
    on_top = [trial('quadratic_drag', 900.0, note=UNPHYSICAL)]
    assert doubts(on_top, {'coulomb_friction': 1000.0}) == []


def test_what_makes_the_held_out_error_larger_casts_no_doubt():
    on_top = [trial('current_sensor_lag', 900.0, note='no use', gain=-5.0)]
    assert doubts(on_top, {'coulomb_friction': 1000.0}) == []


def test_a_further_set_of_waves_casts_no_doubt_on_the_first():
    assert doubts([trial('cogging_torque_2', 900.0)], {'cogging_torque': 1000.0}) == []


@pytest.mark.parametrize(
    ('named', 'other'),
    [('coulomb_friction', 'stribeck_friction'), ('stribeck_friction', 'coulomb_friction')],
)
def test_wider_and_narrower_forms_cast_no_doubt(named, other):
    assert doubts([trial(other, 900.0)], {named: 1000.0}) == []


@pytest.mark.parametrize(('gain', 'note', 'holds'), [(7.9, '', True), (8.1, '', False),
                                                     (8.1, UNPHYSICAL, True)])  # fmt: skip
def test_what_lowers_the_error_by_much_holds_its_own_against_what_does_not(gain, note, holds):
    """The last effect took away 40 % of the held-out error: a fifth of that is 8 %."""
    def fitted(percent):
        return SimpleNamespace(held=SimpleNamespace(channel_percent={'speed': percent}))

    on_top = [trial('quadratic_drag', 900.0, gain=-3.0),
              trial('cogging_torque', 900.0, gain=gain, note=note)]  # fmt: skip
    assert holds_its_own(fitted(6.0), fitted(10.0), on_top) is holds


# --- what a ladder comes to


def test_nothing_added_is_complete_or_unknown():
    assert verdict(rung(1.05)) is Verdict.COMPLETE
    assert verdict(rung(4.0), left=LEFT) is Verdict.UNKNOWN_EFFECT


@pytest.mark.parametrize(
    ('current', 'speed', 'said'),
    [
        (60.0, 97.0, Verdict.INSUFFICIENT_DATA),  # the motor rests
        (60.0, np.nan, Verdict.INSUFFICIENT_DATA),  # and not one count shows
        (60.0, 0.5, Verdict.COMPLETE),  # a poor sensor, or a current that is held at nothing
        (0.5, 60.0, Verdict.COMPLETE),
    ],
)
def test_no_model_is_complete_where_sensors_show_their_noise(current, speed, said):
    one = rung(60.0)
    one.held.channel_percent = {'current': current, 'speed': speed}
    assert verdict(one, left=Remainder({}, 59.0, 60.0, 1.05, 0.0)) is said


@pytest.mark.parametrize(
    ('error', 'floor', 'said'),
    [
        (59.0, 12.0, Verdict.UNKNOWN_EFFECT),
        (12.0, 4.0, Verdict.COMPLETE),  # a random load, say
        (9.0, 0.5, Verdict.COMPLETE),
    ],
)
def test_a_model_that_misses_much_is_not_complete_even_if_nothing_predicts_it(error, floor, said):
    left = Remainder({}, floor, error, 20.0, 0.05)
    assert verdict(rung(error), left=left) is said


def test_what_leaves_more_than_it_explains_is_not_named():
    left = Remainder({}, FLOOR, 3.8, 1.2, 0.2)
    assert not left.structured
    assert verdict(rung(4.0), rung(3.8), left=left) is Verdict.UNKNOWN_EFFECT
    assert verdict(rung(4.0), rung(3.4), left=left) is Verdict.EFFECT_MISSING
    assert verdict(rung(1.2), rung(1.15), left=left) is Verdict.COMPLETE, 'a trifle'
    noise = Remainder({}, FLOOR, 3.8, 1.2, 0.5, beyond_percent=0.5)
    assert verdict(rung(4.0), rung(3.8), left=noise) is Verdict.EFFECT_MISSING, 'is sensor noise'
    faint = Remainder({}, FLOOR, 4.0, 1.2, 0.01)
    assert verdict(rung(4.0), rung(4.0), left=faint) is Verdict.EFFECT_MISSING


def test_two_undetermined_parameters_are_too_vague_unless_something_is_seen_to_be_missing():
    assert verdict(rung(1.05, ('L',))) is Verdict.COMPLETE
    assert verdict(rung(1.05, ('L', 'b'))) is Verdict.INSUFFICIENT_DATA
    assert verdict(rung(4.0, ('L', 'b')), left=LEFT) is Verdict.UNKNOWN_EFFECT
    assert verdict(rung(4.0, ('L', 'b')), rung(1.05)) is Verdict.EFFECT_MISSING
    assert verdict(rung(4.0, ('L', 'b')), rung(2.5, ('L', 'b'))) is Verdict.INSUFFICIENT_DATA
    assert verdict(rung(4.0, ('L', 'b')), rung(1.05, ('L', 'b'))) is Verdict.EFFECT_MISSING


def test_what_was_added_is_missing_and_a_rival_makes_it_ambiguous():
    assert verdict(rung(10.0), rung(1.05)) is Verdict.EFFECT_MISSING
    nobody, somebody = {'coulomb_friction': ()}, {'coulomb_friction': ('quadratic_drag',)}
    assert verdict(rung(10.0), rung(1.05), rivals=nobody) is Verdict.EFFECT_MISSING
    assert verdict(rung(10.0), rung(1.05), rivals=somebody) is Verdict.AMBIGUOUS


@pytest.mark.parametrize(('after', 'said'), [(4.0, Verdict.UNKNOWN_EFFECT),
                                             (3.0, Verdict.EFFECT_MISSING)])  # fmt: skip
def test_where_something_remains_what_is_named_must_explain_nine_tenths(after, said):
    """Of the squared error beyond noise: (100 - 16) / 99 and (100 - 9) / 99."""
    assert verdict(rung(10.0), rung(after), left=LEFT) is said
    assert verdict(rung(10.0), rung(after)) is Verdict.EFFECT_MISSING


@pytest.mark.parametrize(('after', 'said'), [(3.0, Verdict.UNKNOWN_EFFECT),
                                             (2.0, Verdict.EFFECT_MISSING)])  # fmt: skip
def test_a_doubted_effect_is_named_only_if_it_explains_nearly_all(after, said):
    """Of the squared error beyond noise: (100 - 9) / 99 and (100 - 4) / 99."""
    assert verdict(rung(10.0), rung(after), doubted=True) is said
    assert verdict(rung(10.0), rung(after)) is Verdict.EFFECT_MISSING


@pytest.mark.parametrize(
    ('after', 'accounted', 'said'),
    [
        (3.0, 0.94, Verdict.UNKNOWN_EFFECT),
        (3.0, 0.96, Verdict.EFFECT_MISSING),
        (2.0, 0.94, Verdict.EFFECT_MISSING),  # nearly all of the error itself
    ],
)
def test_a_neighbour_leaves_more_than_a_twentieth_of_the_whitened_squares(
    after, accounted, said
):
    assert verdict(rung(10.0), rung(after), accounted=accounted) is said


@pytest.mark.parametrize(('last', 'said'), [(4.5, Verdict.UNKNOWN_EFFECT),
                                            (4.3, Verdict.EFFECT_MISSING)])  # fmt: skip
def test_of_several_effects_none_may_take_away_less_than_what_is_left(last, said):
    """It takes away 36 - 20.2 or 36 - 18.5; nine tenths of the rest are 18.2 or 16.6."""
    left = Remainder({}, FLOOR, last, last, 0.9)
    steps = [rung(40.0), rung(6.0, effects=('a',)), rung(last, effects=('a', 'b'))]
    assert verdict(*steps, left=left) is said
    noise = Remainder({}, FLOOR, last, 1.1, 0.9)
    assert verdict(*steps, left=noise) is Verdict.EFFECT_MISSING


def test_the_last_of_several_goes_alone_if_it_alone_takes_away_less_than_what_is_left():
    left = Remainder({}, FLOOR, 4.5, 4.5, 0.9)
    base, one = (rung(40.0), []), (rung(6.0, effects=('a',)), [])
    ladder = [base, one, (rung(4.5, effects=('a', 'b')), [])]
    assert last_goes(ladder, left)
    assert not last_goes(ladder, Remainder({}, FLOOR, 4.5, 1.1, 0.9))
    assert not last_goes(ladder[:2], left)
    little = (rung(39.9, effects=('a',)), [])
    assert not last_goes([base, little, ladder[-1]], left)
    both = [(rung(6.1), []), (rung(6.0, effects=('a',)), []), (rung(5.9, effects=('a', 'b')), [])]
    assert not last_goes(both, Remainder({}, FLOOR, 5.9, 5.9, 0.9))


def test_what_cannot_be_told_from_nothing_is_not_named_where_something_else_is_left():
    base, told = rung(40.0), rung(4.0, effects='a')
    faint = rung(4.0, effects='a', untold='a')
    assert verdict(base, told, left=LEFT) is Verdict.EFFECT_MISSING
    assert verdict(base, faint, left=LEFT) is Verdict.UNKNOWN_EFFECT
    assert verdict(base, faint) is Verdict.EFFECT_MISSING, 'a combination may be all that is seen'
    given = rung(40.0, effects='a', untold='a')
    assert verdict(given, rung(4.0, effects='ab', untold='a'), left=LEFT) is Verdict.EFFECT_MISSING
    ladder = [(one, []) for one in (base, told, rung(3.0, effects='ab', untold='b'))]
    assert last_goes(ladder, LEFT)
    assert not last_goes(ladder, NOISE)
    assert not last_goes([(base, []), (faint, [])], LEFT), 'the only one stays, unnamed'


def test_a_model_that_knows_nothing_names_nothing():
    left = Remainder({}, FLOOR, 60.0, 60.0, 0.9)
    assert verdict(rung(900.0), rung(60.0, effects='a'), left=left) is Verdict.UNKNOWN_EFFECT
    assert verdict(rung(900.0), rung(40.0, effects='a'), left=left) is Verdict.EFFECT_MISSING
    noise = Remainder({}, 59.0, 60.0, 1.01, 0.0)
    assert verdict(rung(900.0), rung(60.0, effects='a'), left=noise) is Verdict.EFFECT_MISSING


def test_an_effect_that_only_leads_to_the_next_is_counted_with_it():
    """Of what is left, 0.9 * 20.2 %^2 has a shape."""
    left = Remainder({}, FLOOR, 4.5, 4.5, 0.9)
    base, ahead, both = rung(60.0), rung(90.0, effects=('a',)), rung(11.0, effects=('a', 'b'))
    exchanged, last = rung(4.5, effects=('c', 'd')), rung(4.5, effects=('a', 'b', 'c'))
    assert verdict(base, ahead, both, exchanged, left=left) is Verdict.EFFECT_MISSING
    assert verdict(base, ahead, both, last, left=left) is Verdict.EFFECT_MISSING
    little = [rung(10.9, effects=('a', 'b', 'c')), rung(10.8, effects=('a', 'b', 'c', 'd'))]
    more = Remainder({}, FLOOR, 10.8, 10.8, 0.9)
    assert verdict(base, ahead, both, *little, left=more) is Verdict.UNKNOWN_EFFECT
    ladder = [(one, []) for one in (base, both, rung(11.5, effects=('a', 'b', 'c')))]
    assert last_goes(ladder, Remainder({}, FLOOR, 11.5, 11.5, 0.9))


def test_what_took_the_place_of_another_took_nothing_away_itself():
    left = Remainder({}, FLOOR, 4.5, 4.5, 0.9)
    steps = [rung(40.0), rung(4.6, effects=('a',)), rung(4.5, effects=('b',))]
    assert verdict(*steps, left=left) is Verdict.EFFECT_MISSING


def test_what_does_away_with_a_known_friction_is_not_named():
    assert verdict(rung(10.0), rung(1.05, friction=1e-12)) is Verdict.UNKNOWN_EFFECT
    several = rung(1.05, friction=1e-12, effects=('a', 'b'))
    assert verdict(rung(10.0), rung(2.0, effects=('a',)), several) is Verdict.EFFECT_MISSING
    shaped = Remainder({}, FLOOR, 2.5, 1.4, 0.2)
    assert shaped.structured
    steps = rung(40.0), rung(3.0, effects=('a',)), rung(2.5, friction=1e-12, effects=('a', 'b'))
    assert verdict(*steps, left=shaped) is Verdict.UNKNOWN_EFFECT
    assert verdict(*steps) is Verdict.EFFECT_MISSING
    less = rung(1.5, friction=1e-12, effects=('a', 'b'))
    assert verdict(rung(10.0), rung(2.0, effects=('a',)), less) is Verdict.UNKNOWN_EFFECT
    for before, said in ((49.0, Verdict.UNKNOWN_EFFECT), (51.0, Verdict.EFFECT_MISSING)):
        assert verdict(rung(before), rung(1.05, friction=1e-12)) is said, 'what it knew'
    assert verdict(rung(51.0), rung(6.0, friction=1e-12)) is Verdict.UNKNOWN_EFFECT
    unknown_before = rung(10.0, friction=1e-12)
    assert verdict(unknown_before, rung(1.05, friction=1e-12)) is Verdict.EFFECT_MISSING


@pytest.mark.parametrize(('before', 'said'), [(1.35, Verdict.COMPLETE),
                                              (1.45, Verdict.UNKNOWN_EFFECT)])  # fmt: skip
def test_doubt_about_a_trifle_is_no_lack(before, said):
    """Beyond a noise of 1 % there are 0.9 and 1.05 % of the signal."""
    assert verdict(rung(before), rung(before - 0.05), doubted=True) is said


def test_next_to_nothing_of_what_random_loads_make_is_no_lack():
    """Of 10 % beside a noise of 1 %, with nothing in it that could be predicted."""
    assert verdict(rung(10.0), rung(9.95), doubted=True) is Verdict.COMPLETE
    assert verdict(rung(10.0), rung(9.85), doubted=True) is Verdict.UNKNOWN_EFFECT, 'more falls'
    told = rung(10.0, training=5.0), rung(9.95, training=4.5)
    assert verdict(*told, doubted=True) is Verdict.UNKNOWN_EFFECT, 'training data say otherwise'
    near = rung(1.02), rung(1.012)
    assert verdict(*near, left=LEFT, doubted=True) is Verdict.UNKNOWN_EFFECT, 'of a shape'


def test_a_trifle_that_an_effect_does_away_with_is_a_lack_all_the_same():
    assert verdict(rung(1.35), rung(1.25), doubted=True) is Verdict.COMPLETE
    assert verdict(rung(1.35), rung(1.2), doubted=True) is Verdict.UNKNOWN_EFFECT


# --- the price of searching


@pytest.mark.parametrize(
    ('key', 'places'),
    [
        ('coulomb_friction', 1), ('cogging_torque', 400), ('torque_ripple', 400),
        ('periodic_load', 5000), ('load_torque_step', 100), ('inertia_change', 100),
    ],
)  # fmt: skip
def test_a_shape_that_was_looked_for_pays_for_the_places_where_it_was(key, places):
    assert searching(effect(key), 10_000) == pytest.approx(2 * np.log(places))


# --- what remains


@pytest.mark.parametrize(
    ('error_percent', 'over_floor', 'predictable', 'structured'),
    [
        (3.0, 3.0, 0.3, True),
        (1.5, 3.0, 0.3, False),  # 1.5 sqrt(0.3) = 0.8 % of the signal: a trifle
        (2.0, 3.0, 0.3, True),  # 1.1 %
        (3.0, 3.0, 0.08, False),  # cannot be predicted
        (3.0, 1.2, 0.9, False),  # the sensors make that
        (0.9, 9.0, 1.0, False),  # all of it can be predicted, and it is a trifle
    ],
)
def test_what_remains_counts_if_it_is_beyond_noise_predictable_and_no_trifle(
    error_percent, over_floor, predictable, structured
):
    left = Remainder({}, 0.1, error_percent, over_floor, predictable)
    assert left.structured is structured


@pytest.mark.parametrize(('unevenness', 'structured'), [(1.2, False), (4.0, True)])
def test_more_than_noise_in_some_record_counts_though_the_held_out_one_has_none(
    unevenness, structured
):
    left = Remainder({}, 3.0, 3.5, 1.15, 0.5, unevenness=unevenness, beyond_percent=1.8)
    assert left.structured is structured


def remaining(count, error, drive=None, reference=None, angle=(), orders=((), ())):
    """Examine a smooth motion of that many samples with an error (N,) that is left of it.

    The last third is held out.
    """
    angle = np.asarray(angle)
    time = 1e-3 * np.arange(count)
    if drive is None:
        drive = np.cumsum(np.random.default_rng(4).normal(size=count))
    runs, chains = [], []
    for part in (slice(0, 2 * count // 3), slice(2 * count // 3, count)):
        measured, residual = (100 * np.sin(7 * time) + error)[part], error[part]
        percent = 100 * np.sqrt(np.mean(residual**2) / np.mean(measured**2))
        led = {} if reference is None else {'speed_reference': reference[part]}
        record = Record(time[part] - time[part][0], led, dict.fromkeys(led, 'rad/s'))
        driven = SimpleNamespace(inputs=drive[part, np.newaxis], position=angle[part], dt=1e-3)
        stretch = SimpleNamespace(scored=True, scored_from=0, record=record, drive=driven)
        chains.append([[stretch]])
        runs.append(SimpleNamespace(
            measured=(measured[:, np.newaxis],), residuals=(residual[:, np.newaxis],),
            error_percent=percent,
        ))  # fmt: skip
    data = runs[0], runs[1], runs[1], tuple(chains)
    return examine_remainder(('speed',), *data, (False,), orders)


@pytest.mark.parametrize(('beyond', 'structured'), [(0.9, False), (1.1, True)])
def test_physics_in_one_output_is_not_as_large_as_the_noise_of_another(beyond, structured):
    """The current has all of the 4 % that remain, half of the speed's can be predicted."""
    left = Remainder({}, 3.9, 4.0, 2.0, 0.5, beyond_percent=beyond)
    assert left.structured is structured


def test_what_is_beyond_noise_is_taken_of_each_output():
    left = remaining(12_000, slow_noise(12_000))
    assert left.beyond_percent < left.error_percent
    floor = left.error_percent**2 - left.beyond_percent**2
    assert floor == pytest.approx(left.floor_percent**2, rel=1e-6)


def test_sensors_are_no_worse_over_held_out_data_than_over_training_data():
    """A swing of five samples looks like noise where it is; the training data have none of it."""
    place, rng = np.arange(12_000), np.random.default_rng(12)
    swing = np.where(place < 8_000, 0.0, 30 * np.sin(2 * np.pi / 5 * place))
    left = remaining(12_000, swing + 3 * rng.normal(size=12_000))
    assert left.floor['speed'] == pytest.approx(3, rel=0.1)
    assert left.over_floor > 5
    assert left.large


def slow_noise(count):
    """Return noise that lasts some samples: beyond what a sensor makes, and not the motor's."""
    rng, noise = np.random.default_rng(9), np.zeros(count)
    for k in range(1, count):
        noise[k] = 0.9 * noise[k - 1] + rng.normal()
    return 3 * noise


def test_a_record_too_short_to_tell_noise_from_physics_is_not_called_noise():
    short, long = (remaining(count, slow_noise(count)) for count in (900, 12_000))
    assert short.above_floor
    assert long.above_floor
    assert short.predictable == 1.0
    assert short.structured
    assert long.predictable < 0.1
    assert not long.structured


def test_what_a_controller_answers_to_a_random_load_is_not_physics():
    """Its input predicts the load; with the reference known, only what that leads to counts."""
    count = 12_000
    load, reference = slow_noise(count), np.sign(np.sin(5e-3 * np.arange(count)))
    drive = 5 * reference + np.convolve(load, np.ones(20) / 20)[:count]
    assert remaining(count, load, drive).predictable > 0.5
    assert remaining(count, load, drive, reference).predictable < 0.1
    law = load + 20 * np.convolve(reference, np.ones(50) / 50)[:count]
    assert remaining(count, law, drive, reference).predictable > 0.5


def test_an_output_that_shows_nothing_makes_no_part_of_the_noise():
    """The speed of a motor that rests is nothing; a share of it is no number."""
    assert remainder._percent(np.array([0.04, 1e-6]), np.array([2.0, 0.0])) == pytest.approx(10.0)
    assert remainder._percent(np.zeros(2), np.zeros(2)) == 0.0


def test_a_function_of_the_motion_is_predictable():
    motion = np.sin(7e-3 * np.arange(12_000))
    found = remaining(12_000, 5 * np.tanh(20 * motion) + 0.1 * slow_noise(12_000))
    assert found.predictable > 0.9
    assert found.structured


def test_waves_that_go_with_what_is_measured_are_predictable_by_their_number_per_turn():
    """A ripple of the torque changes its sign with the current: no plain wave is like it."""
    time = 1e-3 * np.arange(12_000)
    angle, current = 9 * time + 2 * np.sin(3 * time), 100 * np.sin(7 * time)
    ripple = 0.05 * current * np.cos(17 * angle) + 0.1 * slow_noise(12_000)
    assert remaining(12_000, ripple, angle=angle, orders=((17,), ())).predictable < 0.3
    found = remaining(12_000, ripple, angle=angle, orders=((), (17,)))
    assert found.predictable > 0.9
    assert found.waves == (17,)
    plain = remaining(12_000, 0.05 * current + 0.1 * slow_noise(12_000), angle=angle,
                      orders=((), (17,)))  # fmt: skip
    assert plain.predictable > 0.9
    assert plain.waves == ()  # they are not what predicts it


def test_what_comes_once_per_turn_is_predictable_by_the_angle():
    time = 1e-3 * np.arange(12_000)
    angle = 9 * time + 2 * np.sin(3 * time) + np.cumsum(slow_noise(12_000)) * 1e-3
    weight = 5 * np.cos(angle) + 0.1 * slow_noise(12_000)
    assert remaining(12_000, weight, angle=angle).predictable < 0.5
    assert remaining(12_000, weight, angle=angle, orders=((1,), ())).predictable > 0.9


def test_what_any_strength_of_the_ridge_predicts_of_other_blocks_is_no_noise(monkeypatch):
    """Records that hardly move tell little of a feature; in the last quarter all of them do."""
    rng, count, features = np.random.default_rng(6), 400, 240
    size = np.where(np.arange(4 * count) < 3 * count, 0.02, 1.0)
    x = size[:, np.newaxis] * rng.normal(size=(4 * count, features))
    noise = rng.normal(size=(4 * count, 1))
    y = np.where(size == 1.0, x @ (np.arange(features) % 20 == 0), 0.0)[:, np.newaxis] + noise
    both, shares = predictable.cross_validated(x, y), []
    for ridge in predictable._RIDGES:
        monkeypatch.setattr(predictable, '_RIDGES', (ridge,))
        shares.append(predictable.cross_validated(x, y))
    assert both == max(shares) > 0.5
    assert abs(shares[0] - shares[1]) > 1e-3
    assert predictable.cross_validated(x, noise) < 0.01


# --- what training and held-out data do not agree on


ONLY = f'{TOO_LITTLE} 0.0 % only'


@pytest.mark.parametrize(
    ('note', 'evidence', 'held', 'training', 'told'),
    [
        (UNSTEADY, 2.0, 5.5, 5.0, True),
        ('', 2.0, 5.5, 3.0, False),  # it passes
        (UNCERTAIN, 2.0, 5.5, 3.0, False),
        (UNPHYSICAL, 2.0, 5.5, 3.0, False),
        (UNSTEADY, 0.9, 5.5, 3.0, False),  # no overwhelming evidence
        (UNSTEADY, 2.0, 5.65, 5.0, False),  # less than 1 % of the signal: sqrt(5.7^2 - 5.65^2)
        (ONLY, 2.0, 5.69, 4.8, True),  # seen in training: sqrt(5.0^2 - 4.8^2) = 1.4 %
        (ONLY, 2.0, 5.69, 4.95, False),  # 0.7 %
        (ONLY, 2.0, 5.75, 4.8, True),  # it does next to no harm: sqrt(5.75^2 - 5.7^2) = 0.8 %
        (ONLY, 2.0, 5.8, 4.8, False),  # it does harm
        (ONLY, 0.9, 5.69, 3.0, False),
    ],
)
def test_what_held_out_data_contest_is_told(note, evidence, held, training, told):
    variant = SimpleNamespace(effect=effect('cogging_torque'), inherits=False)
    one = Trial(
        SimpleNamespace(variant=variant), rung(held, training=training),
        evidence * SURE * 20.0, 2.0, 0.6, note, 1.0,
    )  # fmt: skip
    assert contested([one], rung(5.7), 20.0) is (one if told else None)
    if told:
        assert 'speak for cogging' in besides(one, rung(5.7))


def test_on_a_complete_model_what_passes_is_too_little():
    """Nobody reads that nothing is missing, and below it that something helps."""
    @dataclass(frozen=True)
    class Line:
        note: str = ''
        candidates: tuple = ()

    shown = as_trifles(Line(candidates=(Line(), Line('unphysical sign'))))
    assert [one.note for one in shown.candidates] == [
        'what it explains is too little to be named', 'unphysical sign'
    ]  # fmt: skip
