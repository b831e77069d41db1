"""What was sampled at times of its own is compared with the model as it was then."""

from bench_motor import DT, MOTOR, voltage_profile
import numpy as np
import pytest
from slow_motor import FINE, records, SLOW, UNITS

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.candidates.left_noise import left_noise
from motor_sysid.diagnosis.search.bench import prepared
from motor_sysid.estimation.batch import fit, linear_of, make_chain, Problem, sensors_of, white
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.doctor import seen_by_fits
from motor_sysid.signals.record import Record, Samples

KIND, OUTPUTS = motor('brushed_dc'), ('speed', 'current')
@pytest.mark.parametrize('delay', [0.0, 2.3e-3])
def test_a_current_between_rows_goes_as_it_does_under_a_held_input(delay):
    """Its time constant is half a row: straight lines are off by a tenth, this by 1/50 of that."""
    volts = voltage_profile('steps', 2.0, np.random.default_rng(0))
    model = Model.base('brushed_dc', {**MOTOR, 'L': 1.2e-3})
    model = model.with_effect('input_delay', {'delay': delay}) if delay else model
    fine, every = DT / FINE * np.arange(FINE * volts.size), slice(7, None, FINE + 3)
    units = {'voltage': 'V'}
    inner = Record(fine, {'voltage': np.repeat(volts, FINE)}, units)
    true = simulate(model, inner, follow_position=False).outputs['current']
    rows = Record(fine[::FINE], {'voltage': volts}, units)
    coarse = simulate(model, rows, follow_position=False).outputs['current']
    own = fine[every]
    samples = {'current': Samples(own, np.zeros(own.size))}
    none = np.zeros(len(rows))
    signals = {'voltage': volts, 'current': none, 'speed': none}
    (stretch,) = make_chain(
        Record(rows.time, signals, UNITS, samples=samples), KIND, ('current',)
    )
    table = {name: np.array([v]) for name, v in model.parameters.values().items()}
    linear = linear_of(model, table, ('current',))
    shown = stretch.shown(coarse[:, np.newaxis, np.newaxis], linear)[:, 0, 0]
    now = true[every][np.clip(np.searchsorted(own, rows.time, 'right') - 1, 0, None)]
    straight = np.interp(own, rows.time, coarse) - true[every]
    assert np.max(np.abs(straight)) > 0.08 * np.max(np.abs(true))
    assert np.max(np.abs(shown - now)[20:]) < 0.03 * np.max(np.abs(straight))


def test_a_fit_takes_slow_signals_for_what_they_are():
    """Errors of parameters as if all had been sampled in every row, or less than a percent."""
    data = prepared(records('current', 'speed', 'position'), 'brushed_dc', MOTOR)
    sensors = sensors_of(data, KIND)
    chains = [make_chain(r, KIND, OUTPUTS, sensors=sensors) for r in data]
    begun = Model.base('brushed_dc', MOTOR, speed_sensor=SpeedSensor.DIFFERENCE)
    found = fit(Problem(begun, chains, OUTPUTS)).model
    for name, within in (('R', 0.003), ('L', 0.02), ('k_t', 0.001), ('J', 0.003)):
        assert found[name] == pytest.approx(MOTOR[name], rel=within), name


def test_what_is_shown_for_several_rows_counts_as_one_error():
    """Else each sample of a slow sensor would speak as many times as it is repeated."""
    (stretch,) = make_chain(records('current')[0], KIND, OUTPUTS)
    problem = Problem(Model.base('brushed_dc', MOTOR), [(stretch,)], OUTPUTS)
    assert problem.fresh[0] == 1.0
    assert problem.fresh[1] == pytest.approx(DT / SLOW['current'], rel=0.01)
    near = problem.linearize(problem.vector())
    raw = [np.concatenate((one.residual[..., np.newaxis], one.slope), 2) for one in near]
    size = white([one.residual for one in near])
    left = left_noise(problem, raw, [one.start for one in near], size)
    squares = left.flat(near[0].residual[..., np.newaxis]) ** 2
    speed, current = np.sum(squares.reshape(-1, 2), axis=0)
    samples = stretch.sampling[1].times.size
    assert speed == pytest.approx(len(stretch.record), rel=0.1)
    assert current == pytest.approx(samples, rel=0.3)


def test_pieces_of_a_record_show_what_the_whole_shows():
    record = records('current', 'speed', 'position')[0]
    (whole,) = make_chain(record, KIND, OUTPUTS)
    pieces = make_chain(record, KIND, OUTPUTS, horizon=1.0)
    assert len(pieces) == 8
    rng = np.random.default_rng(0)
    run = np.cumsum(rng.normal(size=(len(record), 2, 1)), axis=0)
    model = Model.base('brushed_dc', MOTOR)
    table = {name: np.array([v]) for name, v in model.parameters.values().items()}
    linear = linear_of(model, table, OUTPUTS)
    shown, first = whole.shown(run, linear), 0
    for piece in pieces:
        last = first + len(piece.record)
        part = piece.shown(run[first:last], linear)
        assert part[25:] == pytest.approx(shown[first + 25 : last], abs=1e-6)
        assert np.array_equal(piece.measured, whole.measured[first:last])
        first = last


def test_a_record_keeps_its_samples_through_what_is_done_to_it():
    record = records('current')[0]
    own = record.samples['current']
    part = record.between(2.0, 3.0)
    near = part.samples['current']
    assert near.time[0] <= part.time[0] < near.time[1]
    assert near.time[-2] < part.time[-1] <= near.time[-1]
    assert part.select(['voltage', 'current']).samples.keys() == {'current'}
    assert not part.select(['voltage']).samples
    assert not record.with_signal('current', record['current'], 'A').samples
    finer = record.uniform(0.7 * DT)
    assert finer['current'] == pytest.approx(np.interp(finer.time, own.time, own.values))
    bare = Record(record.time, record.signals, record.units)
    assert bare.digest() != record.digest()


@pytest.mark.parametrize(
    'slow',
    [
        ('speed', 'position'),
        pytest.param(('current',), marks=pytest.mark.slow),
        pytest.param(('current', 'speed', 'position'), marks=pytest.mark.slow),
    ],
)
def test_slow_signals_are_no_missing_physics(slow):
    """As a bag has them: joint states at 95 Hz, a current at 160, a voltage at 1 kHz."""
    tau_c = 4e-3
    *train, valid = records(*slow, coulomb_friction={'tau_c': tau_c})
    assert 'times of its own' in ' '.join(seen_by_fits(train))
    found = diagnose(train, [valid])
    assert found.verdict is Verdict.EFFECT_MISSING
    assert found.model.effects == ('coulomb_friction',)
    assert found.model['coulomb_friction.tau_c'] == pytest.approx(tau_c, rel=0.02)
