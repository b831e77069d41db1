"""One record of several in which something acts that is not in the others."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from bench_motor import a_motor, measure, voltage_profile
import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.odd_record import _judged, _oddest, FEWEST, without_odd_record
from motor_sysid.diagnosis.result.result import Diagnosis, Step
from motor_sysid.diagnosis.search.bench import make_bench
from motor_sysid.physics.model import SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.signals.record import Record

COULOMB = {'coulomb_friction': {'tau_c': 0.006}}
OTHERS = (
    'driver_clipping', 'supply_sag', 'input_delay', 'flexible_shaft', 'cogging_torque',
    'load_torque_step',
)  # fmt: skip
CLIPPED = 4.0
"""Largest voltage of the bridge in the second record, V; what is commanded goes to 9."""


def recorded(effects: Mapping[str, Mapping[str, float]], seconds: float = 5.0) -> list[Record]:
    """Return records of one motor, in the second of which its bridge clips."""
    found = []
    for k, kind in enumerate(('triangle', 'steps', 'sines')):
        rng = np.random.default_rng([k, 7])
        volts = voltage_profile(kind, seconds, rng)
        acts = np.clip(volts, -CLIPPED, CLIPPED) if k == 1 else volts
        record = measure(a_motor(effects), acts, rng)
        found.append(record.with_signal('voltage', volts, 'V'))
    return found


def test_what_the_others_lack_is_named_and_what_the_odd_one_lacks() -> None:
    effects = ['coulomb_friction', *OTHERS]
    found = diagnose(recorded(COULOMB), motor='brushed_dc', effects=effects)
    assert (found.verdict, found.effects) == (Verdict.EFFECT_MISSING, ('coulomb_friction',))
    assert not found.unknown
    assert found.model['coulomb_friction.tau_c'] == pytest.approx(0.006, rel=0.01)
    odd, alone = found.reasons[1:3]
    assert odd.startswith('record 2 is not like the others')
    assert odd.endswith('Searched, and shown, over record 1 and record 3 alone')
    assert alone.startswith('By itself record 2 lacks')
    assert 'driver clipping' in alone
    assert len(found.records) == 4, 'two of training, and what was held back of each'


@pytest.mark.slow
def test_a_stranger_in_all_of_them_is_not_named_for_it() -> None:
    found = diagnose(recorded(COULOMB), motor='brushed_dc', effects=OTHERS)
    assert found.verdict is Verdict.UNKNOWN_EFFECT
    assert found.effects == ()
    assert not any('not like the others' in reason for reason in found.reasons)


@pytest.mark.parametrize('asked', [(), ('driver_clipping', 'coulomb_friction')])
def test_what_the_odd_record_does_not_ask_for_is_not_named(asked: tuple[str, ...]) -> None:
    """Fewer records refute less: what is named over the others may stand for something else."""
    records = recorded({}, 2.0)
    linear = a_motor({}).with_speed_sensor(SpeedSensor.DIFFERENCE)
    bench = make_bench(records, (), motor('brushed_dc'), linear)
    step = Step(linear.with_free(('R',)), 5.0, 5.0, {}, ())
    found = Diagnosis(
        Verdict.UNKNOWN_EFFECT, (), (step,), 1.0, {}, ('Something is missing.',), tuple(records),
        ('train',) * 3,
    )  # fmt: skip
    named = replace(
        found, verdict=Verdict.EFFECT_MISSING, effects=('coulomb_friction',), reasons=('Missing.',)
    )

    def again(train: Sequence[Record], validation: Sequence[Record]) -> Diagnosis:
        return named if len(train) == 2 else replace(named, effects=asked)

    told = without_odd_record(found, bench, records, (), again, print)
    assert told.effects == (named.effects if asked else ())
    assert told.reasons[0] == ('Missing.' if asked else 'Something is missing.')
    assert told.reasons[1].startswith('record 2 is not like the others')
    unproven = 'Over record 1 and record 3 alone Coulomb friction would be named'
    assert (unproven in told.reasons[1]) is not bool(asked)


def test_where_the_others_lack_nothing_what_is_unknown_stays_shown() -> None:
    records = recorded({}, 2.0)
    found = diagnose(records, motor='brushed_dc', effects=['driver_clipping', 'supply_sag'])
    assert found.verdict is Verdict.UNKNOWN_EFFECT
    assert found.unknown
    assert found.records[1]['voltage'].max() > CLIPPED, 'the odd one is shown'
    said = [reason for reason in found.reasons if 'not like the others' in reason]
    assert said
    assert said[0].endswith('Over record 1 and record 3 alone nothing is missing')


def test_the_oddest_stands_out_most_in_some_output() -> None:
    errors = np.array([[1.0, 0.02], [1.1, 0.09], [1.4, 0.03]])
    assert _oddest(errors) == 1
    bench = make_bench(recorded(COULOMB, 1.0), (), motor('brushed_dc'))
    odd = _judged(1, errors, bench)
    assert (odd.number, odd.signal) == (1, bench.outputs[1])
    assert odd.times == pytest.approx(3.0)
    none = np.array([[np.nan, 0.0], [np.nan, 0.0], [np.inf, 0.0]])
    assert _judged(0, none, bench).times == 0.0
    assert _judged(2, np.array([[1.0, 0.0], [1.0, 0.0], [np.inf, 0.0]]), bench).times > 1e300


@pytest.mark.parametrize(
    ('verdict', 'count'), [(Verdict.COMPLETE, 3), (Verdict.UNKNOWN_EFFECT, FEWEST - 1)]
)
def test_it_is_asked_of_three_records_and_of_what_is_unknown(
    verdict: Verdict, count: int
) -> None:
    def never(train: Sequence[Record], validation: Sequence[Record]) -> Diagnosis:
        raise AssertionError('searched once more')

    records = recorded(COULOMB, 1.0)[:count]
    bench = make_bench(records, (), motor('brushed_dc'))
    found = Diagnosis(verdict, (), (), 1.0, {}, (), tuple(records), ('train',) * count)
    assert without_odd_record(found, bench, records, (), never, print) is found
