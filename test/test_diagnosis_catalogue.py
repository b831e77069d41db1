"""Each effect, hidden in a motor that the trusted simulator runs in closed loop, is named.

The rivals of each are those that explain most of it; docs/benchmark.md has the rates with every
candidate, over many motors and sizes.
"""

from dataclasses import replace

import numpy as np
import pytest

from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.sensors import measure, Sensors
from motor_sysid.benchmark.truth import Control, run
from motor_sysid.diagnosis import diagnose, Diagnosis, Verdict
from motor_sysid.physics.effects import add_effect_file, catalogue
from motor_sysid.signals.record import Record

DT = 1e-3
PLANT = Plant(R=2.1, L=2.4e-3, k=0.046, J=2.6e-5, b=1.3e-5)
SENSORS = Sensors(
    counts=4096, tacho_noise=0.2, current_noise=0.012, current_step=20 / 4096,
    current_offset=0.015,
)  # fmt: skip
TEETH = 0.25 * PLANT.J * (2 * np.pi * 60.0) ** 2
HIDDEN = {
    'lugre_friction': (
        {'bristle': 5e-3, 'bend': 0.02, 'stiction': 0.3, 'omega_s': 8.0},
        {'tau_c': (5e-3, 0.1), 'z_s': (0.02, 0.3)}, ('coulomb_friction', 'stribeck_friction'),
    ),
    'friction_drift': (
        {'drift_viscous': 8e-6}, {'d_v': (8e-6, 0.05)}, ('quadratic_drag', 'coulomb_friction'),
    ),
    'load_torque_step': (
        {'step_torque': 5e-3, 'step_time': 4.31}, {'tau_l': (5e-3, 0.02), 't_on': (4.31, 2e-3)},
        ('constant_load_torque', 'inertia_change'),
    ),
    'periodic_load': (
        {'swing': 3e-3, 'frequency': 3.7}, {'b': (3e-3, 0.02), 'f': (3.7, 1e-3)},
        ('flexible_shaft', 'cogging_torque'),
    ),
    'torque_ripple': (
        {'ripple': 0.08, 'ripple_order': 12.0, 'ripple_angle': np.pi / 2},
        {'a': (0.08, 0.05), 'n': (12.0, 0.0)}, ('cogging_torque', 'torque_constant_saturation'),
    ),
    'inertia_change': (
        {'inertia_gain': 0.5, 'inertia_time': 4.31}, {'g': (0.5, 0.03), 't_on': (4.31, 0.01)},
        ('armature_heating', 'load_torque_step'),
    ),
    'inverter_dead_time': (
        {'v_dead': 0.5, 'i_dead': 0.5}, {'v_d': (0.5, 0.1)},
        ('brush_voltage_drop', 'coulomb_friction'),
    ),
    'drive_coast': (
        {'coast': 1.0, 'coast_voltage': 6.0}, {'a': (1.0, 0.05), 'u_c': (6.0, 0.05)},
        ('load_dependent_friction', 'driver_clipping'),
    ),
    'inductance_saturation': (
        {'soft': 0.8, 'i_soft': 1.0}, {'i_s': (1.0, 0.3)}, ('input_delay', 'flexible_shaft'),
    ),
    'iron_loss': (
        {'iron': 3.5e-4}, {'k_x': (3.5e-4, 0.03)}, ('coulomb_friction', 'quadratic_drag'),
    ),
    'current_sensor_lag': (
        {'current_lag': 4e-3}, {'lag': (4e-3, 0.03)}, ('input_delay', 'speed_sensor_lag'),
    ),
    'backlash': (
        {'share': 0.5, 'gap': 0.03, 'stiffness': TEETH, 'damping': TEETH / 750},
        {'phi_g': (0.03, 0.3), 'r': (1.0, 0.2)}, ('flexible_shaft', 'coulomb_friction'),
    ),
}  # fmt: skip
"""Numbers of the true motor; parameters with their relative tolerance; rivals."""


def records(sensors: Sensors = SENSORS, seconds: float = 8.0, **hidden: float) -> list[Record]:
    """Return two records in closed loop, with reversals, levels and slow motion."""
    rng, found = np.random.default_rng(21), []
    time = DT * np.arange(round(seconds / DT))
    for _ in range(2):
        levels, edges = rng.uniform(-150, 150, 100), np.cumsum(rng.uniform(0.15, 0.6, 99))
        reference = levels[np.searchsorted(edges, time)]
        slow = 40 * np.sin(2 * np.pi * 0.4 * time)
        reference = np.where(time < 0.3, 0.0, np.where(time % 4 > 2.6, slow, reference))
        control = Control(reference, kp=0.05, ki=0.6, limit=12.0, resolution=0.012, counts=4096)
        truth = run(PLANT._replace(**hidden), control, DT)
        found.append(measure(truth, sensors, DT, rng, reference))
    return found


def diagnosed(key: str, rivals: tuple[str, ...], pair: list[Record]) -> Diagnosis:
    found = diagnose(pair[:1], pair[1:], effects=[key, *rivals])
    assert found.verdict is Verdict.EFFECT_MISSING
    assert found.effects[0] == key
    errors = [step.validation_error_percent for step in found.steps]
    assert errors[1] < 0.95 * errors[0]
    assert errors[-1] < 1.1 * found.noise_floor_percent
    return found


SLOW = {'backlash', 'lugre_friction', 'torque_ripple', 'periodic_load', 'inductance_saturation'}
KEYS = [pytest.param(k, marks=pytest.mark.slow) if k in SLOW else k for k in sorted(HIDDEN)]


@pytest.mark.parametrize('key', KEYS)
def test_it_is_named_and_its_parameters_are_found(key):
    numbers, parameters, rivals = HIDDEN[key]
    found = diagnosed(key, rivals, records(**numbers))
    for name, (value, tolerance) in parameters.items():
        assert found.model[f'{key}.{name}'] == pytest.approx(value, rel=tolerance), name


def test_the_filter_of_a_drives_speed_is_named():
    pair = records(replace(SENSORS, speed_filter=8e-3))
    found = diagnosed('speed_sensor_lag', ('input_delay', 'flexible_shaft'), pair)
    assert found.model['speed_sensor_lag.lag'] == pytest.approx(8e-3, rel=0.1)


def test_a_moment_is_found_on_one_record_whose_end_is_held_back():
    one = records(step_torque=5e-3, step_time=4.31)[:1]
    found = diagnose(one, effects=['load_torque_step', 'constant_load_torque', 'friction_drift'])
    assert found.effects == ('load_torque_step',)
    assert found.model['load_torque_step.t_on'] == pytest.approx(4.31, abs=5e-3)


def test_a_load_that_goes_is_told_beside_the_one_that_was_there_from_the_start():
    pair = records(tau_l=6e-3, step_torque=-6e-3, step_time=4.31)
    effects = ['constant_load_torque', 'load_torque_step', 'friction_drift', 'periodic_load']
    found = diagnose(pair[:1], pair[1:], motor='brushed_dc', effects=effects)
    assert set(found.effects) == {'constant_load_torque', 'load_torque_step'}
    for name, value in (('constant_load_torque.tau_l', 6e-3), ('load_torque_step.tau_l', -6e-3)):
        assert found.model[name] == pytest.approx(value, rel=0.03), name
    assert found.model['load_torque_step.t_on'] == pytest.approx(4.31, abs=5e-3)


def test_the_offset_of_a_current_sensor_is_a_parameter_not_a_finding():
    pair = records(replace(SENSORS, current_offset=0.3))
    found = diagnose(
        pair[:1], pair[1:], effects=['current_sensor_offset', 'constant_load_torque']
    )
    assert found.verdict is Verdict.COMPLETE
    assert found.model['current_offset'] == pytest.approx(0.3, abs=5e-3)
    assert not any(c.effect == 'current_sensor_offset' for c in found.steps[0].candidates)


@pytest.mark.parametrize('key', ['speed_sensor_scale', 'current_sensor_scale'])
def test_a_scale_that_no_record_shows_is_not_claimed(key):
    wrong = {'counts': 0.0, 'speed_scale': 1.08} if key[0] == 's' else {'current_scale': 1.08}
    pair = records(replace(SENSORS, **wrong))
    found = diagnose(pair[:1], pair[1:], effects=[key, 'coulomb_friction'])
    assert found.verdict is Verdict.COMPLETE


def test_an_effect_of_the_user_is_found_by_the_diagnosis(tmp_path):
    file = tmp_path / 'swash_plate.py'
    file.write_text(
        '"""A pump whose torque pulses with its angle and its speed."""\n'
        'from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale\n'
        'from motor_sysid.physics.laws import sin\n'
        'CARD = Card(title="swash plate", equation="tau = -m sin(3 theta)",\n'
        '    symptom="Three pulses a turn.", reference="-", enters=Enters.MECHANICAL,\n'
        '    axis="position", rotary=True,\n'
        '    amplitudes=(Amplitude("m", "N m", "pulse", Scale.TORQUE),))\n'
        'def torque(theta, m):\n'
        '    """Torque in N m."""\n'
        '    return -m * sin(3.0 * theta)\n'
    )
    try:
        add_effect_file(file)
        pair = records(cogging=4e-3, order=3.0, cogging_angle=np.pi)
        found = diagnosed('swash_plate', ('coulomb_friction', 'gravity_load'), pair)
        assert found.model['swash_plate.m'] == pytest.approx(4e-3, rel=0.03)
    finally:
        catalogue().pop('swash_plate', None)


def test_a_law_of_a_users_own_may_branch_and_call_math(tmp_path):
    """It is written for one sample; all that asks it about many at once calls it for each."""
    file = tmp_path / 'fan.py'
    file.write_text(
        '"""A fan: drag with the square of the speed."""\n'
        'import math\n'
        'from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale\n'
        'CARD = Card(title="fan", equation="tau = -k omega |omega|",\n'
        '    symptom="A parabola against speed.", reference="-", enters=Enters.MECHANICAL,\n'
        '    axis="speed",\n'
        '    amplitudes=(Amplitude("k", "N m s^2/rad^2", "drag", Scale.DRAG, positive=True),))\n'
        'def torque(omega, k):\n'
        '    """Torque in N m."""\n'
        '    if omega < 0.0:\n'
        '        return k * math.pow(omega, 2.0)\n'
        '    return -k * math.pow(omega, 2.0)\n'
    )
    try:
        one = add_effect_file(file)
        speeds = np.array([-2.0, 0.0, 3.0])
        assert one.laws['torque'](speeds, 0.5) == pytest.approx([2.0, 0.0, -4.5])
        assert one.laws['torque'](3.0, 0.5) == -4.5
        found = diagnosed('fan', ('coulomb_friction', 'gravity_load'), records(drag=2e-6))
        assert found.model['fan.k'] == pytest.approx(2e-6, rel=0.03)
    finally:
        catalogue().pop('fan', None)
