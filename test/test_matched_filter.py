"""The matched filter: what a wave leaves in the residual comes back as order and frequency."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from motor_sysid.benchmark.cases import draw
from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.scenarios import named_case
from motor_sysid.benchmark.sensors import measure, Sensors
from motor_sysid.benchmark.truth import Control, run
from motor_sysid.diagnosis.candidates.matched_filter import Matched, STANDS_OUT, TOP_ORDER
from motor_sysid.diagnosis.candidates.proposals import ORDERS
from motor_sysid.diagnosis.candidates.turns import add_energy, add_waves, by_length, FADED
from motor_sysid.diagnosis.fitting import bench_of
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.estimation.batch import make_chain, observed_outputs, Problem
from motor_sysid.physics.effects import effect
from motor_sysid.physics.laws import step_share
from motor_sysid.physics.model import Model, SpeedSensor

DT = 1e-3
PLANT = Plant(R=2.1, L=2.4e-3, k=0.046, J=2.6e-5, b=1.3e-5)
BASE = {'R': 2.1, 'L': 2.4e-3, 'k_t': 0.046, 'J': 2.6e-5, 'b': 1.3e-5, 'omega_eps': 0.4}
SENSORS = Sensors(
    counts=4096, tacho_noise=0.2, current_noise=0.012, current_step=20 / 4096, current_offset=0.0
)


def matched(
    turning: float = 1.0, random: float = 0.0, counts: float = 4096, **hidden: float
) -> Matched:
    """Return the filter of the bare motor on 8 s in closed loop of one with something hidden.

    `random` is the size of a load in N m that wanders in 50 ms.
    """
    rng = np.random.default_rng(11)
    reference = turning * np.repeat(rng.uniform(-120, 120, 20), 400)
    control = Control(reference, kp=0.05, ki=0.6, limit=12.0, counts=4096)
    push = lfilter([0.2], [1.0, -0.98], random * rng.standard_normal(reference.size))
    sensors = replace(SENSORS, counts=counts)
    record = measure(run(PLANT._replace(**hidden), control, DT, push), sensors, DT, rng)
    model = Model.base('brushed_dc', BASE, speed_sensor=SpeedSensor.DIFFERENCE)
    outputs = observed_outputs(model.kind, [record])
    problem = Problem(model, [make_chain(record, model.kind, outputs)], outputs)
    return Matched(problem, problem.linearize(problem.vector()))


@pytest.mark.parametrize('order', [3, 23, 47])
def test_the_order_of_a_wave_stands_out(order):
    """It is half a percent of the largest torque."""
    found = matched(turning=0.4, cogging=1e-3, order=float(order))
    assert found.orders(contrast=STANDS_OUT)[0] == order
    gains = found.order_gains()
    assert gains.shape == (TOP_ORDER + 1,)
    assert np.argmax(gains) == order
    assert gains[order] > 100


def test_waves_that_counts_do_not_show_are_not_proposed():
    """At angles that are multiples of a 48th of a turn 48 waves are none, and 47 are one."""
    found = matched(counts=48, cogging=4e-3, order=11)
    gains = found.order_gains(effect('cogging_torque'))
    assert np.argmax(gains) == 11
    assert not np.any(gains[25:])
    assert not np.any(found.order_gains(by='i')[25:])


def test_a_model_that_ran_away_shows_no_orders():
    found = matched(turning=0.4, cogging=1e-3, order=23.0)
    for stretch in found._stretches:
        stretch.path['omega'][5:] = np.nan
        stretch.path['turn'][5:] = np.nan
    assert not np.any(found.order_gains())


def test_once_per_turn_stands_out_where_no_effect_of_the_catalogue_is_asked():
    """An eccentric wheel or a weight, which the catalogue need not hold."""
    found = matched(turning=0.4, gravity=1e-3)
    assert found.orders(contrast=STANDS_OUT)[0] == 1
    assert found.orders(effect('cogging_torque'))[0] != 1
    assert 1 not in matched(turning=0.4, cogging=1e-3, order=23.0).orders(contrast=STANDS_OUT)


def test_contrast_leaves_out_what_is_no_larger_than_its_neighbours():
    """A wave of order 23 raises what is beside it, too; chance alone makes no such contrast."""
    found = matched(turning=0.4, cogging=1e-3, order=23.0)
    best, apart = found.orders(), found.orders(contrast=20.0)
    assert best[0] == 23
    assert len(best) == 5
    assert apart == (23,)
    assert matched(turning=0.4).orders(contrast=20.0) == ()


def test_a_wave_that_passes_within_samples_stands_out_though_others_explain_more():
    """45 waves a turn, up to 23 rad a sample: slow moments alone tell of 400, and tell much."""
    scenario, number = named_case('single/torque_ripple/10/7')
    case = draw(scenario, 9500, number)
    bench, model = bench_of(case.train, case.valid, None, 'brushed_dc', {}, 0.2)
    rung = climb(model, bench)
    found, ripple = Matched(bench.problem(rung.model), rung.near), effect('torque_ripple')
    assert case.setting.plant.ripple_order == 45
    assert 45 not in found.orders(ripple, ORDERS)
    assert found.clearest(ripple) == (45,)


def test_nothing_is_clearest_in_noise():
    assert matched(turning=0.4).clearest(effect('cogging_torque')) == ()


def test_an_effect_is_matched_with_its_carrier():
    """Torque ripple goes with the current, of either sign."""
    found = matched(ripple=0.05, ripple_order=12.0)
    assert found.orders(effect('torque_ripple'))[0] == 12
    with_it = found.order_gains(effect('torque_ripple'))[12]
    assert with_it > 3 * found.order_gains(effect('cogging_torque'))[12]


@pytest.mark.parametrize('order', [12, 36])
def test_waves_that_go_with_the_current_stand_out_without_an_effect_of_the_catalogue(order):
    found = matched(ripple=0.05, ripple_order=float(order))
    assert found.led_orders()[0] == order
    assert matched(cogging=1e-3, order=23.0).led_orders() == ()


@pytest.mark.parametrize('random', [0.0, 1e-3, 3e-3])
def test_nothing_else_goes_with_the_current_in_waves(random):
    """White noise makes the best of 400 orders explain 20 in one motor of 50, 50 in one of 1e8."""
    assert matched(random=random).led_orders() == ()


def test_waves_go_with_nothing_that_laws_do_not_see():
    assert matched(ripple=0.05, ripple_order=12.0).led_orders('pressure') == ()


def test_less_than_a_turn_tells_no_order():
    found = matched(turning=0.004, cogging=4e-4, order=23.0)
    assert found.orders() == ()


@pytest.mark.parametrize('frequency', [0.83, 6.1, 23.0])
def test_the_best_frequency_is_that_of_the_load(frequency):
    found = matched(swing=1e-3, frequency=frequency).frequencies('torque')
    assert found[0] == pytest.approx(frequency, abs=0.02)
    assert np.all(np.diff(np.sort(found)) > 1 / 8)


def test_a_load_that_wanders_is_no_line():
    """None of 40 such loads made one when the limit was chosen."""
    assert matched(random=1e-3).frequencies('torque') == ()


@pytest.mark.parametrize('most', [3e-3, 0.03, 0.4])
def test_sums_over_a_turn_are_those_of_every_sample(most):
    """Correlations to rounding, energies to a per cent, slow and fast, with a rest of a block."""
    rng = np.random.default_rng(5)
    turn = most * np.sin(np.linspace(0.0, 9.0, 1501)) * rng.uniform(0.5, 1.0, 1501)
    theta, step, orders = np.cumsum(turn), np.abs(turn), np.arange(TOP_ORDER + 1)
    pull, carrier = rng.standard_normal((2, turn.size))
    power = 1.0 / (1.0 + (np.arange(1025) / 40.0) ** 2)
    covered = np.outer(step, orders)
    share = np.where(covered <= FADED, step_share(covered), 0.0)
    total, energy = np.zeros(TOP_ORDER + 1, complex), np.zeros(TOP_ORDER + 1)

    add_waves(theta, step, pull, total)
    add_energy(*by_length(step, carrier**2), power, energy)

    there = np.interp(covered * 1024 / np.pi, np.arange(1025), power)
    right = np.sum(0.5 * share**2 * carrier[:, np.newaxis] ** 2 * there, axis=0)
    wave = np.sum(share * pull[:, np.newaxis] * np.exp(1j * np.outer(theta, orders)), axis=0)
    assert np.abs(total - wave)[1:] == pytest.approx(0.0, abs=1e-8)
    assert energy[1:] == pytest.approx(right[1:], rel=0.01)
