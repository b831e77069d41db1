"""Laws of the catalogue against the benchmark's simulator, which has laws of its own."""

import numpy as np
import pytest

from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.truth import Control, run
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

DT = 1e-3
MOTOR = Plant(R=2.0, L=0.4e-3, k=0.03, J=5e-6, b=1e-6)
BASE = {'R': 2.0, 'L': 0.4e-3, 'k_t': 0.03, 'J': 5e-6, 'b': 1e-6, 'omega_eps': 1e-3}
STEPS = np.repeat([0.0, 6.0, -4.0, 1.0, 8.0, 0.0], 400)
CASES = {
    'periodic_load': (
        {'swing': 3e-3, 'frequency': 3.3, 'swing_angle': np.pi / 2}, {'a': 3e-3, 'f': 3.3}, 2e-4,
    ),
    'torque_ripple': (
        {'ripple': 0.1, 'ripple_order': 5.0, 'ripple_angle': np.pi / 2}, {'a': 0.1, 'n': 5.0},
        2e-4,
    ),
    'friction_drift': ({'drift_viscous': 2e-6}, {'d_v': 2e-6}, 2e-4),
    'drive_coast': (
        {'coast': 0.8, 'coast_voltage': 5.0}, {'a': 0.8, 'u_c': 5.0}, 2e-4,
    ),
    'iron_loss': ({'iron': 1e-4}, {'k_x': 1e-4}, 2e-3),
    'load_torque_step': (
        {'step_torque': 2e-3, 'step_time': 1.1}, {'tau_l': 2e-3, 't_on': 1.1, 'rise': 1e-5}, 1e-3,
    ),
    'inertia_change': (
        {'inertia_gain': 0.7, 'inertia_time': 1.1}, {'g': 0.7, 't_on': 1.1, 'rise': 1e-5}, 1e-3,
    ),
    'load_dependent_friction': ({'gear_loss': 0.2}, {'mu': 0.2}, 2e-3),
    'supply_sag': ({'sag': 0.02}, {'a': 0.02}, 2e-4),
    'driver_clipping': ({'top_voltage': 5.0}, {'c': 0.2}, 2e-4),
    'lugre_friction': (
        {'bristle': 2e-3, 'bend': 0.05, 'stiction': 1e-9},
        {'tau_c': 2e-3, 'z_s': 0.05, 's': 1e-9, 't_b': 2 * np.sqrt(5e-6 * 0.05 / 2e-3)}, 5e-3,
    ),
}  # fmt: skip
"""Numbers of the true motor, parameters of the effect, and how far the two may be apart."""


def resimulated(model: Model) -> dict[str, np.ndarray]:
    time = DT * np.arange(STEPS.size)
    record = Record(time, {'voltage': STEPS}, {'voltage': 'V'})
    return dict(simulate(model, record, substeps=50).outputs)


@pytest.mark.parametrize('key', CASES)
def test_laws_agree_with_an_independent_simulator(key):
    numbers, values, limit = CASES[key]
    truth = run(MOTOR._replace(**numbers), Control(STEPS), DT)
    plain = run(MOTOR, Control(STEPS), DT)
    found = resimulated(Model.base('brushed_dc', BASE).with_effect(key, values))
    for name in ('current', 'speed'):
        ours = getattr(truth, name)
        apart = np.max(np.abs(ours - found[name]))
        assert apart < limit * np.max(np.abs(ours)), name
        assert np.max(np.abs(ours - getattr(plain, name))) > 5 * apart, name


def test_the_filter_of_the_current_sensor_agrees():
    truth = run(MOTOR._replace(current_lag=3e-3), Control(STEPS), DT)
    found = resimulated(
        Model.base('brushed_dc', BASE).with_effect('current_sensor_lag', {'lag': 3e-3})
    )
    size = np.max(np.abs(truth.current))
    assert np.max(np.abs(truth.shown_current - found['current'])) < 1e-4 * size
    assert np.max(np.abs(truth.shown_current - truth.current)) > 0.1 * size


def test_both_masses_behind_play_move_alike():
    """Contact laws differ; what the play does to the motion before and after does not."""
    contact, share, gap = 2 * np.pi * 60, 0.5, 0.05
    plant = MOTOR._replace(
        share=share, gap=gap, stiffness=0.25 * MOTOR.J * contact**2,
        damping=0.5 * 0.25 * MOTOR.J * contact,
    )  # fmt: skip
    truth = run(plant, Control(STEPS), DT)
    antiresonance = contact * np.sqrt(0.5)
    model = Model.base('brushed_dc', {**BASE, 'J': 0.5 * MOTOR.J}).with_effect(
        'backlash', {'r': 1.0, 'phi_g': gap, 'w_a': antiresonance, 'z': 0.18}
    )
    found = resimulated(model)
    stiff = run(MOTOR, Control(STEPS), DT)
    apart = np.std(truth.speed - found['speed'])
    assert apart < 0.25 * np.std(truth.speed - stiff.speed)


def test_saturated_inductance_is_the_small_one():
    """Rise of the current from zero and from far above saturation, rotor held."""
    held = {**BASE, 'J': 1e3, 'L': 4e-3}
    model = Model.base('brushed_dc', held).with_effect(
        'inductance_saturation', {'s': 1.0, 'i_s': 0.2}
    )
    step = np.repeat([0.0, 0.02, 8.0, 8.2], 500)
    record = Record(1e-4 * np.arange(step.size), {'voltage': step}, {'voltage': 'V'})
    current = simulate(model, record, substeps=20).outputs['current']
    for start, inductance in ((500, 8e-3), (1500, 4e-3)):
        rise = current[start:] - current[start]
        final = current[start + 499] - current[start]
        reached = np.argmax(rise > (1 - np.exp(-1)) * final) * 1e-4
        assert reached == pytest.approx(inductance / 2.0, rel=0.06)
