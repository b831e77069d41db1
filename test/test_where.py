"""Where a model fails: noise is not read as structure, and structure is seen where it is."""

from bench_motor import a_motor, CURRENT_OFFSET, records
import numpy as np
import pytest

from motor_sysid.diagnosis.result.curves import Curve, Where
from motor_sysid.diagnosis.where.axes import axes_of
from motor_sysid.diagnosis.where.bands import bin_means
from motor_sysid.diagnosis.where.compare import compare
from motor_sysid.diagnosis.where.unexplained import lack_of, orthogonal, share_of
from motor_sysid.diagnosis.where.where import Failure, failure_of
from motor_sysid.estimation.batch import make_chain
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.signals.record import Record

OUTPUTS = ('current', 'speed')
SEEDS = range(10)


def knows_all(effects: dict[str, dict[str, float]]) -> Model:
    """Return the true motor with its sensors, every parameter as it is."""
    model = a_motor(effects).with_values({'current_offset': CURRENT_OFFSET})
    return Model(
        model.motor, model.effects, model.parameters, SpeedSensor.DIFFERENCE, model.linear
    )


def failure(model: Model, data: list[Record]) -> Failure:
    chains = [make_chain(r, model.kind, OUTPUTS) for r in data]
    runs = compare(model, chains, OUTPUTS, substeps=4).predictions
    return failure_of(model, data, ('train', 'train', 'validate'), runs)


@pytest.fixture(scope='module')
def of_complete_models() -> list[Failure]:
    return [failure(knows_all({}), records({}, seed=seed)) for seed in SEEDS]


def curves_of(found: list[Failure]) -> list[Curve]:
    return [curve for one in found for curve in one.curves]


def test_curves_of_complete_models_leave_their_band_as_often_as_they_should(of_complete_models):
    """A 95 % band is left in 5 % of the bins; 100 curves and 3000 bins, correlated within each."""
    curves = curves_of(of_complete_models)
    outside = np.concatenate([np.abs(c.mean) > c.band for c in curves])
    assert outside.size > 2000
    assert 0.025 < np.mean(outside) < 0.08


def test_few_curves_of_complete_models_are_called_structure(of_complete_models):
    chances = np.array([c.chance for c in curves_of(of_complete_models)])
    assert np.all((chances >= 0) & (chances <= 1))
    assert np.mean(chances < 0.05) < 0.15
    assert np.mean(chances < 0.001) < 0.02
    assert np.std(chances) > 0.15


def test_maps_of_complete_models_are_mostly_within_noise(of_complete_models):
    forces = [m for one in of_complete_models for m in one.maps if 'unexplained' in m.quantity]
    outside = np.concatenate([(np.abs(m.value) > m.band)[np.isfinite(m.band)] for m in forces])
    assert outside.size > 500
    assert np.mean(outside) < 0.09


@pytest.mark.parametrize('correlation', [0.0, 0.5, 0.9, 0.98])
def test_bands_hold_for_noise_that_is_correlated_in_time(correlation):
    """Trap: taken for independent, correlated samples make every curve look like structure."""
    rng = np.random.default_rng(3)
    outside, count, naive = 0, 0, 0
    for _ in range(25):
        noise = rng.normal(size=20_000)
        for k in range(1, noise.size):
            noise[k] += correlation * noise[k - 1]
        motion = np.cumsum(rng.normal(size=20_000) * 0.05)
        place = np.clip(np.floor(12 + 3 * np.sin(motion) * 4).astype(np.intp), 0, 23)
        binned = bin_means([place], [noise], 24)
        known = np.isfinite(binned.band)
        outside += int(np.sum(np.abs(binned.mean[known]) > binned.band[known]))
        spread = 1.96 * np.std(noise) / np.sqrt(binned.count[known])
        naive += int(np.sum(np.abs(binned.mean[known]) > spread))
        count += int(np.sum(known))
    assert 0.03 < outside / count < 0.09
    if correlation >= 0.9:
        assert naive / count > 0.3


def test_bins_with_too_little_have_no_band():
    place = np.zeros(1000, dtype=np.intp)
    place[:5] = 1
    binned = bin_means([place], [np.random.default_rng(0).normal(size=1000)], 3)
    assert np.isfinite(binned.band[0])
    assert np.isnan(binned.mean[1:]).all()
    assert np.isnan(binned.band[1:]).all()


def test_a_constant_is_far_from_zero_but_not_from_itself():
    values = 2.0 + 0.1 * np.random.default_rng(1).normal(size=5000)
    place = np.arange(5000) * 10 // 5000
    binned = bin_means([place], [values], 10)
    assert binned.chance() < 1e-6
    assert binned.chance(2.0) > 0.01
    assert binned.mean == pytest.approx(np.full(10, 2.0), abs=0.05)


@pytest.fixture(scope='module')
def without_friction() -> Failure:
    """Return where the true motor fails that lacks nothing but its Coulomb friction."""
    return failure(knows_all({}), records({'coulomb_friction': {'tau_c': 6e-3}}))


def by(found: Failure, axis: str, quantity: str = 'unexplained torque') -> Curve:
    return next(c for c in found.curves if (c.axis, c.quantity) == (axis, quantity))


def test_a_missing_torque_shows_in_the_torque_balance_against_its_axis(without_friction):
    speed = by(without_friction, 'speed')
    assert speed.chance < 1e-6
    assert np.mean(np.abs(speed.mean) > speed.band) > 0.5
    jump = speed.mean[speed.x < -5][-1] - speed.mean[speed.x > 5][0]
    assert 8e-3 < jump < 13e-3  # twice 6e-3, less what b and J can take over and the crossings
    voltage = by(without_friction, 'speed', 'unexplained voltage')
    assert np.abs(voltage.mean).max() < 0.02
    assert voltage.chance > 0.001


def test_orthogonal_to_the_base_parameters(without_friction):
    """Trap: what viscous friction can take over must not count as unexplained."""
    q, lacks = without_friction.share.basis, without_friction.lacks
    names, weights = without_friction.share.names, without_friction.share.weights
    joined = np.concatenate([weights[n] * one.forces[n] for n in names for one in lacks])
    assert np.abs(q.T @ joined).max() < 1e-6 * np.linalg.norm(joined)
    assert q.shape[1] == 6  # R, L, k_t, J, b and the offset of the current sensor


def test_the_lacking_torque_is_the_one_that_was_taken_away():
    """Sample by sample, without noise: the true model's prediction stands for the measurement."""
    true, lean = knows_all({'coulomb_friction': {'tau_c': 6e-3}}), knows_all({})
    (record,) = records({'coulomb_friction': {'tau_c': 6e-3}}, ['sines'], seconds=4.0)
    runs = [
        compare(m, [make_chain(record, m.kind, OUTPUTS)], OUTPUTS, substeps=4).predictions[0]
        for m in (lean, true)
    ]
    lack = lack_of(lean, record, *runs)
    moving = np.abs(runs[1]['speed']) > 20
    moving[:500] = moving[-50:] = False
    expected = -6e-3 * np.sign(runs[1]['speed'][moving])
    error = lack.forces['torque'][moving] - expected
    assert np.sqrt(np.mean(error**2)) < 0.05 * 6e-3


def test_errors_by_channel_have_a_band_and_an_overall_level(without_friction):
    for where in without_friction.where:
        assert isinstance(where, Where)
        assert set(where.channels) == set(OUTPUTS)
        for name, one in where.channels.items():
            known = np.isfinite(one.rms) & np.isfinite(one.low)
            assert np.all(one.low[known] <= one.rms[known])
            assert np.all(one.rms[known] <= one.high[known])
            assert one.unit == {'current': 'A', 'speed': 'rad/s'}[name]
    speed = next(w for w in without_friction.where if w.axis == 'speed').channels['speed']
    assert speed.overall == pytest.approx(np.sqrt(np.nanmean(speed.rms**2)), rel=0.5)
    assert np.nanmax(speed.rms) > 1.3 * np.nanmin(speed.rms)


def test_white_errors_are_even_everywhere():
    rng = np.random.default_rng(5)
    data = records({}, seed=4)
    model = knows_all({})
    runs = [{n: r[n] for n in OUTPUTS} for r in data]
    for name in OUTPUTS:
        data = [
            r.with_signal(name, r[name] + 0.5 * rng.normal(size=len(r)), r.units[name])
            for r in data
        ]
    found = failure_of(model, data, ('train', 'train', 'validate'), runs)
    inside = []
    for where in found.where:
        for one in where.channels.values():
            assert one.overall == pytest.approx(0.5, rel=0.03)
            known = np.isfinite(one.low)
            inside.append(((one.low <= one.overall) & (one.overall <= one.high))[known])
    assert np.mean(np.concatenate(inside)) > 0.9


def test_axes_cover_what_the_record_has(without_friction):
    assert set(without_friction.axes) == {'speed', 'direction', 'position', 'current', 'time'}
    (record,) = records({}, ['steps'], seconds=2.0)
    warm = record.with_signal('temperature', 20 + record.time, 'degC')
    model = knows_all({})
    states = lack_of(model, warm, {n: warm[n] for n in OUTPUTS}).states
    heat = axes_of(model, [warm], [states])['temperature']
    assert (heat.unit, heat.edges[0]) == ('degC', pytest.approx(20))


def test_a_model_with_heating_has_its_stored_energy_for_a_temperature():
    model = a_motor({'armature_heating': {'h': 3e-2, 't_th': 5.0}})
    (record,) = records({'armature_heating': {'h': 3e-2, 't_th': 5.0}}, ['steps'], seconds=2.0)
    lack = lack_of(model, record, {n: record[n] for n in OUTPUTS})
    heat = axes_of(model, [record], [lack.states])['temperature']
    assert heat.unit == 'J'
    loss = np.sum(2.1 * lack.states['i'] ** 2) * record.dt
    assert 0.7 * loss < heat.values[0][-1] < loss


def test_without_equations_that_can_be_closed_nothing_is_said():
    """A model whose current is not measured lacks torque in volts, and has no current axis."""
    record = records({}, ['steps'], seconds=2.0)[0].select(['voltage', 'speed'])
    model = Model.base('brushed_dc_reduced', {'k_v': 0.046, 'k_a': 1.2e-3})
    lacks = [lack_of(model, record, {'speed': record['speed']})]
    assert set(orthogonal(lacks, share_of(lacks))[0].forces) == {'torque'}
    axes = axes_of(model, [record], [lacks[0].states])
    assert 'input' in axes
    assert 'current' not in axes


def test_what_drives_an_axis_has_its_own_unit():
    time = 1e-3 * np.arange(500)
    record = Record(time, {'force': np.sin(time), 'speed': time}, {'force': 'N', 'speed': 'm/s'})
    model = Model.base('mechanical_axis', linear=True)
    axes = axes_of(model, [record], [{'omega': record['speed'], 'u': record['force']}])
    assert axes['input'].unit == 'N'
