"""A position that its sensor shows within one turn is continuous live, and in the replay, too."""

from collections.abc import Sequence
from dataclasses import replace
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
import pytest

pytest.importorskip('rclpy', reason='no ROS 2 here; install the extra `ros`')

from test_nodes_pipeline import JOINT, joint, VECTOR, vector

from motor_sysid.nodes.angles import Angles
from motor_sysid.nodes.configuration import Configuration
from motor_sysid.nodes.identifier_settings import IdentifierSettings
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.publishing import pack_diagnostics
from motor_sysid.nodes.replay import DIAGNOSTICS, replay
from motor_sysid.nodes.statuses import estimate_statuses, Status
from motor_sysid.nodes.topics import DEFAULT_SOURCES
from motor_sysid.recording.sources import Source
from motor_sysid.recording.writer import BagWriter

Array = NDArray[np.float64]
SECOND = 1_000_000_000
STEP = 2_000_000
TURN = 2 * np.pi
TOPICS = {'/motor/voltage': VECTOR, '/motor/current': VECTOR, '/motor/speed': JOINT}


def angle(k: int) -> float:
    """Return where the motor of these tests is at sample k: some turns to and fro, rad."""
    return 20.0 * math.sin(k / 60)


def sample(stamp: int, position: float) -> tuple[bytes, bytes, bytes]:
    k = stamp // STEP
    speed = 20.0 / 60 * math.cos(k / 60) * SECOND / STEP
    return (
        vector(stamp, 0.05 * speed + 0.1 * math.sin(k / 7)),
        vector(stamp, 0.3 * math.sin(k / 31)),
        joint(stamp, ['m'], [position], [speed]),
    )


def configuration(estimator: str = 'ekf') -> Configuration:
    return IdentifierSettings(estimator=estimator).configuration()


def pipeline(sources: Sequence[Source] = DEFAULT_SOURCES) -> Pipeline:
    given = configuration()
    plan = given.plan(sources)
    return given.pipeline(plan, [topic.reader() for topic in plan.topics], 10_000)


def push(target: Pipeline, numbers: Sequence[int], wrapped: bool = True) -> None:
    for k in numbers:
        shown = angle(k) % TURN if wrapped else angle(k)
        for topic, data in enumerate(sample(k * STEP, shown)):
            target.push(topic, data, 0)
        target.advance() if k % 7 else None


def position(target: Pipeline) -> Array:
    target.advance()
    record = target.record()
    assert record is not None
    return record['position']


def test_the_window_and_the_estimator_are_given_a_continuous_angle() -> None:
    shown, true = pipeline(), pipeline()
    push(shown, range(1, 900))
    push(true, range(1, 900), wrapped=False)
    found = position(shown)
    assert found == pytest.approx([angle(k) for k in range(1, 900)])
    assert found == pytest.approx(position(true))
    assert dict(shown.stream.estimate())['J'][0] == pytest.approx(
        dict(true.stream.estimate())['J'][0], rel=1e-6
    )


@pytest.mark.parametrize('gear', [1.0, 50.0])
def test_turns_are_those_of_the_sensor_before_its_gear(gear: float) -> None:
    sources = [
        replace(s, unit='turns', gear_ratio=gear, sign=-1) if s.signal == 'position' else s
        for s in DEFAULT_SOURCES
    ]
    target = pipeline(sources)
    for k in range(1, 400):
        for topic, data in enumerate(sample(k * STEP, angle(k) / TURN % 1.0)):
            target.push(topic, data, 0)
    assert position(target) == pytest.approx([-angle(k) / gear for k in range(1, 400)])


def test_what_begins_anew_forgets_the_turns() -> None:
    target = pipeline()
    push(target, range(1000, 1400))
    target.advance()
    target.reset()
    push(target, range(1400, 1500))
    assert position(target)[0] == pytest.approx(angle(1400) % TURN)
    push(target, range(100, 200))  # the stamps fall back
    assert position(target)[0] == pytest.approx(angle(100) % TURN)


def unwrap(shown: Sequence[float], **given: float) -> list[float]:
    source = Source('position', unit='rad', **given)  # type: ignore[arg-type]
    angles, values = Angles([source]), np.array(shown)[:, np.newaxis]
    angles.unwrap(values, np.arange(len(shown)) == 0)
    return values[:, 0].tolist()


def test_an_angle_of_several_turns_is_left_as_it_is() -> None:
    fast = [0.0, 0.5, 3.0, 9.0, 15.0, 9.0, 3.0]
    assert unwrap(fast) == fast
    nothing = unwrap([0.1, math.nan, 6.2, 0.1])
    assert nothing[0] == 0.1
    assert nothing[2:] == pytest.approx([6.2 - TURN, 0.1])


def test_a_motor_that_wrapped_once_may_turn_fast() -> None:
    """At 0.35 turns in a sample the angle jumps back by 0.65: less than the first time."""
    true = np.cumsum([0.1 * TURN] * 12 + [0.35 * TURN] * 20)
    assert unwrap(list(true % TURN)) == pytest.approx(true)


@pytest.mark.parametrize('gear', [1.0, 10.0])
def test_a_range_that_is_given_is_the_sensors(gear: float) -> None:
    """As of a servo that counts from -12.5 to 12.5 rad, outliers of the range or not."""
    true = np.cumsum([4.0, 7.0, 11.0, -3.0, 9.0, 12.0])
    shown = (true + 12.5) % 25 - 12.5
    given = {'wrap': 25.0, 'gear_ratio': gear}
    assert unwrap(list(shown / gear), **given) == pytest.approx(true / gear)
    whole_turns = list(np.cumsum([1.0] * 12) % TURN)
    assert unwrap(whole_turns, wrap=0.0) == whole_turns


def test_a_replay_unwraps_as_it_was_done_live(tmp_path: Path) -> None:
    """The recorder heard more than the identifier, which was reset and whose clock was set."""
    live, given = pipeline(), configuration()
    first, again = range(400, 1400), range(100, 390)
    events = []
    with BagWriter(tmp_path / 'bag') as bag:
        for name, kind in TOPICS.items():
            bag.add_topic(name, kind)
        for name in ('model', 'estimate'):
            bag.add_topic(f'/identifier/{name}', DIAGNOSTICS)
        status = Status('configuration', given.to_texts())
        bag.write('/identifier/model', 0, pack_diagnostics(0, '', [status]))
        for received, k in enumerate([*range(1, 400), *first, *again], 1):
            heard = k >= 400 or received > 1399
            for topic, data in enumerate(sample(k * STEP, angle(k) % TURN)):
                bag.write(list(TOPICS)[topic], received, data)
                if heard:
                    live.push(topic, data, 0)
            events += live.advance()
            if k == 1000:
                live.reset()
        for event in events:
            if event.estimate is not None:
                data = pack_diagnostics(event.stamp, '', estimate_statuses(event))
                bag.write('/identifier/estimate', 5000, data)
    check = replay(tmp_path / 'bag').check
    assert check is not None
    assert check.difference == ''
    assert (check.compared > 20, check.unreachable) == (True, 0)
