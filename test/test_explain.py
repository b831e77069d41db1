"""The words and the evidence of a verdict."""

from dataclasses import replace
import json
from pathlib import Path
from types import SimpleNamespace

from bench_motor import a_motor, measure, records, voltage_profile
import numpy as np
import pytest

from motor_sysid.cli import main
from motor_sysid.diagnosis import diagnose, Diagnosis, Verdict
from motor_sysid.diagnosis.result.document import diagnosis_document
from motor_sysid.diagnosis.result.result import Candidate, Step
from motor_sysid.diagnosis.search.confusable import rivalries_of
from motor_sysid.diagnosis.verdict import explain, words
from motor_sysid.diagnosis.verdict.blind_spots import blind_spots, undetermined
from motor_sysid.diagnosis.verdict.proof import evidence_of, off_nominal, wrong_parameters
from motor_sysid.diagnosis.where.remainder import Remainder
from motor_sysid.errors import UserError
from motor_sysid.physics.effects import add_effect_file, catalogue
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record
from motor_sysid.workbench.view import load_view, save_view

BASE = {'R': 2.1, 'L': 2.4e-3, 'k_t': 0.046, 'J': 2.6e-5, 'b': 1.3e-5}


def step(model: Model, error: float, candidates: tuple[Candidate, ...] = ()) -> Step:
    prediction = {'speed': np.sin(np.arange(100) / 10)}
    return Step(model, error, error, {'speed': error}, (prediction,), candidates=candidates)


def fitted(values: dict[str, float], sigma: float = 0.01) -> Model:
    """Return the motor with values and a relative standard deviation."""
    model = Model.base('brushed_dc', {**BASE, **values})
    return model.with_estimates({}, {n: sigma * {**BASE, **values}[n] for n in BASE})


def with_friction(values: dict[str, float], sigma: float = 1e-4) -> Model:
    model = fitted(values).with_effect('coulomb_friction', {'tau_c': 6e-3})
    return model.with_estimates({}, {'coulomb_friction.tau_c': sigma})


def tried(key: str, title: str) -> Candidate:
    return Candidate(key, title, 'mechanical', '', 500.0, 1.0, 1.0, {}, passes=True)


def ladder(before: float = 5.0, after: float = 1.0) -> list[Step]:
    found = tried('coulomb_friction', 'Coulomb friction')
    return [step(fitted({'b': 5e-5}), before, (found,)), step(with_friction({}), after)]


# --- evidence ------------------------------------------------------------------------------


def test_evidence_states_gain_interval_and_plausibility():
    (one,) = evidence_of(ladder(), records({}, ['steps'], 2.0), 0.6, {})
    assert one.effect == 'coulomb_friction'
    value, unit, sigma, low, high = one.parameters['tau_c']
    assert (value, unit, sigma) == (pytest.approx(6e-3), 'N m', pytest.approx(1e-4))
    assert (low, high) == (pytest.approx(5.804e-3), pytest.approx(6.196e-3))
    share = 100 * (5.0**2 - 1.0) / (5.0**2 - 0.6**2)
    assert one.error_share_percent == pytest.approx(share)
    assert one.gain_percent == pytest.approx(80)
    assert one.plausible
    for part in ('dBIC 500', '6 mN m', '5.8 mN m to 6.2 mN m', '97 %', '80 %', 'sign', '% of the'):
        assert part in one.words


def test_a_torque_beyond_the_rated_one_is_not_plausible():
    data = records({}, ['steps'], 2.0)
    (fine,) = evidence_of(ladder(), data, 0.6, {'rated_torque': 0.03})
    assert fine.plausible
    assert '20 % of the rated torque' in fine.words
    (odd,) = evidence_of(ladder(), data, 0.6, {'rated_torque': 4e-3})
    assert not odd.plausible
    assert 'hardly plausible' in odd.words


def test_a_weight_that_the_motor_can_only_swing_is_plausible():
    """A pendulum that a weak motor swings up."""
    model = fitted({}).with_effect('gravity_load', {'tau_sin': 12e-3, 'tau_cos': 1e-4})
    model = model.with_estimates({}, {f'gravity_load.{n}': 1e-5 for n in ('tau_sin', 'tau_cos')})
    found = tried('gravity_load', 'gravity load')
    steps = [step(fitted({'b': 5e-5}), 5.0, (found,)), step(model, 1.0)]
    (one,) = evidence_of(steps, records({}, ['steps'], 2.0), 0.6, {'rated_torque': 4e-3})
    assert one.plausible
    assert 'tau_sin is 3 times the rated torque: the motor can swing it, not hold it' in one.words


@pytest.mark.parametrize(('part', 'plausible'), [(0.1, True), (1.5, False)])
def test_a_voltage_that_is_lost_is_held_against_the_largest_one(part, plausible):
    data = records({}, ['steps'], 2.0)
    lost = part * float(np.quantile(np.abs(data[0]['voltage']), 0.999))
    model = fitted({}).with_effect('brush_voltage_drop', {'v_b': lost})
    model = model.with_estimates({}, {'brush_voltage_drop.v_b': 1e-3})
    found = tried('brush_voltage_drop', 'brush voltage drop')
    (one,) = evidence_of([step(fitted({}), 5.0, (found,)), step(model, 1.0)], data, 0.6, {})
    assert one.plausible == plausible
    words = 'v_b is 10 % of' if plausible else 'v_b is more than'
    assert f'{words} the largest voltage' in one.words


def test_an_amplitude_that_cannot_be_told_from_zero_is_not_plausible():
    steps = ladder()
    steps[1] = step(with_friction({}, sigma=5e-3), 1.0)
    (one,) = evidence_of(steps, records({}, ['steps'], 2.0), 0.6, {})
    assert not one.plausible
    assert 'cannot be told from zero' in one.words


def test_an_amplitude_that_is_seen_only_in_combination_is_said_to_be():
    steps = ladder()
    steps[1] = step(with_friction({}, sigma=np.inf), 1.0)
    (one,) = evidence_of(steps, records({}, ['steps'], 2.0), 0.6, {})
    assert one.plausible
    assert 'tau_c only in combination' in one.words
    assert 'inf' not in one.words


def test_an_amplitude_whose_shape_is_unknown_is_told_together_with_it():
    """A winding that warms by as much in a shorter time: h and t_th are told together only."""
    heated = fitted({}).with_effect('armature_heating', {'h': 0.02, 't_th': 13.0})
    steps = [
        step(fitted({}), 2.0, (tried('armature_heating', 'armature heating'),)),
        step(heated.with_estimates({}, {'armature_heating.h': 0.011,
                                        'armature_heating.t_th': 16.0}), 1.0),
    ]  # fmt: skip
    (one,) = evidence_of(steps, records({}, ['steps'], 2.0), 0.6, {})
    assert one.plausible
    assert 'These data tell h only together with t_th.' in one.words
    assert 'h = 0.02 1/J' in one.words


def test_an_effect_that_was_dropped_again_has_no_evidence():
    steps = [*ladder(), step(fitted({}), 1.0)]
    assert evidence_of(steps, records({}, ['steps'], 2.0), 0.6, {}) == ()


def test_no_share_is_claimed_where_the_error_was_at_the_noise_already():
    (one,) = evidence_of(ladder(1.005, 1.0), records({}, ['steps'], 2.0), 1.0, {})
    assert 'at the sensor noise already' in one.words


def test_an_effect_that_pays_only_beside_the_next_one_says_so():
    """Of two effects that were found together, the first alone may raise the error."""
    drag = tried('quadratic_drag', 'quadratic drag')
    both = with_friction({}).with_effect('quadratic_drag')
    raised = [*ladder(4.0, 4.4)[:1], step(with_friction({}), 4.4, (drag,)), step(both, 2.5)]
    first, second = evidence_of(raised, records({}, ['steps'], 2.0), 2.5, {})
    assert 'rises by 10 % (4 to 4.4 %), and falls with what was found beside it.' in first.words
    assert 'takes away' not in first.words
    assert 'takes away 100 % of the squared error' in second.words
    assert 'beside it' not in second.words


# --- wrong parameters ----------------------------------------------------------------------


def test_a_wrong_parameter_is_told_with_its_factor_before_and_after():
    (one,) = wrong_parameters(step(fitted({'b': 5.33e-5}), 5.0), step(with_friction({}), 1.0))
    assert (one.name, one.before, one.after) == ('b', 5.33e-5, 1.3e-5)
    assert one.factor == pytest.approx(4.1)
    assert 'viscous friction' in one.words
    assert '4.1 times too large: 5.33e-05 -> 1.3e-05 N m s/rad' in one.words


def test_what_moved_within_its_sigma_was_not_wrong():
    """Trap: a parameter that is known to 40 % may double by chance."""
    vague = step(fitted({'b': 2.6e-5}, sigma=0.4), 5.0)
    assert wrong_parameters(vague, step(with_friction({}), 1.0)) == ()
    sharp = step(fitted({'b': 2.6e-5}), 5.0)
    assert [w.name for w in wrong_parameters(sharp, step(with_friction({}), 1.0))] == ['b']


def test_what_moved_by_little_was_not_wrong():
    sharp = step(fitted({'R': 2.15}, sigma=1e-4), 5.0)
    assert wrong_parameters(sharp, step(with_friction({}), 1.0)) == ()


def test_an_offset_that_was_wrong_has_no_factor():
    first = fitted({}).with_estimates({'current_offset': 0.13}, {'current_offset': 1e-3})
    last = with_friction({}).with_estimates({'current_offset': -0.01}, {'current_offset': 1e-3})
    (one,) = wrong_parameters(step(first, 5.0), step(last, 1.0))
    assert np.isnan(one.factor)
    assert 'instead of -10 mA' in one.words


def test_what_is_nothing_with_an_effect_was_too_large_by_no_factor():
    first, last = fitted({'L': 2e-4}), fitted({})
    last = last.with_values({'L': last.parameters['L'].lower})
    (one,) = wrong_parameters(step(first, 5.0), step(last, 1.0))
    assert np.isnan(one.factor)
    assert one.words.startswith('Without it, L (armature inductance) came out as 200 µH; with it,')
    assert one.words.endswith('too small for these data to show.')


def test_an_inertia_that_an_effect_shares_was_not_wrong():
    first, last = fitted({'J': 5e-5}), fitted({}).with_effect('flexible_shaft', {'w_a': 50.0})
    assert wrong_parameters(step(first, 5.0), step(last, 1.0)) == ()


def test_a_first_model_that_explains_nothing_tells_of_no_parameter():
    lost, found = step(fitted({'R': 32.0}), 97.0), step(with_friction({}), 1.0)
    assert wrong_parameters(lost, found) == ()


def test_values_far_from_nominal_are_told():
    assert off_nominal(fitted({}), {'R': 2.0, 'k_t': 0.05}) == []
    (line,) = off_nominal(fitted({}), {'R': 1.0, 'k_t': 0.05})
    assert '2.1 times its nominal value' in line


def test_an_inertia_of_which_a_part_hangs_on_a_spring_is_not_what_the_sheet_means():
    split = fitted({'J': 2e-5}).with_effect('flexible_shaft', {'r': 1.5, 'w_a': 50.0})
    assert off_nominal(fitted({'J': 2e-5}), {'J': 5e-5}) != []
    assert off_nominal(split, {'J': 5e-5}) == []


@pytest.mark.parametrize(
    ('over', 'predictable', 'says'),
    [(1.1, 0.0, ''), (1.5, 0.02, 'is not predictable from the input'), (1.35, 0.5, 'below 1 %')],
)
def test_what_remains_beside_what_is_named_is_told(over, predictable, says):
    left = Remainder({}, 1.0, 1.0 * over, over, predictable)
    steps = [step(fitted({}), 9.0), step(with_friction({}), over)]
    said = words.named(steps, left, (), (), ())
    assert (says in said[-1]) if says else said[-1].startswith('Missing')


def test_a_wave_is_told_with_its_number_per_turn():
    wave = {'a_1': 1e-3, 'b_1': 0.0, 'a_2': 0.0, 'b_2': 0.0, 'n': 12.0}
    said = words._sizes(fitted({}).with_effect('cogging_torque', wave), ['cogging_torque'])
    assert said.startswith('a_1 = 1 mN m')
    assert said.endswith('n = 12 1/rev')


def test_what_is_not_named_is_told_with_the_reason():
    left = Remainder({}, 1.0, 4.0, 4.0, 0.9)

    def last_line(after: float, sigma: float) -> str:
        steps = [step(fitted({}), 90.0), step(with_friction({}, sigma), after)]
        return words.unknown(steps, left, ())[-1]

    assert 'but its size cannot be told from nothing' in last_line(4.0, 4e-3)
    assert 'a model that still errs by 60 % tells nothing' in last_line(60.0, 1e-4)
    part = last_line(40.0, 1e-4)
    assert 'would explain a part of it (tau_c = 6 mN m; held-out error 90 to 40 %' in part


@pytest.mark.parametrize(
    ('left', 'says'),
    [
        (
            Remainder({}, 1.0, 4.0, 4.0, 0.9),
            'the held-out error is 90 %, at best 40 % with what it holds, 4.0 times the sensor '
            'noise in one channel, and the motion predicts 90 % of the squared error of a '
            'channel.',
        ),
        (
            Remainder({}, 1.0, 4.0, 1.04, 1.0, short=True),
            'the held-out error is 90 %, at best 40 % with what it holds, and these data are too '
            'short to tell how much of it the motion predicts.',
        ),
    ],
)
def test_how_much_is_unknown_is_told_as_far_as_it_is_known(left, says):
    lines = words.unknown([step(fitted({}), 90.0), step(with_friction({}), 40.0)], left, ())
    assert lines[0].endswith(says)
    assert any('no axis' in line for line in lines) is left.structured


def test_what_a_wrong_neighbour_explains_is_described_all_the_same(monkeypatch):
    monkeypatch.setattr(explain, 'failure_of', lambda *_: None)
    monkeypatch.setattr(explain, 'unknown_of', lambda *_: ('torque',))
    found = SimpleNamespace(words='of speed', axis='speed', share=0.0)
    nothing = Remainder({}, 1.0, 1.2, 1.2, 0.0)
    base, beside = step(fitted({}), 90.0), step(with_friction({}), 40.0)
    assert 'of speed' in words.unknown([base, beside], nothing, (found,))
    unknown = SimpleNamespace(
        verdict=Verdict.UNKNOWN_EFFECT, steps=[base], records=[], roles=[], noise_sigma={}
    )
    assert explain._unknown(unknown, nothing, partly=True) == ('torque',)
    assert explain._unknown(unknown, nothing, partly=False) == ()


def test_what_remains_about_as_large_as_the_noise_is_no_multiple_of_it():
    steps = [step(fitted({}), 9.0), step(with_friction({}), 2.0)]

    def remains(over: float) -> str:
        left = Remainder({}, 1.0, 5.0, over, 0.9, unevenness=9.0)
        return next(x for x in words.named(steps, left, (), (), ()) if 'smaller' in x)

    assert 'the error is still 2.0 times the sensor noise and the motion' in remains(2.0)
    assert remains(1.04).startswith('A smaller effect remains: the motion predicts 90 %')


# --- blind spots ---------------------------------------------------------------------------


def driven(volts: np.ndarray, rate: float = 1e3) -> Record:
    """Return what is measured of the motor at a voltage."""
    full = measure(a_motor({}), volts, np.random.default_rng(0))
    every = round(1e3 / rate)
    return Record(
        full.time[::every], {n: v[::every] for n, v in full.signals.items()}, full.units
    )


def codes(record: Record, model: Model | None = None, warnings: tuple[str, ...] = ()) -> set[str]:
    return {spot.code for spot in blind_spots(model or fitted({}), [record], warnings)}


def test_rich_excitation_has_no_blind_spot():
    rng = np.random.default_rng(1)
    assert codes(driven(voltage_profile('steps', 8.0, rng))) == set()


def test_one_direction_mixes_up_friction_and_load():
    rng = np.random.default_rng(1)
    record = driven(3 + np.abs(voltage_profile('steps', 8.0, rng)))
    spots = {s.code: s for s in blind_spots(fitted({}), [record], ())}
    assert 'one_direction' in spots
    assert {'coulomb_friction', 'constant_load_torque'} <= set(spots['one_direction'].effects)
    assert 'cannot be told apart' in spots['one_direction'].words
    assert 'both directions' in spots['one_direction'].remedy


def test_a_motor_that_is_never_slow_hides_stribeck_friction():
    time = np.arange(8000) * 1e-3
    fast = np.where(time % 2 < 1, 8.0, -8.0) + np.sin(9 * time)
    record = driven(fast).slice(200, 8000)
    speed = np.where(np.abs(record['speed']) < 40, 40.0, record['speed'])
    spots = {s.code: s for s in blind_spots(
        fitted({}), [record.with_signal('speed', speed, 'rad/s')], ())}  # fmt: skip
    assert 'stribeck_friction' in spots['never_slow'].effects


def test_less_than_a_turn_hides_cogging():
    time = np.arange(6000) * 1e-3
    record = driven(1.5 * np.sign(np.sin(2 * np.pi * 12 * time)))
    spots = {s.code: s for s in blind_spots(fitted({}), [record], ())}
    assert 'cogging_torque' in spots['short_travel'].effects
    found = {s.code: s for s in blind_spots(fitted({}), [record], (), ('cogging_torque',))}
    assert 'cogging_torque' not in found['short_travel'].effects
    assert 'cogging' not in found['short_travel'].words


def test_an_arm_shows_its_weight_in_less_than_a_turn():
    time = np.arange(6000) * 1e-3
    record = driven(1.5 * np.sign(np.sin(2 * np.pi * 12 * time)))
    assert all('gravity_load' not in s.effects for s in blind_spots(fitted({}), [record], ()))


def test_an_effect_of_the_user_says_itself_what_hides_it(tmp_path):
    file = tmp_path / 'swash_plate.py'
    file.write_text(
        'from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale\n'
        'from motor_sysid.physics.laws import sin\n'
        'CARD = Card(title="swash plate", equation="tau = -m sin(3 theta)", symptom="Pulses.",\n'
        '    reference="-", enters=Enters.MECHANICAL, rotary=True, hidden_by=("short_travel",),\n'
        '    amplitudes=(Amplitude("m", "N m", "pulse", Scale.TORQUE),))\n'
        'def torque(theta, m):\n'
        '    return -m * sin(3.0 * theta)\n'
    )
    time = np.arange(6000) * 1e-3
    record = driven(1.5 * np.sign(np.sin(2 * np.pi * 12 * time)))
    try:
        add_effect_file(file)
        spots = {s.code: s for s in blind_spots(fitted({}), [record], ())}
    finally:
        catalogue().pop('swash_plate', None)
    assert 'swash_plate' in spots['short_travel'].effects
    assert 'swash plate' in spots['short_travel'].words
    file.write_text(file.read_text().replace('short_travel', 'bad_weather'))
    with pytest.raises(UserError, match='`bad_weather`; it may name constant_input'):
        add_effect_file(file)


def test_records_that_begin_with_their_step_hide_a_delay():
    steps = [driven(np.full(2000, u)) for u in (3.0, 6.0, -6.0)]
    (spot,) = (s for s in blind_spots(fitted({}), steps, ()) if s.code == 'begins_driven')
    assert spot.effects == ('input_delay',)
    assert spot.words.endswith('nor a change of it, so input delay cannot be seen.')
    later = driven(np.where(np.arange(2000) < 20, 0.0, 6.0))
    found = blind_spots(fitted({}), [*steps, later], ())
    assert 'begins_driven' not in {s.code for s in found}


def test_without_current_resistance_and_inductance_are_not_seen():
    rng = np.random.default_rng(1)
    record = driven(voltage_profile('steps', 6.0, rng)).select(['voltage', 'speed'])
    model = Model.base('brushed_dc_reduced', {'k_v': 0.046, 'k_a': 1.2e-3})
    (spot,) = (s for s in blind_spots(model, [record], ()) if s.code == 'no_current')
    assert {'R', 'L'} <= set(spot.parameters)
    assert 'record the motor current' in spot.remedy


def test_a_current_that_drives_an_axis_is_measured():
    rng = np.random.default_rng(1)
    record = driven(voltage_profile('steps', 6.0, rng)).select(['voltage', 'current', 'speed'])
    axis = Model.base('mechanical_axis', {'J': 2.6e-5, 'b': 1.3e-5})
    assert 'no_current' not in {s.code for s in blind_spots(axis, [record], ())}


def test_samples_too_rare_for_the_inductance():
    rng = np.random.default_rng(1)
    record = driven(voltage_profile('steps', 8.0, rng), rate=100.0)
    vague = fitted({}).with_estimates({}, {'L': 5e-3})
    assert undetermined(vague, ()) == ('L',)
    (spot,) = (s for s in blind_spots(vague, [record], ()) if s.code == 'slow_sampling')
    assert spot.parameters == ('L',)
    assert 'sample faster' in spot.remedy
    assert 'slow_sampling' not in codes(record)


def test_undetermined_parameters_are_read_from_sigmas_and_from_the_fit():
    warnings = ('these data see R, k_t only in combination; fix one of them',)
    assert set(undetermined(fitted({}), warnings)) == {'R', 'k_t'}
    assert undetermined(fitted({}).with_estimates({}, {'J': np.inf}), ()) == ('J',)


def test_a_constant_input_says_what_is_missing_and_what_hangs_on_it():
    count = 4000
    rng = np.random.default_rng(0)
    signals = {
        'voltage': np.full(count, 6.0),
        'current': 0.2 + 0.01 * rng.normal(size=count),
        'speed': 120.0 + 0.5 * rng.normal(size=count),
    }
    units = {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'}
    found = diagnose([Record(1e-3 * np.arange(count), signals, units)])
    assert found.verdict is Verdict.INSUFFICIENT_DATA
    said = ' '.join(found.reasons)
    assert 'do not determine the motor' in said
    assert '6 V all the time' in said
    assert 'one direction only' in said
    assert 'not determined' in said
    assert {spot.code for spot in found.blind_spots} >= {'constant_input', 'one_direction'}


# --- rivals --------------------------------------------------------------------------------


def rival_step(difference: float) -> list[Step]:
    wave = np.sin(np.arange(100) / 10)
    other = np.cos(np.arange(100) / 10)
    base = step(fitted({}), 5.0)
    pair = []
    for key, title, run in (
        ('coulomb_friction', 'Coulomb friction', wave * 1.1),
        ('constant_load_torque', 'constant load torque', wave * 1.1 + difference * other),
    ):
        values = {'tau_c': 6e-3} if key == 'coulomb_friction' else {'tau_l': 6e-3}
        model = fitted({}).with_effect(key, values)
        pair.append(replace(tried(key, title), model=model, predictions=({'speed': run},)))
    return [replace(base, candidates=tuple(pair)), step(with_friction({}), 1.0)]


def test_rivals_are_named_with_their_overlap_and_where_they_would_differ():
    """In one direction dry friction and a constant load are the same; in the other they differ."""
    rng = np.random.default_rng(1)
    record = driven(3 + np.abs(voltage_profile('steps', 3.0, rng))).slice(600, 3000)
    (one,) = rivalries_of(
        rival_step(0.01), {'coulomb_friction': ('constant_load_torque',)}, [record]
    )
    assert one.overlap == pytest.approx(1 - (0.01 / 0.1) ** 2, abs=5e-3)
    assert one.regime == 'in the other direction'
    assert 'Coulomb friction cannot be told from constant load torque' in one.words
    assert 'in the other direction' in one.words


def test_a_rival_that_was_not_refitted_is_named_without_a_figure():
    (one,) = rivalries_of(
        ladder(), {'coulomb_friction': ('quadratic_drag',)}, records({}, ['steps'], 2.0)
    )
    assert np.isnan(one.overlap)
    assert one.words.endswith('with these data.')


# --- documents -----------------------------------------------------------------------------


@pytest.fixture(scope='module')
def friction() -> Diagnosis:
    *train, held = records({'coulomb_friction': {'tau_c': 6e-3}}, seconds=4.0)
    few = ['coulomb_friction', 'quadratic_drag', 'input_delay']
    return diagnose(train, [held], effects=few, nominal={'R': 2.0, 'rated_torque': 0.08})


@pytest.fixture(scope='module')
def unknown() -> Diagnosis:
    *train, held = records({'cogging_torque': {'a_1': 6e-3, 'b_1': 3e-3, 'n': 11}}, seconds=4.0)
    return diagnose(train, [held], effects=['brush_voltage_drop', 'input_delay'])


def test_a_named_effect_comes_with_its_evidence(friction):
    assert friction.effects == ('coulomb_friction',)
    (one,) = friction.evidence
    assert one.plausible
    assert '% of the rated torque' in one.words
    assert one.words in friction.reasons
    assert [w.name for w in friction.wrong_parameters] == ['b']
    assert friction.wrong_parameters[0].factor > 2
    assert friction.unknown == ()


def test_an_unknown_effect_is_told_by_its_axis(unknown):
    assert unknown.verdict is Verdict.UNKNOWN_EFFECT
    first = unknown.unknown[0]
    assert (first.axis, first.shape) == ('position', '11 waves per turn')
    assert first.words in unknown.reasons
    assert unknown.evidence == ()


def check_curve(curve: dict) -> None:
    assert set(curve) == {
        'axis', 'axis_unit', 'quantity', 'unit', 'x', 'mean', 'band', 'law', 'chance',
    }  # fmt: skip
    assert len(curve['x']) == len(curve['mean']) == len(curve['band'])


def test_the_document_holds_what_the_page_and_programs_need(friction, unknown):
    for found in (friction, unknown):
        document = json.loads(json.dumps(diagnosis_document(found), allow_nan=False))
        for name in ('curves', 'curves_after'):
            assert {c['axis'] for c in document[name]} >= {'speed', 'current', 'position', 'time'}
            for curve in document[name]:
                check_curve(curve)
        for where in document['where']:
            for one in where['channels'].values():
                assert len(one['rms']) == len(one['low']) == len(one['high'])
                assert len(where['bins']) == len(one['rms']) + 1
        quantities = {m['quantity'] for m in document['maps']}
        assert quantities == {
            'current error', 'speed error', 'unexplained torque', 'unexplained voltage',
        }  # fmt: skip
        for drawn in document['maps']:
            assert len(drawn['value']) == len(drawn['y_edges']) - 1
            assert len(drawn['value'][0]) == len(drawn['x_edges']) - 1
    (one,) = diagnosis_document(friction)['evidence']
    assert set(one['parameters']['tau_c']) == {'value', 'unit', 'sigma', 'low', 'high'}
    (first, *_) = diagnosis_document(unknown)['unknown']
    assert first['axes'][0].keys() == {'axis', 'share', 'certainty', 'best'}
    check_curve(first['curve'])


def test_a_saved_diagnosis_makes_the_page(friction, tmp_path: Path):
    from motor_sysid.workbench.view import build_view

    view = build_view(friction)
    saved = tmp_path / 'diagnosis.json'
    saved.write_text(json.dumps({**diagnosis_document(friction), 'view': view}))
    assert load_view(saved) == json.loads(json.dumps(view))
    page = tmp_path / 'page.html'
    assert main(['report', str(saved), '-o', str(page)]) == 0
    assert 'Missing: Coulomb friction' in page.read_text(encoding='utf-8')
    assert load_view(save_view(view, tmp_path / 'view.json')) == load_view(saved)


@pytest.mark.parametrize(
    ('sigma', 'words'),
    [
        (1e-4, 'tau_c = 6 mN m, 95 %: 5.8 mN m to 6.2 mN m'),
        (1e-6, 'tau_c = 6 mN m, 95 %: 5.998 mN m to 6.002 mN m'),
    ],
)
def test_an_interval_has_digits_enough_for_its_ends(sigma, words):
    steps = [*ladder()[:1], step(with_friction({}, sigma), 1.0)]
    (one,) = evidence_of(steps, records({}, ['steps'], 2.0), 0.6, {})
    assert words in one.words
