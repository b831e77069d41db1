"""How much of a record is held back, where it ends at rest."""

import numpy as np
import pytest

from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.diagnosis.search.held_back import kept, parted, remarks_on_held
from motor_sysid.physics.motors import motors
from motor_sysid.signals import Record

UNITS = {'voltage': 'V', 'speed': 'rad/s', 'position': 'rad', 'torque': 'N m'}
TIME = 1e-2 * np.arange(1000)


def moving_until(share: float, names: tuple[str, ...] = ('speed', 'position')) -> Record:
    """Return a record of 10 s with two levels of speed, and rest after a share of it."""
    moves = share * TIME.size > np.arange(TIME.size)
    speed = np.where(moves, 20.0 + 10.0 * np.sign(np.sin(9 * TIME)), 0.0)
    signals = {'voltage': 0.1 * speed, 'speed': speed, 'position': np.cumsum(speed) * 1e-2}
    chosen = {name: signals[name] for name in ('voltage', *names)}
    return Record(TIME, chosen, {name: UNITS[name] for name in chosen})


@pytest.mark.parametrize('names', [('speed',), ('position',)])
def test_a_record_that_moves_to_its_end_is_held_back_as_asked(names):
    record = moving_until(1.0, names)
    assert kept(record, 0.2) == pytest.approx(0.8)
    assert remarks_on_held([record], 0.2) == ()
    assert kept(moving_until(0.95, names), 0.2) == pytest.approx(0.8)


@pytest.mark.parametrize('names', [('speed',), ('position',)])
@pytest.mark.parametrize(('moves', 'fitted'), [(0.85, 0.68), (0.7, 0.56), (0.4, 0.5)])
def test_a_record_that_ends_at_rest_gives_its_due_of_the_motion(names, moves, fitted):
    """A fifth of the way is made in the last fifth of the motion, if half of the record holds."""
    record = moving_until(moves, names)
    assert kept(record, 0.2) == pytest.approx(fitted, abs=0.015)
    (line,) = remarks_on_held([record], 0.2)
    assert f'the last {1 - kept(record, 0.2):.0%} are held back' in line
    assert kept(record, 0.7) <= 0.3 + 1e-9, 'never less than was asked for'


def test_a_motor_that_rests_or_whose_motion_is_not_known_is_held_back_as_asked():
    rest = Record(TIME, {'voltage': TIME, 'speed': 0.0 * TIME}, {'voltage': 'V', 'speed': 'rad/s'})
    assert kept(rest, 0.2) == pytest.approx(0.8)
    unknown = Record(TIME, {'torque': TIME}, {'torque': 'N m'})
    assert kept(unknown, 0.2) == pytest.approx(0.8)


def test_a_fit_says_what_it_holds_back_and_judges_on_motion():
    rng = np.random.default_rng(1)
    volts = np.repeat(rng.uniform(-10, 10, 100), 10)
    volts[700:] = 0.0
    speed, x = np.zeros(1000), 0.0
    for k, u in enumerate(volts):
        speed[k] = x
        x += 1e-2 * 20.0 * (2.0 * u - x)
    speed += 0.01 * rng.standard_normal(1000)
    record = Record(
        TIME, {'voltage': volts, 'speed': speed}, {'voltage': 'V', 'speed': 'rad/s'}
    )
    found = fit_model([record], motor='brushed_dc_reduced')
    assert any('motion lies in the last 20% of the record' in w for w in found.result.warnings)
    assert found.held.error_percent < 1.0
    explicit = fit_model([record], [record], motor='brushed_dc_reduced')
    assert not any('motion lies in' in w for w in explicit.result.warnings)


def step_to(level: float, *, busy: bool = False) -> Record:
    """Return a step from rest, or one that is followed by others."""
    volts = np.full(TIME.size, level)
    if busy:
        volts[TIME > 9.0] *= 0.5
    speed, x = np.zeros(TIME.size), 0.0
    for k, u in enumerate(volts):
        speed[k] = x
        x += 1e-2 * 2.0 * (2.0 * u - x)
    return Record(TIME, {'voltage': volts, 'speed': speed}, {'voltage': 'V', 'speed': 'rad/s'})


def test_of_several_steps_from_rest_one_is_held_back_as_a_whole():
    """Once a motor has settled every model of it is right; how it settles is in no last part."""
    kind = motors()['brushed_dc_reduced']
    steps = [step_to(v) for v in (2.0, -4.0, 6.0, 3.0)]
    train, parts, said = parted(steps, [], kind, 0.2)
    assert train == steps[:3]
    assert [share for _, share in parts] == [1.0, 1.0, 1.0, 0.0]
    assert 'the whole of the last 1' in said[0]
    for others in ([*steps[:3], step_to(3.0, busy=True)], steps[:2]):
        train, parts, said = parted(others, [], kind, 0.2)
        assert train == others
        assert all(0.5 <= share < 1.0 for _, share in parts)
        assert said == ()
    train, parts, _ = parted(steps[:3], steps[3:], kind, 0.2)
    assert [share for _, share in parts] == [1.0, 1.0, 1.0, 0.0]


@pytest.mark.parametrize('names', [('speed',), ('position',)])
@pytest.mark.parametrize(('moves', 'left'), [(0.3, 330), (0.45, 495), (0.6, 1000)])
def test_of_an_idle_end_that_is_longer_than_the_run_little_is_left(names, moves, left):
    """Of 8 s of motion and 16 s of rest, what is held back were rest alone."""
    record = moving_until(moves, names)
    (kept_record,), _, said = parted([record], (), motors()['brushed_dc_reduced'], 0.2)
    assert len(kept_record) == pytest.approx(left, abs=12)
    idle = [line for line in said if 'neither the input nor the motor moves' in line]
    assert bool(idle) is (left < 1000)
    if idle:
        assert f'in the last {10.0 - 0.01 * len(kept_record):.3g} s: left out' in idle[0]
    assert parted([record], [record], motors()['brushed_dc_reduced'], 0.2)[0] == [record]


def test_three_records_one_of_which_ends_at_rest_say_so():
    records = [moving_until(share) for share in (1.0, 1.0, 0.7)]
    (line,) = parted(records, (), motors()['brushed_dc_reduced'], 0.2)[2]
    assert 'less than half of its due of the motion' in line


def test_a_motor_that_is_driven_or_runs_at_one_speed_to_the_end_is_not_idle():
    speed = np.where(TIME < 1.0, 0.0, 20.0)
    coasting = {'voltage': np.where(TIME < 1.0, 0.0, 2.0), 'speed': speed}
    stalled = {'voltage': 5.0 * np.sin(9 * TIME), 'speed': np.where(TIME < 1.0, 20.0, 0.0)}
    for signals in (coasting, stalled):
        record = Record(TIME, signals, {name: UNITS[name] for name in signals})
        assert len(parted([record], (), motors()['brushed_dc_reduced'], 0.2)[0][0]) == 1000
