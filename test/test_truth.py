"""The simulator that the benchmark trusts: against theory, and against the package's own."""

import numpy as np
import pytest

from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.truth import Control, run
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

DT = 1e-3
MOTOR = Plant(R=2.0, L=0.4e-3, k=0.03, J=5e-6, b=1e-6)
BASE = {'R': 2.0, 'L': 0.4e-3, 'k_t': 0.03, 'J': 5e-6, 'b': 1e-6}
STEPS = np.repeat([0.0, 6.0, -4.0, 1.0, 8.0, 0.0], 400)
SMOOTH = {
    'quadratic_drag': ({'drag': 4e-8}, {'k_d': 4e-8}),
    'constant_load_torque': ({'tau_l': 2e-3}, {'tau_l': 2e-3}),
    'gravity_load': ({'gravity': 3e-3}, {'tau_sin': 3e-3}),
    'cogging_torque': (
        {'cogging': 2e-3, 'cogging_angle': np.pi / 2, 'second': 1e-3, 'order': 7.0},
        {'a_1': 2e-3, 'b_2': 1e-3, 'n': 7.0},
    ),
    'input_delay': ({'delay': 2.37e-3}, {'delay': 2.37e-3}),
    'armature_heating': ({'heat': 0.01, 't_th': 3.0}, {'h': 0.01, 't_th': 3.0}),
}


def resimulated(model: Model, voltage: np.ndarray) -> dict[str, np.ndarray]:
    time = DT * np.arange(voltage.size)
    record = Record(time, {'voltage': voltage}, {'voltage': 'V'})
    return dict(simulate(model, record, substeps=50).outputs)


@pytest.mark.parametrize('key', [None, *SMOOTH])
def test_smooth_motors_agree_with_the_package_at_fine_steps(key):
    model, plant = Model.base('brushed_dc', BASE), MOTOR
    if key:
        numbers, values = SMOOTH[key]
        model, plant = model.with_effect(key, values), MOTOR._replace(**numbers)
    truth = run(plant, Control(STEPS), DT)
    for name, other in resimulated(model, STEPS).items():
        ours = getattr(truth, name)
        assert np.max(np.abs(ours - other)) < 2e-4 * np.max(np.abs(ours)), name


def test_energy_that_goes_in_is_stored():
    lossless = MOTOR._replace(R=1e-6, b=0.0, L=5e-3, gravity=1e-3)
    truth = run(lossless, Control(np.repeat([2.0, 0.0], 300)), DT, substeps=400)
    stored = (
        0.5 * lossless.L * truth.current**2
        + 0.5 * lossless.J * truth.speed**2
        + lossless.gravity * (1 - np.cos(truth.position))
    )
    assert np.max(stored[301:]) > 0
    assert np.ptp(stored[301:]) < 1e-5 * np.max(stored)


def test_play_and_twist_store_energy_but_make_none():
    loose = MOTOR._replace(
        R=1e6, L=1e4, k=1e-9, b=0.0, share=0.4, stiffness=2.0, damping=1e-4, gap=0.02
    )
    start = np.array([0.0, 10.0, 0.0, -2.0, 0.0, 0.0])
    truth = run(loose, Control(np.zeros(2000)), DT, start=start)
    together = 10.0 * 0.6 - 2.0 * 0.4
    assert np.max(np.abs(truth.speed)) <= 10.0 * (1 + 1e-6)
    assert np.mean(truth.speed[-500:]) == pytest.approx(together, rel=0.02)


def test_stiction_holds_below_break_away_and_lets_go_above():
    sticky = MOTOR._replace(tau_plus=6e-3, tau_minus=6e-3, tau_s=3e-3, omega_s=2.0)
    holding = 0.98 * 9e-3 * MOTOR.R / MOTOR.k
    still = run(sticky, Control(np.full(500, holding)), DT)
    assert np.all(still.speed == 0.0)
    moving = run(sticky, Control(np.full(500, holding * 1.05)), DT)
    expected = (holding * 1.05 * MOTOR.k / MOTOR.R - 6e-3) / (MOTOR.b + MOTOR.k**2 / MOTOR.R)
    assert moving.speed[-1] == pytest.approx(expected, rel=1e-3)


def test_coasting_against_dry_friction_ends_on_time():
    loose = MOTOR._replace(R=1e6, L=1e4, k=1e-9, b=0.0, tau_plus=1e-3, tau_minus=1e-3)
    start = np.array([0.0, 100.0, 0.0, 0.0, 0.0, 0.0])
    truth = run(loose, Control(np.zeros(1000)), DT, start=start, substeps=50)
    stop = 100.0 * MOTOR.J / 1e-3
    assert truth.speed[int(stop / DT) + 1] == 0.0
    assert truth.position[-1] == pytest.approx(0.5 * 100.0 * stop, rel=1e-5)


def test_asymmetric_friction_brakes_each_direction_by_its_own():
    uneven = MOTOR._replace(tau_plus=1e-3, tau_minus=4e-3, b=0.0)
    slope = MOTOR.k**2 / MOTOR.R
    for voltage, tau in ((3.0, -1e-3), (-3.0, 4e-3)):
        truth = run(uneven, Control(np.full(1000, voltage)), DT)
        expected = (voltage * MOTOR.k / MOTOR.R + tau) / slope
        assert truth.speed[-1] == pytest.approx(expected, rel=1e-5)


def test_brushes_block_a_small_voltage_and_take_their_drop_from_a_large_one():
    brushes = MOTOR._replace(v_b=0.5)
    assert np.all(run(brushes, Control(np.full(200, 0.49)), DT).current == 0.0)
    truth = run(brushes, Control(np.full(1500, 6.0)), DT)
    current = truth.current[-1]
    lost = 6.0 - 0.5 - MOTOR.R * current - MOTOR.k * truth.speed[-1]
    assert lost == pytest.approx(0.0, abs=1e-6)


def test_two_masses_swing_at_their_resonance():
    share, pulsation = 0.3, 2 * np.pi * 30
    small = MOTOR.J * share * (1 - share)
    free = MOTOR._replace(
        R=1e6, L=1e4, k=1e-9, b=0.0, share=share, stiffness=small * pulsation**2, damping=1e-12
    )
    start = np.array([0.0, 1.0, 0.0, -(1 - share) / share, 0.0, 0.0])
    truth = run(free, Control(np.zeros(1000)), DT, start=start, substeps=50)
    time = DT * np.arange(1000)
    assert np.max(np.abs(truth.speed - np.cos(pulsation * time))) < 1e-3


def test_load_step_and_inertia_change_come_when_they_should():
    loaded = run(MOTOR._replace(step_torque=2e-3, step_time=1.0), Control(np.full(2000, 5.0)), DT)
    drop = 2e-3 / (MOTOR.b + MOTOR.k**2 / MOTOR.R)
    assert loaded.speed[999] - loaded.speed[-1] == pytest.approx(drop, rel=1e-3)
    voltage = np.repeat([5.0, -5.0], 500)
    heavy = run(MOTOR._replace(inertia_gain=1.0, inertia_time=0.5), Control(voltage), DT)
    light = run(MOTOR, Control(voltage), DT)
    assert np.array_equal(heavy.speed[:501], light.speed[:501])
    assert heavy.speed[505] > light.speed[505]
