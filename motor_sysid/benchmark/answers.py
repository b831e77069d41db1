"""The true values of a model's parameters, where the model's law is the law of the true motor.

The laws of `motor_sysid.benchmark.truth` are not copies of those in the catalogue.  Where the two
differ in shape (Stribeck, saturation) there is no true value: the entry then only starts a fit.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from motor_sysid.benchmark.cases import Case
from motor_sysid.benchmark.datasheets import DataSheet
from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.sensors import Sensors


@dataclass(frozen=True)
class Bench:
    """True motor, its sensors and its data sheet."""

    plant: Plant
    sensors: Sensors
    sheet: DataSheet


Values = Mapping[str, float]
Answer = Callable[[Bench], Values]


def _coulomb(b: Bench) -> Values:
    return {'tau_c': b.plant.tau_plus}


def _asymmetric(b: Bench) -> Values:
    return {'tau_c_plus': b.plant.tau_plus, 'tau_c_minus': b.plant.tau_minus}


def _drag(b: Bench) -> Values:
    return {'k_d': b.plant.drag}


def _load(b: Bench) -> Values:
    return {'tau_l': b.plant.tau_l}


def _gravity(b: Bench) -> Values:
    size, angle = b.plant.gravity, b.plant.gravity_angle
    return {'tau_sin': size * np.cos(angle), 'tau_cos': -size * np.sin(angle)}


def _cogging(b: Bench) -> Values:
    p = b.plant
    return {
        'a_1': p.cogging * np.sin(p.cogging_angle),
        'b_1': p.cogging * np.cos(p.cogging_angle),
        'a_2': p.second * np.sin(p.second_angle),
        'b_2': p.second * np.cos(p.second_angle),
        'n': p.order,
    }


def _delay(b: Bench) -> Values:
    return {'delay': b.plant.delay}


def _brushes(b: Bench) -> Values:
    return {'v_b': b.plant.v_b}


def _heating(b: Bench) -> Values:
    return {'h': b.plant.heat, 't_th': b.plant.t_th}


def _shaft(b: Bench) -> Values:
    p = b.plant
    load = p.J * p.share
    antiresonance = np.sqrt(p.stiffness / load)
    return {
        'r': p.share / (1 - p.share),
        'w_a': antiresonance,
        'z': p.damping / (2 * antiresonance * load),
    }


def _speed_offset(b: Bench) -> Values:
    return {'o': b.sensors.speed_offset}


def _stribeck(b: Bench) -> Values:
    p = b.plant
    return {'tau_c': p.tau_plus, 'tau_s': p.tau_s, 'omega_s': p.omega_s}


def _saturation(b: Bench) -> Values:
    current = 3 * b.sheet.current
    return {'s': (1 - 1 / np.hypot(1, current / b.plant.i_sat)) / current}


EXACT: dict[str, Answer] = {
    'coulomb_friction': _coulomb,
    'asymmetric_coulomb_friction': _asymmetric,
    'quadratic_drag': _drag,
    'constant_load_torque': _load,
    'gravity_load': _gravity,
    'cogging_torque': _cogging,
    'input_delay': _delay,
    'brush_voltage_drop': _brushes,
    'armature_heating': _heating,
    'flexible_shaft': _shaft,
    'speed_sensor_offset': _speed_offset,
}
"""Effects whose law in the true motor is the catalogue's."""

NEAR: dict[str, Answer] = {
    'stribeck_friction': _stribeck,
    'torque_constant_saturation': _saturation,
}
"""Effects whose law differs in shape: values to start from."""

ANGULAR = frozenset({'gravity_load', 'cogging_torque'})
"""Effects whose parameters have a true value only where the position is recorded."""


def true_effect_values(case: Case) -> dict[str, float]:
    """Return ``effect.parameter`` to its true value, for all that have one."""
    bench = _bench(case)
    angle = case.setting.sensors.counts and case.setting.sensors.position
    return {
        f'{key}.{name}': float(value)
        for key in case.scenario.effects
        if key in EXACT and (angle or key not in ANGULAR)
        for name, value in EXACT[key](bench).items()
    }


def start_values(case: Case, key: str) -> dict[str, float] | None:
    """Return values from which a fit of a hidden effect may start; None where none are known."""
    answer = EXACT.get(key) or NEAR.get(key)
    return {n: float(v) for n, v in answer(_bench(case)).items()} if answer else None


def true_base_values(case: Case, effects: tuple[str, ...] = ()) -> dict[str, float]:
    """Return base parameter to its true value, for a model with the given effects.

    A wrong scale of the current sensor belongs to the base parameters (see `equivalences`), and
    the inertia behind a flexible shaft to the shaft as soon as the model has one.
    """
    p, scale = case.setting.plant, case.setting.sensors.current_scale
    inertia = p.J * (1 - p.share) if 'flexible_shaft' in effects else p.J
    if 'current_sensor_scale' in effects:
        scale = 1.0
    return {
        'R': p.R / scale, 'L': p.L / scale, 'k_t': p.k, 'J': inertia * scale, 'b': p.b * scale,
    }  # fmt: skip


def _bench(case: Case) -> Bench:
    return Bench(case.setting.plant, case.setting.sensors, case.setting.sheet)
