"""A running identifier changes its model: hand-over, start values, refusals, jobs."""

from collections.abc import Mapping
from dataclasses import replace
import random

from closed_loop import FRICTION, wrong_motor
from closed_loop import samples as samples_of_a_motor
import numpy as np
from numpy.typing import NDArray
import pytest
from ros_harness import wait_for
from small_jobs import Add

from motor_sysid.diagnosis import Candidate
from motor_sysid.errors import UserError
from motor_sysid.estimation.stream import EstimateStream, Event, Rates
from motor_sysid.nodes.configuration import Configuration
from motor_sysid.nodes.editing import edited
from motor_sysid.nodes.jobs import Jobs
from motor_sysid.nodes.live_diagnosis import DiagnosisOutcome, Rung
from motor_sysid.nodes.worker import Failed
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Provenance, Record

Array = NDArray[np.float64]
SECOND = 1_000_000_000
RATES = Rates(SECOND // 10, SECOND // 50)


# --- another estimator takes over


class Sum:
    """An estimator whose every number depends on the order of all that it was given."""

    def __init__(self, dt: float) -> None:
        self.dt, self.value, self.last = dt, 0.0, 0.0

    def update(self, t: Array, inputs: Array, outputs: Array, fresh: Array) -> None:
        for row in zip(t, inputs[:, 0], outputs[:, 0], strict=True):
            self.value = 0.999 * self.value + float(np.sin(row).sum())
            self.last = float(row[2])

    def estimate(self) -> Mapping[str, tuple[float, float, str, bool]]:
        return {'sum': (self.value, 1.0, '1', True)}

    def prediction(self) -> Mapping[str, float]:
        return {'speed': self.value}

    def residual(self) -> Mapping[str, float]:
        return {'speed': self.last - self.value}


def samples(count: int) -> tuple[NDArray[np.int64], Array, Array]:
    rng = np.random.default_rng(3)
    stamps = 7_123_456_789 + 2_000_000 * np.arange(count)
    return stamps, rng.normal(size=(count, 1)), rng.normal(size=(count, 1))


class Slow(Sum):
    """One that knows nothing in its first second."""

    def estimate(self) -> Mapping[str, tuple[float, float, str, bool]]:
        first = self.begun if hasattr(self, 'begun') else 0.0
        return {'sum': (-1.0, 1.0, '1', self.now - first > 1.0), 'extra': (2.0, 1.0, '1', True)}

    def update(self, t: Array, inputs: Array, outputs: Array, fresh: Array) -> None:
        if not hasattr(self, 'begun'):
            self.begun = float(t[0])
        self.now = float(t[-1])
        super().update(t, inputs, outputs, fresh)


def unchanged(count: int) -> list[Event]:
    return EstimateStream(Sum, RATES).feed(*samples(count))


def changed(sizes: list[int], at: int | None, when: int = 0) -> tuple[list[Event], int]:
    """Feed samples; ask for the change before batch `when`, or give its stamp at the start."""
    stamps, inputs, outputs = samples(sum(sizes))
    stream, events, start = EstimateStream(Sum, RATES), [], 0
    if at is not None:
        stream.change(Slow, at)
    for k, size in enumerate(sizes):
        if at is None and k == when:
            stream.change(Sum)  # superseded before a sample came
            stream.change(Slow)
        part = slice(start, start + size)
        events += stream.feed(stamps[part], inputs[part], outputs[part])
        start += size
    assert not stream.waiting
    return events, stream.changed


@pytest.mark.parametrize('when', [0, 3, 40, 200])
def test_a_change_given_by_its_stamp_is_the_change_that_was_made_live(when: int) -> None:
    rng = random.Random(1)
    sizes = [rng.randint(1, 12) for _ in range(250)]
    live, since = changed(sizes, None, when)
    assert since == samples(1)[0][0] + 2_000_000 * sum(sizes[:when])
    count = sum(sizes)
    for bunches in ([count], [7] * (count // 7) + [count % 7 or 7][: count % 7]):
        assert changed(bunches, since) == (live, since)


def test_the_old_estimator_speaks_until_the_new_one_knows_as_much() -> None:
    events, since = changed([500, 1500], None, 1)
    told = {e.stamp: e.estimate for e in events if e.estimate is not None}
    old = [s for s, found in told.items() if found['sum'][0] != -1.0]
    assert all('extra' not in told[s] for s in old if s < since)
    assert all('extra' in found for s, found in told.items() if s >= since)
    assert 0.9 < (max(old) - since) / SECOND < 1.2
    alone = unchanged(2000)
    same = [e for e in alone if e.stamp <= max(old)]
    assert [e.residual for e in events if e.stamp <= max(old)] == [e.residual for e in same]


def test_a_reset_keeps_the_change_and_stamps_may_fall_back() -> None:
    stamps, inputs, outputs = samples(300)
    stream = EstimateStream(Sum, RATES)
    stream.feed(stamps, inputs, outputs)
    stream.change(Slow, int(stamps[100]))  # lies behind: waits for the time to come again
    stream.feed(stamps[-1:] + 2_000_000, inputs[:1], outputs[:1])
    assert stream.waiting
    events = stream.feed(stamps, inputs, outputs)
    assert stream.changed == stamps[100]
    assert 'extra' not in (next(e for e in events if e.estimate).estimate or {})
    assert 'extra' in stream.estimate()
    stream.reset()
    stream.feed(stamps, inputs, outputs)
    assert stream.estimate()['sum'][0] == -1.0, 'it begins with the new kind at once'


@pytest.mark.parametrize('estimator', ['rls', 'ekf'])
def test_a_real_estimator_hands_over_and_learns_the_new_effect(estimator: str) -> None:
    """Friction starts at zero: no diagnosis has told it."""
    plain = wrong_motor().without_effect('coulomb_friction')
    first = Configuration(plain, estimator)
    rows = samples_of_a_motor(10.0)
    stamps = SECOND + np.round(1e9 * rows[:, 0]).astype(np.int64)
    inputs, outputs = rows[:, 1:2], rows[:, 2:5]
    stream = EstimateStream(first.make, RATES)
    head = stream.feed(stamps[:5000], inputs[:5000], outputs[:5000])
    new = replace(first, model=edited(plain, ['coulomb_friction'], stream.estimate()))
    stream.change(new.make)
    tail = stream.feed(stamps[5000:], inputs[5000:], outputs[5000:])
    value, sigma, _, known = stream.estimate()['coulomb_friction.tau_c']
    assert known
    assert value == pytest.approx(FRICTION, rel=0.1)
    assert sigma < 0.2 * FRICTION
    speed = np.array([event.residual['speed'] for event in (*head, *tail)])
    assert np.isfinite(speed[1:]).all()
    before, after = (np.sqrt(np.mean(part**2)) for part in (speed[100:250], speed[-150:]))
    assert after < 0.9 * before
    overlap = speed[250:420]  # 0 to 3.4 s after the change, the hand-over in it
    assert np.max(np.abs(overlap)) < 1.1 * np.max(np.abs(speed[100:250])), 'no jump'


# --- which model a running identifier may be given


RUNNING = Model.base('brushed_dc', {'R': 2.0, 'k_t': 0.05})


def turning(speed: float = 40.0) -> Record:
    t = 0.002 * np.arange(4000)
    omega = speed * np.sin(2 * np.pi * 0.5 * t)
    units = {'voltage': 'V', 'current': 'A', 'speed': 'rad/s', 'position': 'rad'}
    signals = {'voltage': 0.1 * omega, 'current': 0.02 * omega, 'speed': omega,
               'position': np.cumsum(omega) * 0.002}  # fmt: skip
    return Record(t, signals, units, Provenance('made up'))


def test_a_new_effect_starts_small_and_the_motor_keeps_what_was_learned() -> None:
    estimates = {'R': (1.7, 0.1, 'ohm', True), 'L': (9.0, 5.0, 'H', False)}
    new = edited(RUNNING, ['coulomb_friction'], estimates)
    assert (new['R'], new['L']) == (1.7, RUNNING['L']), 'what is not identified is not taken'
    assert (new.effects, new['coulomb_friction.tau_c']) == (('coulomb_friction',), 0.0)
    shaped = edited(new, ['coulomb_friction', 'flexible_shaft'], {}, None, turning())
    assert shaped.effects == ('coulomb_friction', 'flexible_shaft')
    assert edited(shaped, []).effects == ()


@pytest.mark.parametrize(
    ('effects', 'record', 'message'),
    [
        (['witchcraft'], None, 'unknown effect'),
        (['inertia_change'], None, 'follows by itself. Call `~/reset`'),
        (['periodic_load'], turning(), 'f to start from: call `~/diagnose` first'),
        (['stribeck_friction'], None, 'none have come yet'),
        (['stribeck_friction'], turning().slice(0, 99), '99 have come yet'),
        (['cogging_torque'], turning().slice(0, 12), '12 have come yet'),
        (['stribeck_friction'], turning(0.0), 'at rest'),
        (['cogging_torque'], turning(0.0), 'no number of waves'),
    ],
)
def test_what_cannot_be_carried_is_refused_with_a_remedy(
    effects: list[str], record: Record | None, message: str
) -> None:
    with pytest.raises(UserError, match=message):
        edited(RUNNING, effects, {}, None, record)


def outcome(rungs: tuple[Rung, ...], candidates: tuple[Candidate, ...] = ()) -> DiagnosisOutcome:
    return DiagnosisOutcome(
        'effect_missing', ('coulomb_friction',), (), ('because',), rungs, candidates, None, 0, 1,
        0.1, {}, (), 1.0,
    )  # fmt: skip


def test_the_fit_of_the_last_diagnosis_is_taken_where_it_has_these_effects() -> None:
    fitted = RUNNING.with_effect('coulomb_friction', {'tau_c': 0.02}).with_values({'b': 1e-6})
    found = outcome((Rung(RUNNING, 9.0, 9.0), Rung(fitted, 1.0, 1.0)))
    estimates = {'b': (5e-5, 1e-6, 'N m s/rad', True)}
    assert edited(RUNNING, fitted.effects, estimates, found)['b'] == 1e-6
    both = edited(RUNNING, [*fitted.effects, 'constant_load_torque'], estimates, found)
    assert (both['b'], both['coulomb_friction.tau_c']) == (5e-5, 0.02)


def test_a_candidate_that_lost_still_tells_where_to_start() -> None:
    values = {'a': (1.0, 'N m', 0.1), 'b': (1.0, 'N m', 0.1), 'f': (12.5, 'Hz', 0.1)}
    lost = Candidate('periodic_load', 'periodic load', 'mechanical', '', 1.0, 1.0, 1.0, values)
    new = edited(RUNNING, ['periodic_load'], {}, outcome((Rung(RUNNING, 9.0, 9.0),), (lost,)))
    assert new['periodic_load.f'] == 12.5
    assert new['periodic_load.a'] == 0.0, 'its phase counts from the start of the window'


def test_a_configuration_reads_back_to_the_bit() -> None:
    model = RUNNING.with_effect('coulomb_friction', {'tau_c': 0.1 + 0.2})
    given = Configuration(model, 'ekf', 0.002, 10.0, 50.0, 1e-9, 1_700_000_000_123_456_789)
    assert Configuration.from_texts(given.to_texts()) == given
    old = {k: v for k, v in given.to_texts().items() if k not in ('since', 'effects')}
    assert Configuration.from_texts(old).since == 0


# --- long work


def test_jobs_wait_for_each_other_and_a_dead_worker_is_told() -> None:
    jobs, came = Jobs(), []
    made = {'one': Add(1), 'bad': Add(-1), 'dead': Add(0), 'last': Add(5), 'none': None}
    for kind, job in made.items():
        assert jobs.ask(kind, lambda j=job: j)
        assert not jobs.ask(kind, lambda: Add(9)), 'one of a kind'

    def look() -> bool:
        done = jobs.poll()
        came.extend([done.outcome] if done else [])
        return len(came) == 4

    wait_for(look, 'four outcomes', 90)
    assert came == [2, Failed('negative'), Failed('the worker process ended'), 6]
    assert jobs.running == ''
    jobs.close()
