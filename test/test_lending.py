"""Held-out data that alone show what is missing are fitted by half; the rest judges."""

from dataclasses import replace

from bench_motor import a_motor, DT, measure, voltage_profile
from fake_diagnosis import build_diagnosis
import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.diagnosis.lending import (
    better_with_half_lent,
    DROWNED,
    drowned,
    shows_only_there,
)
from motor_sysid.diagnosis.result.findings import Unknown
from motor_sysid.diagnosis.result.result import Candidate
from motor_sysid.diagnosis.search.gates import TOO_LITTLE
from motor_sysid.estimation.batch.chains import make_chain, PIECE
from motor_sysid.physics.motors import motor
from motor_sysid.signals.record import Record

OUTPUTS = ('current', 'speed')
SATURATION = {'torque_constant_saturation': {'a': 0.5, 'i_k': 2.0}}


def counting(rows: int) -> Record:
    """Return a record whose voltage counts its samples."""
    count = np.arange(float(rows))
    columns = {'voltage': count, 'current': np.sin(count), 'speed': np.cos(count)}
    return Record(DT * count, columns, {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'})


def scored(record: Record, role: str, horizon: float | None, fraction: float) -> list[float]:
    """Return the samples of a record that count, in order."""
    chain = make_chain(
        record, motor('brushed_dc'), OUTPUTS, horizon=horizon, train_fraction=fraction,
        scored=role, lent=True,
    )  # fmt: skip
    starts = [stretch.drive.start for stretch in chain]
    assert starts == sorted(starts), 'the memory of effects carries on, so time does'
    return [float(v) for s in chain for v in s.record['voltage'][s.scored_from :]]


@pytest.mark.parametrize('horizon', [None, 0.1])
@pytest.mark.parametrize('fraction', [0.0, 0.8, 1.0])
@pytest.mark.parametrize('rows', [700, 10_000])
def test_every_sample_counts_once(rows, fraction, horizon):
    """Half of what was held back counts as training data, and the other half judges."""
    record, cut = counting(rows), round(fraction * rows)
    train, held = (scored(record, role, horizon, fraction) for role in ('train', 'validate'))
    assert sorted(train + held) == list(range(rows))
    assert train[:cut] == list(range(cut))
    assert len(train) - cut == pytest.approx(len(held), abs=4)
    turns = np.sum(np.diff(held) > 1.5) + 1 if held else 0
    assert turns == min(max((rows - cut) // (2 * PIECE), 1), 4) * (cut < rows)


def small_and_large(hidden, share=0.3):
    """Return two records of small currents, and one of large ones."""
    rng, model = np.random.default_rng(5), a_motor(hidden)
    quiet = [share * voltage_profile(kind, 6.0, rng) for kind in ('triangle', 'sines')]
    loud = voltage_profile('steps', 12.0, rng)
    *train, held = (measure(model, volts, rng) for volts in (*quiet, loud))
    return train, held


@pytest.fixture(scope='module')
def saturated():
    """Return such records of a motor whose iron saturates at large currents."""
    return small_and_large(SATURATION)


def test_what_only_held_out_data_show_is_named_and_it_is_said_how(saturated):
    train, held = saturated
    found = diagnose(train, [held])
    assert found.effects == tuple(SATURATION)
    assert found.lent
    assert found.roles == ('train',) * 6 + ('validate',) * 4
    assert found.steps[-1].validation_error_percent < 1.1 * found.noise_floor_percent
    assert 'every other piece of these was fitted' in found.reasons[1]
    assert found.model['torque_constant_saturation.i_k'] == pytest.approx(2.0, rel=0.1)
    true = fit_model(train, [held], model=a_motor(SATURATION), lent=True)
    assert found.steps[-1].validation_error_percent == pytest.approx(
        true.validation.error_percent, rel=0.01
    )


@pytest.mark.parametrize('share', [0.06, pytest.param(0.25, marks=pytest.mark.slow)])
def test_what_only_held_out_data_show_is_named_beside_what_all_show(share):
    """A little of it is left beside friction; much of it keeps friction from being named, too."""
    hidden = {
        'coulomb_friction': {'tau_c': 6e-3},
        'torque_constant_saturation': {'a': share, 'i_k': 2.0},
    }
    train, held = small_and_large(hidden, share=0.5)
    found = diagnose(train, [held])
    assert set(found.effects) == set(hidden)
    assert found.lent
    what = 'all of it' if share < 0.1 else 'it'
    assert f'The training data do not show {what}:' in found.reasons[1]
    assert found.steps[-1].validation_error_percent < 1.1 * found.noise_floor_percent


CLIPPED = {'coulomb_friction': {'tau_c': 6e-3}, 'driver_clipping': {'c': 1 / 6}}


@pytest.fixture(scope='module')
def clipped():
    """Return records of a motor with friction whose bridge clips over the held-out data only."""
    return small_and_large(CLIPPED, share=0.5)


@pytest.mark.slow
def test_what_the_training_data_ask_for_is_named_though_held_out_data_drown_it(clipped):
    train, held = clipped
    others = ['quadratic_drag', 'cogging_torque', 'input_delay', 'iron_loss']
    found = diagnose(train, [held], effects=[*CLIPPED, *others])
    assert set(found.effects) == set(CLIPPED)
    assert found.lent
    assert 'do not show all of it' in found.reasons[1]
    assert found.steps[-1].validation_error_percent < 1.1 * found.noise_floor_percent


@pytest.mark.slow
def test_beside_a_stranger_that_drowns_it_nothing_else_is_named(clipped):
    train, held = clipped
    others = ['quadratic_drag', 'cogging_torque', 'input_delay', 'iron_loss']
    found = diagnose(train, [held], effects=['coulomb_friction', *others])
    assert found.effects in ((), ('coulomb_friction',))
    assert found.verdict is Verdict.UNKNOWN_EFFECT or found.unknown


@pytest.mark.slow
def test_a_stranger_is_not_named_for_it(saturated):
    """The gates are the same as ever: the true effect taken out of the catalogue stays unknown."""
    train, held = saturated
    others = ['coulomb_friction', 'quadratic_drag', 'input_delay', 'gravity_load']
    found = diagnose(train, [held], effects=others)
    assert found.verdict is Verdict.UNKNOWN_EFFECT
    assert not found.lent
    assert found.held_alone > 3.0


@pytest.fixture(scope='module')
def named():
    """Return a diagnosis that names two effects, with enough held-out data."""
    made = build_diagnosis()
    assert made.effects == ('coulomb_friction', 'cogging_torque')
    return replace(made, unknown=(), held_alone=1.0, reasons=('verdict', 'evidence'))


LEFT = (Unknown('torque', 'unexplained torque', 'N m', 0.1, 0.01, '', 0.0, '', 0.0, '', ()),)


FRICTION = Candidate('coulomb_friction', '', '', '', 1e4, 0.2, 9.0, {}, note=f'{TOO_LITTLE} 0 %')


@pytest.mark.parametrize(
    ('change', 'times'),
    [
        ({}, 45.0),
        ({'note': 'unphysical sign'}, 1.0),
        ({'note': '', 'passes': True}, 1.0),
        ({'train_error_percent': 0.6}, 1.0),
        ({'train_error_percent': 0.0}, 1.0),
        ({'validation_error_percent': 0.3}, 1.5),
    ],
)
def test_an_effect_is_drowned_that_is_held_back_by_a_far_larger_error(named, change, times):
    last = replace(
        named.steps[-1], train_error_percent=1.0, candidates=(replace(FRICTION, **change),)
    )
    found = replace(named, unknown=LEFT, steps=(*named.steps[:-1], last), noise_sigma={})
    assert shows_only_there(found) is (times > DROWNED)
    assert drowned(found) == pytest.approx(times)


@pytest.mark.parametrize(('noise', 'times'), [(0.55, 15.0), (0.3, 1.0)])
def test_what_the_training_data_ask_for_is_told_beyond_their_noise(named, noise, times):
    """An effect that leaves 0.6 of 1 % leaves little where the sensors make 0.55 % of it."""
    asked = replace(FRICTION, train_error_percent=0.6)
    last = replace(named.steps[-1], train_error_percent=1.0, candidates=(asked,))
    steps = (*named.steps[:-1], last)
    sigma = {'speed': 0.01 * noise * 50.0, 'current': 0.01 * noise * 2.0}
    train, held = counting(2000), counting(2000)
    signals = {'speed': np.full(2000, 50.0), 'current': np.full(2000, -2.0)}
    train = Record(train.time, {**train.signals, **signals}, train.units)
    found = replace(
        named, steps=steps, noise_sigma=sigma, records=(train, held), roles=('train', 'validate')
    )
    assert drowned(found) == pytest.approx(times)


@pytest.mark.parametrize(
    ('change', 'asked'),
    [
        ({'held_alone': 5.0}, False),
        ({'unknown': LEFT}, False),
        ({'unknown': LEFT, 'held_alone': 5.0}, True),
        ({'verdict': Verdict.UNKNOWN_EFFECT, 'effects': (), 'held_alone': 5.0}, True),
        ({'verdict': Verdict.COMPLETE, 'effects': (), 'held_alone': 5.0}, False),
    ],
)
def test_half_is_lent_where_something_is_left_that_only_held_out_data_show(named, change, asked):
    assert shows_only_there(replace(named, **change)) is asked


def test_a_few_held_out_samples_are_not_shared(named):
    found = replace(named, unknown=LEFT, held_alone=5.0)
    few = tuple(r.slice(0, PIECE) for r in found.records)
    assert not shows_only_there(replace(found, records=few))


def test_what_was_named_is_given_up_for_more_only_or_for_the_same_and_nothing_unknown(named):
    found = replace(named, unknown=LEFT, held_alone=5.0)
    more = replace(named, effects=(*named.effects, 'quadratic_drag'))
    better = better_with_half_lent(found, more)
    assert better.lent
    assert better.effects == more.effects
    assert better.reasons[0] == 'verdict'
    assert '5 times as large' in better.reasons[1]
    assert better.reasons[2:] == ('evidence',)
    assert better_with_half_lent(found, named).lent
    *before, last = named.steps
    half = replace(last, validation_error_percent=0.4 * last.validation_error_percent)
    instead = replace(named, effects=('quadratic_drag',), steps=(*before, half))
    assert better_with_half_lent(found, instead).effects == ('quadratic_drag',)
    others = (
        replace(instead, unknown=LEFT),
        replace(instead, steps=named.steps),
        replace(instead, effects=('coulomb_friction', 'quadratic_drag', 'gravity_load')),
        replace(named, unknown=LEFT),
        replace(named, effects=('coulomb_friction', 'quadratic_drag')),
        replace(named, effects=(), verdict=Verdict.UNKNOWN_EFFECT),
    )
    assert all(better_with_half_lent(found, other) is found for other in others)
