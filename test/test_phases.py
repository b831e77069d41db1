"""Clarke and Park: one convention, told from the mix-ups that are usual."""

from dataclasses import replace
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from motor_sysid.diagnosis.search.bench import prepared
from motor_sysid.diagnosis.search.motor_kind import choose_kind
from motor_sysid.errors import UserError
from motor_sysid.nodes.configuration import Configuration
from motor_sysid.nodes.topics import DEFAULT_SOURCES, plan_signals
from motor_sysid.physics.model import Model
from motor_sysid.recording import load
from motor_sysid.recording.save import write_record
from motor_sysid.recording.sources import Source
from motor_sysid.signals.phases import (
    CURRENTS,
    electrical_angle,
    hall_sector,
    line_voltages,
    phase_columns,
    phases_of_line,
    sector_at,
    to_abc,
    to_dq,
    with_dq,
)
from motor_sysid.signals.record import Record

THIRD = 2 * np.pi / 3
ANGLES = np.linspace(-7, 7, 141)
number = st.floats(-1e3, 1e3)


@given(number, number, st.floats(-100, 100))
def test_park_and_back_changes_nothing(d: float, q: float, theta: float) -> None:
    abc = to_abc((d, q), theta)
    assert np.allclose(to_dq(abc, theta), (d, q), atol=1e-9)
    assert abc.sum() == pytest.approx(0, abs=1e-9)
    assert np.allclose(to_dq(abc + 17.0, theta), (d, q), atol=1e-9), 'what is common drops out'


def test_park_is_the_formula_of_the_notation() -> None:
    abc = np.random.default_rng(3).normal(size=(ANGLES.size, 3))
    shifts = ANGLES[:, np.newaxis] - THIRD * np.array([0, 1, 2])
    d = 2 / 3 * np.sum(np.cos(shifts) * abc, axis=1)
    q = -2 / 3 * np.sum(np.sin(shifts) * abc, axis=1)
    assert np.allclose(to_dq(abc, ANGLES), np.stack([d, q], axis=1))


def flux(theta: np.ndarray) -> np.ndarray:
    """Flux of the magnet through each phase, by geometry: the cosine of the angle between axes."""
    return np.stack([np.cos(theta - axis) for axis in (0.0, THIRD, 2 * THIRD)], axis=-1)


def test_the_magnet_lies_on_d_and_its_voltage_on_q() -> None:
    """A mix-up of 90 degrees would show the magnet on q, and its voltage on d."""
    assert np.allclose(to_dq(flux(ANGLES), ANGLES), (1, 0))
    step = 1e-6
    forward = (flux(ANGLES + step) - flux(ANGLES - step)) / (2 * step)
    assert np.allclose(to_dq(forward, ANGLES), (0, 1), atol=1e-9)
    assert np.allclose(to_dq(-forward, ANGLES), (0, -1), atol=1e-9), 'backward: minus q'
    mixed = to_dq(forward, ANGLES + np.pi / 2)
    assert np.allclose(mixed, (1, 0), atol=1e-9), 'what the angle of the q axis would show'


def test_swapped_phases_turn_the_other_way() -> None:
    swapped = flux(ANGLES)[:, [0, 2, 1]]
    assert np.allclose(to_dq(swapped, -ANGLES), (1, 0))
    assert np.ptp(to_dq(swapped, ANGLES)[:, 0]) > 1.9, 'in the rotor frame it turns twice as fast'


def test_amplitude_and_power_are_kept() -> None:
    u, i = to_abc((3.0, 4.0), ANGLES), to_abc((1.0, -2.0), ANGLES)
    fine = to_abc((3.0, 4.0), np.linspace(0, 7, 20_001))
    assert np.max(fine[:, 0]) == pytest.approx(5.0, rel=1e-6)
    assert np.allclose(np.sum(u * i, axis=1), 1.5 * (3.0 * 1.0 + 4.0 * -2.0))


def test_line_voltages_and_back() -> None:
    abc = to_abc((3.0, 4.0), ANGLES)
    lines = line_voltages(abc + 9.0)
    assert np.allclose(lines[:, 0], abc[:, 0] - abc[:, 1])
    assert np.allclose(lines[:, 2], abc[:, 2] - abc[:, 0])
    assert np.allclose(phases_of_line(lines), abc)


def test_sectors_begin_at_30_degrees_and_go_round() -> None:
    degrees = [29.9, 30.1, 89.9, 90.1, 210.1, 330.1, 389.9, 390.1, -329.9, -30.1]
    sectors = [6, 1, 1, 2, 4, 6, 6, 1, 1, 5]
    assert hall_sector(np.radians(degrees)).tolist() == sectors
    assert [sector_at(np.radians(angle)) for angle in degrees] == sectors


def turning(count: int = 400) -> Record:
    """Return a record of a machine that speeds up, with 4 pole pairs and 0.7 rad of offset."""
    time = 1e-3 * np.arange(count)
    position = 5 * time**2
    angle = 4 * position + 0.7
    halfway = 4 * 5 * (time**2 + time * 1e-3) + 0.7
    u, i = to_abc((1.0, 2.0), halfway), to_abc((-0.5, 0.25), angle)
    signals = {f'voltage_{p}': u[:, k] for k, p in enumerate('abc')}
    signals |= {f'current_{p}': i[:, k] for k, p in enumerate('abc')} | {'position': position}
    units = {n: 'rad' if n == 'position' else 'V' if 'v' in n else 'A' for n in signals}
    return Record(time, signals, units)


def test_dq_columns_come_from_phases_and_position() -> None:
    record = with_dq(turning(), 4, 0.7)
    for name, value in (('voltage_d', 1), ('voltage_q', 2)):
        assert np.allclose(record[name][:-1], value, atol=1e-4), 'acts halfway to the next sample'
    assert np.allclose(record['current_d'], -0.5)
    assert np.allclose(record['current_q'], 0.25)
    assert record.units['current_q'] == 'A'


def test_a_third_current_is_the_rest_and_a_third_voltage_is_not() -> None:
    record = turning()
    two = record.select([name for name in record if name != 'current_b'])
    assert np.allclose(phase_columns(two, 'current'), phase_columns(record, 'current'))
    two = record.select([name for name in record if name != 'voltage_c'])
    with pytest.raises(UserError, match='no `voltage_c`'):
        with_dq(two, 4)
    with pytest.raises(UserError, match='neither phase voltages'):
        with_dq(record.select(['position']), 4)
    with pytest.raises(UserError, match='7'):
        electrical_angle(1.0, 0)


@pytest.mark.parametrize('missing', CURRENTS)
def test_any_two_currents_make_a_brushless_motor(missing: str) -> None:
    full = turning()
    two = full.select([name for name in full if name != missing])
    (ready,) = prepared([two], None, {})
    assert choose_kind([ready], None).key == choose_kind([ready], 'bldc').key == 'bldc'
    assert np.allclose(ready[missing], full[missing])
    one = full.select([name for name in full if name not in CURRENTS[1:]])
    with pytest.raises(UserError, match='current_b'):
        choose_kind(prepared([one], 'bldc', {}), 'bldc')


@pytest.mark.parametrize('form', ['phases.csv', 'bag'])
def test_both_frames_survive_a_file(form: str, tmp_path: Path) -> None:
    record = with_dq(turning(), 4, 0.7)
    write_record(record, tmp_path / form)
    read = load(tmp_path / form).records[0]
    assert set(read) == set(record)
    assert all(np.array_equal(read[name], record[name]) for name in record)


def test_headers_of_phases_may_bear_their_unit_behind_an_underscore(tmp_path: Path) -> None:
    header = 'time_s,voltage_d_v,voltage_q_v,current_a_a,current_b_ma,current_q_a,position_rad'
    rows = [f'{k},1,2,3,4,5,6' for k in range(20)]
    (tmp_path / 'a.csv').write_text('\n'.join([header, *rows]))
    record = load(tmp_path / 'a.csv').records[0]
    names = ('voltage_d', 'voltage_q', 'current_a', 'current_b', 'current_q', 'position')
    assert [record[name][0] for name in names] == [1, 2, 3, 0.004, 5, 6]


@pytest.mark.parametrize('axes', ['abc', 'dq'])
def test_phases_are_heard_live(axes: str) -> None:
    wanted = [f'{kind}_{axis}' for kind in ('voltage', 'current') for axis in axes]
    plan = plan_signals(DEFAULT_SOURCES, [*wanted, 'speed'])
    assert plan.signals == (*wanted, 'speed')
    assert [topic.topic for topic in plan.topics] == [
        'motor/voltage', 'motor/current', 'motor/speed'
    ]  # fmt: skip
    assert [s.field for s in plan.topics[0].sources] == [
        f'vector.{part}' for part in 'xyz'[: len(axes)]
    ]


@pytest.mark.parametrize('missing', CURRENTS)
@pytest.mark.parametrize('apart', [False, True])
def test_any_two_currents_are_enough_live(missing: str, apart: bool) -> None:
    """The third one is not sent, or it is no number in a message that has place for it."""
    sources: list[Source] = list(DEFAULT_SOURCES)
    if apart:
        sources = [
            replace(s, topic=f'drive/{s.signal}') if s.signal in CURRENTS else s
            for s in sources if s.signal != missing
        ]  # fmt: skip
    configuration = Configuration(Model.base('bldc', {'pole_pairs': 4.0}))
    plan = configuration.plan(sources)
    assert [name for name in plan.names if 'current' in name] == (
        [f'drive/{name}' for name in CURRENTS if name != missing] if apart else ['motor/current']
    )
    pipeline = configuration.pipeline(plan, [topic.reader() for topic in plan.topics], 100)
    sent = {'current_a': 1.0, 'current_b': 2.0, 'current_c': -3.0, missing: np.nan}
    for stamp in range(3):
        for k, topic in enumerate(plan.topics):
            of_topic = [sent.get(source.signal, 0.5) for source in topic.sources]
            pipeline.join.push(k, stamp, tuple(of_topic))
    pipeline.advance()
    record = pipeline.record()
    assert record is not None
    assert (record['current_a'][0], record['current_b'][0]) == (1.0, 2.0)
    assert pipeline.not_finite == 0
