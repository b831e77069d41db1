"""The true values of a model's parameters, where the model's law is the law of the true motor.

The laws of `motor_sysid.benchmark.truth` are not copies of those in the catalogue.  Where the two
differ in shape (Stribeck, LuGre, saturation) there is no true value: the entry then only starts a
fit.
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
    """True motor, its sensors, its data sheet, and the sample time in s."""

    plant: Plant
    sensors: Sensors
    sheet: DataSheet
    dt: float


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


def _ahead(b: Bench) -> float:
    """Return how far the rotor is ahead of what the encoder shows, on average: half a count."""
    return np.pi / b.sensors.counts if b.sensors.counts else 0.0


def _gravity(b: Bench) -> Values:
    size, angle = b.plant.gravity, b.plant.gravity_angle - _ahead(b)
    return {'tau_sin': size * np.cos(angle), 'tau_cos': -size * np.sin(angle)}


def _cogging(b: Bench) -> Values:
    p = b.plant
    first = p.cogging_angle + p.order * _ahead(b)
    second = p.second_angle + 2 * p.order * _ahead(b)
    return {
        'a_1': p.cogging * np.sin(first),
        'b_1': p.cogging * np.cos(first),
        'a_2': p.second * np.sin(second),
        'b_2': p.second * np.cos(second),
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


def _backlash(b: Bench) -> Values:
    return {**_shaft(b), 'phi_g': b.plant.gap}


def _drift(b: Bench) -> Values:
    return {'d_c': b.plant.drift_dry, 'd_v': b.plant.drift_viscous}


def _load_step(b: Bench) -> Values:
    return {'tau_l': b.plant.step_torque, 't_on': b.plant.step_time, 'rise': 2 * b.dt}


def _inertia(b: Bench) -> Values:
    return {'g': b.plant.inertia_gain, 't_on': b.plant.inertia_time, 'rise': 2 * b.dt}


def _swing(b: Bench) -> Values:
    p = b.plant
    return {
        'a': p.swing * np.sin(p.swing_angle),
        'b': p.swing * np.cos(p.swing_angle),
        'f': p.frequency,
    }


def _ripple(b: Bench) -> Values:
    p = b.plant
    angle = p.ripple_angle + p.ripple_order * _ahead(b)
    return {
        'a': p.ripple * np.sin(angle),
        'b': p.ripple * np.cos(angle),
        'n': p.ripple_order,
    }


def _iron(b: Bench) -> Values:
    return {'k_x': b.plant.iron}


def _dead_time(b: Bench) -> Values:
    return {'v_d': b.plant.v_dead, 'i_0': b.plant.i_dead}


def _coast(b: Bench) -> Values:
    return {'a': b.plant.coast, 'u_c': b.plant.coast_voltage}


def _gear(b: Bench) -> Values:
    return {'mu': b.plant.gear_loss}


def _sag(b: Bench) -> Values:
    return {'a': b.plant.sag}


def _clipping(b: Bench) -> Values:
    return {'c': 1 / b.plant.top_voltage}


def _current_lag(b: Bench) -> Values:
    return {'lag': b.plant.current_lag}


def _speed_lag(b: Bench) -> Values:
    return {'lag': b.sensors.speed_filter}


def _speed_offset(b: Bench) -> Values:
    return {'o': b.sensors.speed_offset}


def _stribeck(b: Bench) -> Values:
    p = b.plant
    return {'tau_c': p.tau_plus, 'tau_s': p.tau_s, 'omega_s': p.omega_s}


def _saturation(b: Bench) -> Values:
    return {'a': 1.0, 'i_k': 1.09 * b.plant.i_sat}


def _soft_iron(b: Bench) -> Values:
    return {'s': b.plant.soft, 'i_s': b.plant.i_soft}


def _lugre(b: Bench) -> Values:
    p = b.plant
    stiffness = p.bristle / p.bend
    return {
        'tau_c': p.bristle,
        's': p.stiction,
        'omega_s': p.omega_s,
        'z_s': p.bend,
        't_b': 2 * np.sqrt(p.J / stiffness),
    }


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
    'backlash': _backlash,
    'friction_drift': _drift,
    'load_torque_step': _load_step,
    'inertia_change': _inertia,
    'periodic_load': _swing,
    'torque_ripple': _ripple,
    'iron_loss': _iron,
    'inverter_dead_time': _dead_time,
    'drive_coast': _coast,
    'load_dependent_friction': _gear,
    'supply_sag': _sag,
    'driver_clipping': _clipping,
    'current_sensor_lag': _current_lag,
    'speed_sensor_offset': _speed_offset,
}
"""Effects whose law in the true motor is the catalogue's."""

NEAR: dict[str, Answer] = {
    'stribeck_friction': _stribeck,
    'lugre_friction': _lugre,
    'inductance_saturation': _soft_iron,
    'speed_sensor_lag': _speed_lag,
    'torque_constant_saturation': _saturation,
}
"""Effects whose law differs in shape: values to start from."""

ANGULAR = frozenset({'gravity_load', 'cogging_torque', 'torque_ripple'})
"""Effects whose parameters have a true value only where the position is recorded."""


_SHAFTS = {'flexible_shaft', 'backlash'}


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

    A wrong scale of a sensor belongs to the base parameters (see `equivalences`), and the inertia
    behind a shaft to the shaft as soon as the model has one.
    """
    p, sensors = case.setting.plant, case.setting.sensors
    i = 1.0 if 'current_sensor_scale' in effects else sensors.current_scale
    w = 1.0 if 'speed_sensor_scale' in effects else sensors.speed_scale
    inertia = p.J * (1 - p.share) if _SHAFTS & set(effects) else p.J
    return {
        'R': p.R / i, 'L': p.L / i, 'k_t': p.k / w, 'J': inertia * i / w**2, 'b': p.b * i / w**2,
    }  # fmt: skip


def _bench(case: Case) -> Bench:
    s = case.setting
    return Bench(s.plant, s.sensors, s.sheet, s.dt)
