"""Where a stretch starts: in motion, at a state that is read from the measured signals."""

import numpy as np
import pytest

from motor_sysid.estimation.batch import Problem, starts_of, Weighting
from motor_sysid.estimation.batch.chains import make_chain
from motor_sysid.physics.effects import add_effect_file, catalogue
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

MOTOR = {'R': 1.2, 'L': 1.5e-3, 'k_t': 0.055, 'J': 8e-5, 'b': 3e-5}
UNITS = {'voltage': 'V', 'speed': 'rad/s', 'position': 'rad', 'current': 'A'}


def started(dt, speed, **others):
    """Return the state at which a free run over a record starts, by name."""
    columns = {'voltage': np.ones(speed.size), 'speed': speed, **others}
    columns = {name: values for name, values in columns.items() if values is not None}
    kind = motor('brushed_dc' if 'current' in columns else 'brushed_dc_reduced')
    outputs = [name for name in ('current', 'speed') if name in columns] or ['position']
    record = Record(dt * np.arange(speed.size), columns, {n: UNITS[n] for n in columns})
    return dict(zip(kind.states, make_chain(record, kind, outputs)[0].state, strict=True))


def test_a_smooth_start_is_read_through_its_noise():
    rng = np.random.default_rng(3)
    smooth = 200.0 + 50.0 * np.sin(4.0 * 1e-3 * np.arange(2000))
    starts = [started(1e-3, smooth + rng.normal(size=2000))['omega'] for _ in range(40)]
    assert np.std(starts) < 0.8
    assert np.mean(starts) == pytest.approx(200.0, abs=0.4)


def test_a_start_into_a_step_is_the_sample_itself():
    """At 10 Hz the motor has settled a sample after the step; no parabola follows that."""
    rng = np.random.default_rng(4)
    levels = np.repeat(rng.uniform(-600, 600, 40), 10)
    levels[0] = 5.0
    noisy = levels + 0.5 * rng.normal(size=400)
    assert started(0.1, noisy)['omega'] == noisy[0]
    current = 0.01 * levels + 1e-3 * rng.normal(size=400)
    state = started(0.1, noisy, current=current)
    assert state['omega'] == noisy[0]
    assert state['i'] == current[0]


def test_a_start_into_a_step_is_not_read_through_it():
    """At 200 Hz, as a level changes: of the current no start is sought, of the speed one is."""
    rng = np.random.default_rng(5)
    rows = np.arange(300)
    rise = np.where(rows > 0, 1.0 - np.exp(-rows / 3.4), 0.0)
    speed = 100.0 + 400.0 * rise + rng.normal(size=300)
    answer = np.where(rows > 0, np.exp(-rows / 3.4), 0.0)
    current = 0.5 + 8.0 * answer + 0.02 * rng.normal(size=300)
    state = started(5e-3, speed, current=current)
    assert state['omega'] == pytest.approx(100.0, abs=25.0)
    assert state['i'] == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize(
    'shown', [{'speed_sensor_offset': {'o': 40.0}}, {'speed_sensor_scale': {'g': 0.2}},
              {'speed_sensor_offset': {'o': -25.0}, 'speed_sensor_scale': {'g': -0.1}}],
)  # fmt: skip
@pytest.mark.parametrize('start', [0, 320])
def test_a_run_begins_at_the_speed_that_the_sensor_stands_for(shown, start):
    """A motor at rest whose tachometer shows 40 rad/s does not begin with 40 rad/s."""
    model = Model.base('brushed_dc', MOTOR)
    for key, values in shown.items():
        model = model.with_effect(key, values)
    time = 1e-3 * np.arange(800)
    volts = Record(time, {'voltage': 10.0 * np.sin(30.0 * time)}, {'voltage': 'V'})
    run = simulate(model, volts)
    columns = {'voltage': volts['voltage'], 'current': run.outputs['current'],
               'speed': run.outputs['speed']}  # fmt: skip
    record = Record(time, columns, {n: UNITS[n] for n in columns}).slice(start, 800)
    outputs = ['current', 'speed']
    problem = Problem(model, [make_chain(record, model.kind, outputs)], outputs)
    (left,) = problem.linearize(problem.vector(), parameters=False)
    assert np.max(np.abs(left.residual[:, 1])) < 0.5
    place = model.kind.states.index('omega')
    table = problem.values(problem.vector()[np.newaxis])
    begun = np.atleast_2d(starts_of(model, table, problem.stretches[:1])[0])
    truth = simulate(Model.base('brushed_dc', MOTOR), volts).outputs['speed'][start]
    assert begun[0, place] == pytest.approx(truth, abs=0.5)


def test_a_sensors_law_may_ask_for_more_than_what_the_sensor_shows(tmp_path):
    """An encoder that runs out, by an angle that is known, and a law that sees the current."""
    (tmp_path / 'run_out.py').write_text(
        'from numpy import cos\n'
        'from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale\n'
        "CARD = Card(title='t', equation='e', symptom='s.', reference='r', enters=Enters.SENSOR,\n"
        "            amplitudes=(Amplitude('a', '1', 'd', Scale.ONE),))\n\n"
        'def speed_sensor(omega, theta, i, R, a):\n'
        '    return a * (omega * cos(theta) + R * i)\n'
    )
    add_effect_file(tmp_path / 'run_out.py')
    try:
        model = Model.base('brushed_dc', MOTOR).with_effect('run_out', {'a': 0.3})
        time = 1e-3 * np.arange(800)
        volts = Record(time, {'voltage': 10.0 * np.sin(30.0 * time)}, {'voltage': 'V'})
        seen = simulate(model, volts).outputs
        columns = {'voltage': volts['voltage'], **{n: seen[n] for n in seen if n in UNITS}}
        record = Record(time, columns, {n: UNITS[n] for n in columns}).slice(320, 800)
        problem = Problem(
            model, [make_chain(record, model.kind, ['current', 'speed'])], ['current', 'speed']
        )
        table = problem.values(problem.vector()[np.newaxis])
        begun = np.atleast_2d(starts_of(model, table, problem.stretches)[0])[0]
    finally:
        catalogue().pop('run_out')
    truth = simulate(Model.base('brushed_dc', MOTOR), volts).outputs['speed'][320]
    assert abs(record['speed'][0] - truth) > 10.0
    assert begun[model.kind.states.index('omega')] == pytest.approx(truth, abs=0.5)


@pytest.mark.parametrize('given', [{'horizon': 0.5}, {'train_fraction': 0.5, 'lent': True}])
def test_the_angle_goes_on_from_stretch_to_stretch(given):
    """Where the speed adds up to it, too: waves over a turn do not begin anew with a stretch."""
    rng = np.random.default_rng(6)
    speed = 30.0 * np.repeat(rng.uniform(-1, 1, 40), 100)
    columns = {'voltage': np.ones(4000), 'speed': speed}
    record = Record(1e-3 * np.arange(4000), columns, {n: UNITS[n] for n in columns})
    chain = make_chain(record, motor('brushed_dc_reduced'), ['speed'], **given)
    assert len(chain) > 2
    angle = np.concatenate([stretch.drive.position for stretch in chain])
    np.testing.assert_allclose(angle, np.cumsum(speed) * 1e-3, atol=1e-9)
    starts = [stretch.drive.start for stretch in chain]
    np.testing.assert_allclose(starts, [stretch.record.time[0] for stretch in chain], atol=1e-9)


def test_stretches_that_are_weighed_together_are_weighed_as_each_alone():
    """Those of one shape follow each other; another shape, and one without directions, between."""
    rng = np.random.default_rng(3)
    weighting = Weighting(np.array([0.5, 2.0]), (np.array([1.0, -0.4]), np.array([1.0, 0.2])))
    sizes = [(60, 2), (60, 2), (40, 2), (60, 0), (60, 2)]
    values = [rng.normal(size=(n, 2, 3)) for n, _ in sizes]
    free = [rng.normal(size=(n, 2, m)) for n, m in sizes]
    together = weighting.removed(values, free)
    for one, direction, found in zip(values, free, together, strict=True):
        flat, away = weighting.flat(one), weighting.flat(direction)
        left = flat - away @ np.linalg.lstsq(away, flat, rcond=None)[0] if away.size else flat
        assert found == pytest.approx(left, abs=1e-12)
