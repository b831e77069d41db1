"""Standard errors where the derivatives at the fit tell too little, and angles within a count."""

from dataclasses import replace
from types import SimpleNamespace

from bench_motor import a_motor, DT, measure, MOTOR, voltage_profile
import numpy as np
import pytest

from motor_sysid.diagnosis.search.bench import make_bench
from motor_sysid.diagnosis.search.delay_profile import with_profiled_delays
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.diagnosis.search.standard_errors import NEAR, roughness, within_told
from motor_sysid.estimation.batch import Linearization, white
from motor_sysid.estimation.batch.uncertainty import describe
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.physics.rollout import Program
from motor_sysid.physics.scales import scales_of
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

QUICK = {**MOTOR, 'L': 1e-4}  # its current settles in 50 us, a twentieth of a sample

# --- delays


def delayed(late: float, seed: int):
    """Return the bench and the fit of a motor whose voltage comes that late."""
    rng = np.random.default_rng(seed)
    model = Model.base('brushed_dc', QUICK).with_effect('input_delay', {'delay': late})
    data = [measure(model, voltage_profile('steps', 3.0, rng), rng) for _ in range(2)]
    bench = make_bench(data, [], motor('brushed_dc'))
    begun = Model.base('brushed_dc', {**QUICK, 'L': 3e-4}, speed_sensor=SpeedSensor.DIFFERENCE)
    return bench, climb(begun.with_effect('input_delay', {'delay': 1e-3}), bench)


@pytest.mark.parametrize('seed', range(4))
def test_a_delay_that_a_slow_current_can_mimic_is_known_no_better_than_that(seed):
    """Seeds are fixed; one of four would be off by three standard errors in 100 draws."""
    bench, rung = delayed(1.06e-3, seed)
    p = rung.model.parameters['input_delay.delay']
    assert p.sigma is not None
    told = with_profiled_delays(rung.model, bench, rung.result.weighting, rung.result.information)
    honest = told.parameters['input_delay.delay'].sigma
    assert honest is not None
    assert max(p.sigma, 0.02 * DT) <= honest < 0.3 * DT
    assert abs(p.value - 1.06e-3) < 3.0 * honest


def test_a_delay_that_is_not_fitted_keeps_its_error():
    bench, rung = delayed(1.06e-3, 0)
    held = rung.model.with_free(['input_delay.delay'], free=False)
    told = with_profiled_delays(held, bench, rung.result.weighting, rung.result.information)
    assert told.parameters['input_delay.delay'] == held.parameters['input_delay.delay']


# --- a rough cost


def rough_problem(depth: float):
    """Return a problem of two parameters whose cost is a parabola with pits of that depth."""

    def costs(z, weighting, near):
        pits = np.sin(1e7 * z[:, 0]) * np.sin(1e7 * z[:, 1])
        return np.sum(z**2, axis=1) + depth * pits

    return SimpleNamespace(
        vector=lambda: np.zeros(2), slope=lambda z: np.ones(2), costs=costs,
        box=lambda: (np.full(2, -np.inf), np.full(2, np.inf)),
        linearize=lambda z, parameters: [],
    )  # fmt: skip


def test_the_roughness_of_a_cost_is_the_depth_of_its_pits_and_none_of_a_smooth_one():
    assert roughness(rough_problem(0.0), white([np.ones((3, 1))]), np.eye(2)) < 4 * NEAR**2
    found = roughness(rough_problem(100.0), white([np.ones((3, 1))]), np.eye(2))
    assert 0.5 * 50 < found < 1.5 * 50


# --- blocks that tell all


def scattered(own: float, draws: int = 400):
    """Return estimates over their standard errors, where one block tells that share of it all."""
    rng, count = np.random.default_rng(4), 1200
    size = np.full(count, np.sqrt((1 - own) / (count - 10)))
    size[:10] = np.sqrt(own / 10)
    slope, found = size[:, np.newaxis, np.newaxis], []
    problem = SimpleNamespace(
        free=(SimpleNamespace(name='p', logarithmic=False),), precision=np.zeros((1, 1)),
        slope=lambda z: np.ones(1), box=lambda: (np.array([-np.inf]), np.array([np.inf])),
    )  # fmt: skip
    for _ in range(draws):
        error = rng.normal(size=(count, 1))
        off = float(size @ error[:, 0])
        near = [Linearization(error - off * slope[:, :, 0], slope, np.empty((count, 1, 0)),
                              np.ones(1))]  # fmt: skip
        spread = describe(
            problem, np.zeros(1), white([np.ones((3, 1))]), near, stationary=True
        )
        found.append(off / spread.sigma[0])
    return np.array(found)


@pytest.mark.parametrize('own', [0.01, 0.5])
def test_a_block_that_tells_much_does_not_make_an_estimate_look_known(own):
    """The seed is fixed; by chance one of 400 other seeds would fail at a coverage of 93.5 %.

    Without what leaving blocks out tells, 87 % of the second are covered.
    """
    assert np.mean(np.abs(scattered(own)) < 1.96) > 0.9


# --- what signals alone tell


def lagging(lower: float, upper: float) -> Model:
    """Return a motor with a filter of its speed, told to be that long, and a delay; s."""
    model = Model.base('brushed_dc', MOTOR)
    record = voltage_profile('steps', 1.0, np.random.default_rng(0))
    scales = scales_of('brushed_dc', MOTOR, [measure(model, record, np.random.default_rng(1))])
    scales = replace(scales, speed_filter=(lower, upper))
    model = model.with_effect('speed_sensor_lag', {'lag': 0.5 * (lower + upper)}, scales)
    return model.with_effect('input_delay', {'delay': 5e-3}, scales)


@pytest.mark.parametrize(('shown', 'lag', 'delay'), [(True, 1e-3, 1.1e-3), (False, 0.05, 0.05)])
def test_what_the_position_tells_of_a_filter_is_known_of_it_and_of_a_delay_beside_it(
    shown, lag, delay
):
    """The speed tells the sum of both to 0.5 ms, and neither to 50 ms."""
    model = lagging(9e-3, 9e-3 + np.sqrt(12.0) * 1e-3)
    free = [p.name for p in model.parameters.free]
    at, other = free.index('speed_sensor_lag.lag'), free.index('input_delay.delay')
    way = np.zeros(len(free))
    way[at], way[other] = 0.05, -0.05
    covariance = np.outer(way, way) + np.diag(np.full(len(free), 1e-12))
    covariance[other, other] += 0.5e-3**2
    sigma = np.sqrt(np.diag(covariance))
    told = within_told(model, SimpleNamespace(shows=lambda key: shown), sigma, covariance)
    assert told[at] == pytest.approx(lag, rel=1e-3)
    assert told[other] == pytest.approx(delay, rel=0.03)
    apart = [k for k in range(len(free)) if k not in (at, other)]
    assert np.allclose(told[apart], sigma[apart], rtol=1e-3)


def test_what_data_tell_better_than_the_position_stays():
    model = lagging(9e-3, 10e-3)
    sigma = np.full(len(model.parameters.free), 1e-5)
    bench = SimpleNamespace(shows=lambda key: key == 'speed_sensor_lag')
    assert np.all(within_told(model, bench, sigma, np.diag(sigma**2)) == sigma)


# --- angles within a count


COUNTS = 200
HIDDEN = {'cogging_torque': {'a_1': 4e-3, 'b_1': 2e-3, 'a_2': 1e-3, 'b_2': 2e-3, 'n': 12.0}}


@pytest.fixture(scope='module')
def resting() -> Record:
    """Return a motor with cogging that rests half of the time, and a coarse encoder."""
    volts = np.tile(np.repeat([0.0, 4.0, 0.0, -3.0], 500), 3)
    record = Record(DT * np.arange(volts.size), {'voltage': volts}, {'voltage': 'V'})
    run = simulate(a_motor(HIDDEN), record, follow_position=False, substeps=16)
    step = 2 * np.pi / COUNTS
    shown = step * np.floor(run.outputs['position'] / step) + 0.5 * step
    signals = {'voltage': volts, 'speed': run.outputs['speed'], 'position': shown}
    return Record(record.time, signals, {'voltage': 'V', 'speed': 'rad/s', 'position': 'rad'})


def test_a_drive_knows_the_counts_of_its_position(resting):
    drive = Drive.of(resting, motor('brushed_dc'))
    assert drive.count == pytest.approx(2 * np.pi / COUNTS)
    smooth = Record(
        resting.time, {**resting.signals, 'position': np.cumsum(resting['speed']) * DT},
        resting.units,
    )  # fmt: skip
    assert Drive.of(smooth, motor('brushed_dc')).count == 0.0


def test_a_rotor_rests_where_it_is_and_not_where_the_encoder_shows_it(resting):
    model = a_motor(HIDDEN)
    program = Program.of(model, ['speed'])
    drive = Drive.of(resting, motor('brushed_dc'))
    at_rest = np.abs(resting['speed']) < 0.5
    at_rest[:500] = False  # it starts anywhere within the count
    assert at_rest.sum() > 1000

    def error(one: Drive) -> float:
        values = {n: np.array([v]) for n, v in model.parameters.values().items()}
        run = program.run(values, one, np.zeros(3), substeps=8)[:, 0, 0]
        return float(np.sqrt(np.mean((run - resting['speed'])[at_rest] ** 2)))

    assert error(drive) < 0.2 * error(replace(drive, count=0.0))
