"""Hide an effect in a three-phase motor: from its key and size to numbers of the true one."""

from collections.abc import Callable
from dataclasses import replace
import math

import numpy as np

from motor_sysid.benchmark.machine import MachineSheet
from motor_sysid.benchmark.three_phase_rig import Hidden

Hide = Callable[[Hidden, float, MachineSheet, np.random.Generator], Hidden]


def _on(hidden: Hidden, **numbers: float) -> Hidden:
    return replace(hidden, machine=hidden.machine._replace(**numbers))


def rated_torque(sheet: MachineSheet) -> float:
    """Return the torque of the rated current, N m."""
    return (2.0 if sheet.machine.corner else 1.5) * sheet.machine.k_e * sheet.current


def _coulomb(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, tau_c=size * rated_torque(s))


def _stribeck(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    tau = size * rated_torque(s)
    return _on(
        h, tau_c=tau, tau_s=rng.uniform(0.5, 1.0) * tau,
        omega_s=rng.uniform(0.02, 0.08) * s.top_speed,
    )  # fmt: skip


def _drag(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, drag=size * rated_torque(s) / s.top_speed**2)


def _load(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, tau_l=size * rated_torque(s) * rng.choice([-1.0, 1.0]))


def _cogging(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    order = float(rng.choice([2, 4, 6])) * s.machine.pole_pairs
    return _on(
        h, cogging=size * rated_torque(s), cogging_angle=rng.uniform(-np.pi, np.pi), order=order
    )


def _step(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    torque = size * rated_torque(s) * rng.choice([-1.0, 1.0])
    return _on(h, step_torque=torque, step_time=rng.uniform(3.0, 7.0))


def _soft(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, soft=5 * size, i_soft=rng.uniform(0.5, 2.0) * s.current)


def _gravity(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    torque = size * rated_torque(s)
    return _on(h, cogging=torque, cogging_angle=rng.uniform(-np.pi, np.pi), order=1.0)


def _asymmetric(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    tau = size * rated_torque(s)
    return _on(h, tau_c=tau, tau_l=rng.uniform(0.2, 0.5) * tau * rng.choice([-1.0, 1.0]))


def _gear(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, mu=size)


def _swing(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    rate = 2 * np.pi * float(np.exp(rng.uniform(np.log(0.7), np.log(15.0))))
    return _on(
        h, swing=size * rated_torque(s), swing_rate=rate, swing_angle=rng.uniform(-np.pi, np.pi)
    )


def _inertia(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, step_inertia=5 * size * h.machine.J, step_time=rng.uniform(3.0, 7.0))


def _shaft(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    share, total = 5 * size, h.machine.J
    small = total * share * (1 - share)
    pulsation = 2 * np.pi * float(np.exp(rng.uniform(np.log(15.0), np.log(80.0))))
    return _on(
        h, J=total * (1 - share), J_load=total * share, spring=small * pulsation**2,
        damper=0.1 * small * pulsation,
    )  # fmt: skip


def _heat(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    phases = 2.0 if s.machine.corner else 1.5
    loss = phases * h.machine.R * (0.5 * s.current) ** 2
    t_th = float(np.exp(rng.uniform(np.log(3.0), np.log(30.0))))
    return _on(h, heat=2.5 * size / (loss * t_th * -math.expm1(-10.0 / t_th)), t_th=t_th)


def _lag(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    low, high = (2e-3, 5e-3) if size < 0.06 else (5e-3, 20e-3)
    return replace(h, speed_lag=float(rng.uniform(low, high)))


def _dead(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    voltage = 0.5 * size * s.supply
    return replace(h, dead=voltage, band=rng.uniform(0.02, 0.1) * s.current)


def _delay(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    low, high = (1e-3, 3e-3) if size < 0.06 else (3e-3, 12e-3)
    return replace(h, delay=float(rng.uniform(low, high)))


def _harmonics(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    return _on(h, fifth=size, seventh=-rng.uniform(0.3, 1.0) * size)


def _old_angle(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    fast = 0.4 * s.top_speed * s.machine.pole_pairs  # electrical, as fast as records go
    return replace(h, angle_lag=size / fast)


def _late_voltage(h: Hidden, size: float, s: MachineSheet, rng: np.random.Generator) -> Hidden:
    fast = 0.4 * s.top_speed * s.machine.pole_pairs
    return replace(h, voltage_lag=size / fast)


HIDE: dict[str, Hide] = {
    'coulomb_friction': _coulomb,
    'stribeck_friction': _stribeck,
    'quadratic_drag': _drag,
    'constant_load_torque': _load,
    'cogging_torque': _cogging,
    'load_torque_step': _step,
    'inductance_saturation': _soft,
    'inverter_dead_time': _dead,
    'input_delay': _delay,
    'emf_harmonics': _harmonics,
    'gravity_load': _gravity,
    'asymmetric_coulomb_friction': _asymmetric,
    'load_dependent_friction': _gear,
    'periodic_load': _swing,
    'inertia_change': _inertia,
    'flexible_shaft': _shaft,
    'armature_heating': _heat,
    'speed_sensor_lag': _lag,
    'rotor_angle_lag': _old_angle,
    'voltage_angle_lag': _late_voltage,
}
"""Key to the function that hides an effect of a size in a machine; sizes as in `hidden`."""
