"""Held-out data that alone show what is missing are fitted by half; the rest judges."""

from bench_motor import a_motor, DT, measure, voltage_profile
import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.fitting import fit_model
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


@pytest.fixture(scope='module')
def small_and_large():
    """Two records of small currents, and one of large ones, at which iron saturates."""
    rng, model = np.random.default_rng(5), a_motor(SATURATION)
    quiet = [0.3 * voltage_profile(kind, 6.0, rng) for kind in ('triangle', 'sines')]
    *train, held = (
        measure(model, volts, rng) for volts in (*quiet, voltage_profile('steps', 12.0, rng))
    )
    return train, held


def test_what_only_held_out_data_show_is_named_and_it_is_said_how(small_and_large):
    train, held = small_and_large
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


def test_a_stranger_is_not_named_for_it(small_and_large):
    """The gates are the same as ever: the true effect taken out of the catalogue stays unknown."""
    train, held = small_and_large
    others = ['coulomb_friction', 'quadratic_drag', 'input_delay', 'gravity_load']
    found = diagnose(train, [held], effects=others)
    assert found.verdict is Verdict.UNKNOWN_EFFECT
    assert not found.lent
    assert found.held_alone > 3.0
