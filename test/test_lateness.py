"""What the position beside a speed tells of the speed's sensor, whatever the motor does."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose
from motor_sysid.diagnosis.candidates.variants import _choices, variants
from motor_sysid.diagnosis.engine import Engine
from motor_sysid.diagnosis.fitting import bench_of
from motor_sysid.diagnosis.search import trial
from motor_sysid.diagnosis.search.gates import is_told, UNCERTAIN
from motor_sysid.diagnosis.search.pairs import beginning
from motor_sysid.diagnosis.search.ranking import chosen
from motor_sysid.diagnosis.search.rounds import scored
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.diagnosis.search.speed_sensors import filter_box, is_filtered, speed_sensors
from motor_sysid.diagnosis.settings import Settings
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import scales_of
from motor_sysid.signals import Record
from motor_sysid.signals.doctor import examine
from motor_sysid.signals.lateness import Lateness, speed_lateness

DT, ROWS = 5e-3, 4000
TIME = DT * np.arange(ROWS)
WAVES = ((1.0, 0.7, 0.0), (0.6, 2.3, 1.0), (0.3, 5.1, 2.0))
"""Amplitude in rad, angular frequency in rad/s and phase in rad of each part of the motion."""
COUNT = 2 * np.pi / 4096


FREE = 0.0, np.inf
LAG = effect('speed_sensor_lag')


def angle(time):
    return sum(a * np.sin(w * time + p) for a, w, p in WAVES)


def filtered(lag):
    """Return the settled output, rad/s, of a first-order filter of the speed: exact."""
    return sum(
        a * w / np.hypot(1.0, w * lag) * np.cos(w * TIME + p - np.arctan(w * lag))
        for a, w, p in WAVES
    )


def recorded(speed, position=None, **more):
    counts = COUNT * np.floor(angle(TIME) / COUNT)
    signals = {
        'torque': np.cos(TIME), 'position': counts if position is None else position,
        'speed': speed, **more,
    }  # fmt: skip
    return Record(TIME, signals, {'torque': 'N m', 'position': 'rad', 'speed': 'rad/s'})


def noise(seed, size):
    return size * np.random.default_rng(seed).normal(size=ROWS)


@pytest.mark.parametrize('lag', [0.0, 1e-3, 8e-3, 0.05])
@pytest.mark.parametrize('size', [0.0, 0.05])
def test_a_filter_is_read_from_position_and_speed(lag, size):
    """Fails by chance once in 15,000: the seed is fixed, the limit is four standard errors."""
    found = speed_lateness([recorded(filtered(lag) + noise(3, size))])
    assert abs(found.seconds - lag) < 4.0 * found.sigma + 2e-5
    assert found.sigma < 5e-4


def test_noise_of_the_speed_does_not_make_it_look_prompt():
    """Where most of what the speed does is noise, an ordinary regression sees no lag."""
    quiet = recorded(filtered(0.05) + noise(4, 2.0))
    found = speed_lateness([quiet])
    assert abs(found.seconds - 0.05) < 4.0 * found.sigma
    assert found.sigma < 0.02


def test_a_difference_is_half_a_sample_late_and_its_filter_more():
    counts = COUNT * np.floor(angle(TIME) / COUNT)
    difference = np.diff(counts, prepend=counts[0]) / DT
    assert speed_lateness([recorded(difference)]).seconds == pytest.approx(DT / 2, rel=1e-3)
    passed, share = np.zeros(ROWS), -np.expm1(-DT / 0.03)
    for k in range(1, ROWS):
        passed[k] = passed[k - 1] + share * (difference[k] - passed[k - 1])
    late = DT / np.expm1(DT / 0.03) + DT / 2
    assert speed_lateness([recorded(passed)]).seconds == pytest.approx(late, rel=1e-3)


def test_scale_and_offset_of_the_speed_are_no_lag():
    found = speed_lateness([recorded(1.2 * filtered(0.01) + 0.3)])
    assert found.seconds == pytest.approx(0.01, rel=0.02)


@pytest.mark.parametrize(
    'record',
    [
        recorded(np.full(ROWS, 2.0), 2.0 * TIME),  # one speed
        recorded(np.repeat(filtered(0.0)[::5], 5)),  # new in every fifth row alone
        Record(TIME, {'speed': filtered(0.0)}, {'speed': 'rad/s'}),
    ],
)
def test_what_does_not_tell_says_nothing(record):
    assert speed_lateness([record]) is None


@pytest.mark.parametrize(
    ('speed', 'code'),
    [(filtered(0.02), 'speed_late'), (filtered(-0.01), 'position_late'), (filtered(0.0), None)],
)
def test_the_doctor_tells_which_of_the_two_is_late(speed, code):
    found = {one.code: one for one in examine(recorded(speed + noise(5, 0.02)))}
    late = {'speed_late', 'position_late'} & set(found)
    assert late == ({code} if code else set())
    if code:
        assert abs(found[code].numbers['lag_s']) == pytest.approx(
            0.02 if code == 'speed_late' else 0.01, rel=0.05
        )


@pytest.mark.parametrize(
    ('late', 'sensors', 'told', 'box'),
    [
        (None, 2, None, FREE),
        (Lateness(1e-4, 1e-5), 1, False, FREE),  # of the moment
        (Lateness(2.5e-3, 1e-5), 2, False, FREE),  # a mean over a sample, or near it
        (Lateness(3.3e-3, 1e-4), 2, None, FREE),
        (Lateness(2e-2, 1e-4), 2, True, (1.96e-2 / 1.05 - 2.5e-3, 1.05 * 2.04e-2 + 2.5e-3)),
        (Lateness(2e-2, 5e-3), 2, None, FREE),  # too vague
    ],
)
def test_what_is_made_of_it(late, sensors, told, box):
    record = recorded(filtered(0.0))
    assert len(speed_sensors([record], ('speed',), late)) == sensors
    assert is_filtered(late, DT) is told
    assert filter_box(late, DT) == pytest.approx(box)


def test_a_filter_that_is_seen_wins_and_has_no_rivals():
    def tried(key, gain):
        model = Model.base('mechanical_axis').with_effect(key)
        runs = SimpleNamespace(predictions=())
        return SimpleNamespace(
            key=key, passes=True, delta_bic=gain, gain_percent=30.0, excess=5.0, note='',
            scored=SimpleNamespace(
                variant=SimpleNamespace(effect=effect(key), inherits=False, model=model)
            ),
            rung=SimpleNamespace(model=model, training=runs, validation=runs),
        )  # fmt: skip

    trials = [tried('input_delay', 1000.0), tried('speed_sensor_lag', 500.0)]
    winner, rivals = chosen(trials, trials[0].rung, filtered=True)
    assert (winner.key, rivals) == ('speed_sensor_lag', ())
    winner, _ = chosen(trials, trials[0].rung, filtered=None)
    assert winner.key == 'input_delay'


@pytest.mark.parametrize(('told', 'tried'), [(False, False), (None, True), (True, True)])
def test_a_filter_is_not_tried_where_there_is_none(told, tried):
    bench = SimpleNamespace(filtered=told, records=(), roles=())
    both = [effect('input_delay'), effect('speed_sensor_lag')]
    engine = Engine(bench, both, Settings(), print, {})
    assert ('speed_sensor_lag' in [one.key for one in engine.candidates]) is tried
    assert 'input_delay' in [one.key for one in engine.candidates]


def test_a_filter_is_as_long_as_told():
    record = recorded(filtered(0.02))
    scales = scales_of('mechanical_axis', {'J': 0.1, 'b': 0.1, 'gain': 1.0}, [record])
    told = replace(scales, speed_filter=(0.017, 0.023))
    model = Model.base('mechanical_axis').with_effect('speed_sensor_lag', None, told)
    lag = model.parameters['speed_sensor_lag.lag']
    assert (lag.value, lag.lower, lag.upper) == (0.017, 0.017, 0.023)
    assert is_told(model, 'speed_sensor_lag')  # though it sits on a bound
    tried = [v.values['lag'] for v in variants(Model.base('mechanical_axis'), told, [LAG], {})]
    assert tried == [0.017, 0.023]
    free = Model.base('mechanical_axis').with_effect('speed_sensor_lag', None, scales)
    assert free.parameters['speed_sensor_lag.lag'].upper == pytest.approx(200 * DT)


def servo(seed):
    """Return a servo of 250 Hz without a measured current, whose drive filters by 10 ms.

    The truth is exact: `k_a d omega/dt = u - k_v omega`, the voltage held over each sample.
    """
    dt, rows, lag = 4e-3, 3000, 0.01
    time = dt * np.arange(rows)
    voltage = 4.0 * np.sin(2 * np.pi * (0.3 + 0.05 * seed) * time)
    voltage += 2.0 * np.sin(2 * np.pi * (0.5 + 0.06 * time) * time)
    k_v, k_a = 1.6, 0.0386
    decay = np.exp(-k_v / k_a * dt)
    omega, theta = np.zeros(rows), np.zeros(rows)
    for k in range(rows - 1):
        ends = voltage[k] / k_v
        omega[k + 1] = ends + decay * (omega[k] - ends)
        theta[k + 1] = theta[k] + ends * dt + (omega[k] - ends) * (1.0 - decay) * k_a / k_v
    counts = 1e-4 * np.floor(theta / 1e-4)
    shown, share = np.zeros(rows), -np.expm1(-dt / lag)
    for k in range(1, rows):
        shown[k] = shown[k - 1] + share * ((counts[k] - counts[k - 1]) / dt - shown[k - 1])
    signals = {'voltage': voltage, 'position': counts, 'speed': shown}
    record = Record(time, signals, {'voltage': 'V', 'position': 'rad', 'speed': 'rad/s'})
    return record.slice(333, rows)


def test_a_filter_beside_a_position_is_no_delay():
    """Run on smoothly from records that begin in motion, this was told as a delay."""
    late = 'armature_inductance', 'input_delay', 'speed_sensor_lag'
    found = diagnose([servo(1)], [servo(2)], motor='brushed_dc_reduced', effects=late)
    assert found.effects == ('speed_sensor_lag',)
    assert found.rivalries == ()
    assert 'The position shows it, whatever the motor does: 10' in found.evidence[0].words
    lag = found.steps[-1].model.parameters['speed_sensor_lag.lag']
    assert abs(lag.value - 0.01) < 0.3 * 4e-3
    assert found.steps[-1].model['k_a'] == pytest.approx(0.0386, rel=0.02)


@pytest.mark.parametrize(('told', 'note'), [(True, ''), (None, UNCERTAIN), (False, UNCERTAIN)])
def test_what_is_seen_needs_no_more_than_evidence(monkeypatch, told, note):
    bench, model = bench_of([servo(1)], [servo(2)], None, 'brushed_dc_reduced', {}, 0.2)
    assert bench.filtered
    rung = climb(model, bench)
    one = effect('speed_sensor_lag')
    scores = scored(rung, bench, [one], lambda text: None)
    new = climb(model.with_effect(one.key, {'lag': 0.01}, bench.scales), bench)
    monkeypatch.setattr(trial, 'gate_note', lambda *args, **more: UNCERTAIN)
    level = trial.Level.of(rung, bench, scores.weighting)
    best = max(scores.singles, key=lambda s: s.gain)
    assert trial.judged(best, new, level, replace(bench, filtered=told)).note == note


def test_trials_of_what_is_no_filter_are_kept_as_they_are():
    """A user's own effect may be tried at values below zero, and in any order."""
    (amplitude,) = effect('input_delay').card.amplitudes
    card = replace(effect('input_delay').card, amplitudes=(replace(amplitude, trials=(2, -1)),))
    own = replace(effect('input_delay'), card=card)
    motor, record = {'J': 0.1, 'b': 0.1, 'gain': 1.0}, recorded(filtered(0.0))
    scales = scales_of('mechanical_axis', motor, [record])
    choices = [one['delay'] / scales.sample for one in _choices(own, scales, (), set())]
    assert choices == pytest.approx([2.0, -1.0])


def test_a_second_climb_begins_with_what_is_seen():
    def rung(*effects):
        return SimpleNamespace(model=SimpleNamespace(effects=effects)), list(effects)

    bench = SimpleNamespace(shows=lambda key: key == 'speed_sensor_lag')
    lag, friction = 'speed_sensor_lag', 'coulomb_friction'
    ladder = [rung('iron_loss'), rung('iron_loss', lag), rung('iron_loss', lag, friction)]
    assert beginning(ladder, bench) == (ladder[:1], ladder[1])
    assert beginning(ladder[:2], bench) == (ladder[:1], ladder[1])
    others = [rung(), rung(friction), rung(friction, lag)]
    assert beginning(others, bench) == ([], others[0])
