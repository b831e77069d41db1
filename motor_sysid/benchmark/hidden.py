"""Hide an effect in a motor: from its key and size to numbers of the true motor.

The size is a fraction of the rated torque for torques (drag: at the no-load speed), of the nominal
voltage for the brush drop, and the like for what has another unit; see the functions.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from motor_sysid.benchmark.datasheets import DataSheet
from motor_sysid.benchmark.plant import Plant


@dataclass(frozen=True)
class Situation:
    """What the size of an effect is measured by.

    Attributes
    ----------
    sheet:
        The data sheet.
    duration:
        Length of a record, s.
    loss:
        Mean loss in the winding over the records, W.
    """

    sheet: DataSheet
    duration: float
    loss: float


Hide = Callable[[Plant, float, Situation, np.random.Generator], Plant]


def coulomb_friction(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Dry friction of `size` times rated torque."""
    tau = size * s.sheet.torque
    return p._replace(tau_plus=p.tau_plus + tau, tau_minus=p.tau_minus + tau)


def asymmetric_coulomb_friction(
    p: Plant, size: float, s: Situation, rng: np.random.Generator
) -> Plant:
    """Dry friction of mean `size`, 1.5 to 3 times larger in one direction."""
    ratio = rng.uniform(1.5, 3.0)
    sides = 2 * size * s.sheet.torque * np.array([ratio, 1.0]) / (1 + ratio)
    plus, minus = rng.permutation(sides)
    return p._replace(tau_plus=plus, tau_minus=minus)


def stribeck_friction(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Dry friction of `size` whose excess at standstill, 0.5 to 1 times as large, fades."""
    tau = size * s.sheet.torque
    return p._replace(
        tau_plus=tau,
        tau_minus=tau,
        tau_s=rng.uniform(0.5, 1.0) * tau,
        omega_s=rng.uniform(0.02, 0.08) * s.sheet.top_speed,
        sharpness=float(rng.choice([1.0, 2.0])),
    )


def quadratic_drag(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Drag of `size` times rated torque at no-load speed."""
    return p._replace(drag=size * s.sheet.torque / s.sheet.top_speed**2)


def constant_load_torque(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Load of `size` times rated torque, either way."""
    return p._replace(tau_l=size * s.sheet.torque * rng.choice([-1.0, 1.0]))


def gravity_load(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Unbalanced mass of `size` times rated torque."""
    return p._replace(gravity=size * s.sheet.torque, gravity_angle=rng.uniform(-np.pi, np.pi))


def cogging_torque(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Cogging of `size`, order 5 to 48, with a second harmonic of up to half of it."""
    tau = size * s.sheet.torque
    return p._replace(
        cogging=tau,
        cogging_angle=rng.uniform(-np.pi, np.pi),
        second=rng.uniform(0.0, 0.5) * tau,
        second_angle=rng.uniform(-np.pi, np.pi),
        order=float(rng.integers(5, 49)),
    )


def input_delay(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Delay of 0.3 to 1 ms, 1 to 3 ms or 3 to 20 ms at sizes 1, 3 and 10 %."""
    return p._replace(delay=_lateness(size, rng))


def brush_voltage_drop(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Drop of `size` times nominal voltage."""
    return p._replace(v_b=size * s.sheet.voltage)


def armature_heating(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Resistance that has risen by 2.5 times `size` when the record ends."""
    t_th = float(np.exp(rng.uniform(np.log(3.0), np.log(30.0))))
    stored = s.loss * t_th * (1 - np.exp(-s.duration / t_th))
    return p._replace(heat=2.5 * size / stored, t_th=t_th)


def flexible_shaft(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Elastic shaft with 5 times `size` of the inertia behind it, resonance 15 to 80 Hz."""
    share = 5 * size
    small = p.J * share * (1 - share)
    pulsation = 2 * np.pi * np.exp(rng.uniform(np.log(15.0), np.log(80.0)))
    return p._replace(
        share=share, stiffness=small * pulsation**2, damping=0.1 * small * pulsation
    )


def backlash(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Play of 20 degrees times `size` before half of the inertia, stiff contact."""
    small = 0.25 * p.J
    pulsation = 2 * np.pi * 150.0
    return p._replace(
        share=0.5,
        gap=np.deg2rad(10.0 * size),
        stiffness=small * pulsation**2,
        damping=0.5 * small * pulsation,
    )


def load_torque_step(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Load of `size` that comes on between 0.3 and 0.7 of the record."""
    torque = size * s.sheet.torque * rng.choice([-1.0, 1.0])
    return p._replace(step_torque=torque, step_time=rng.uniform(0.3, 0.7) * s.duration)


def inertia_change(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Inertia that rises by 5 times `size` between 0.3 and 0.7 of the record."""
    return p._replace(inertia_gain=5 * size, inertia_time=rng.uniform(0.3, 0.7) * s.duration)


def torque_constant_saturation(
    p: Plant, size: float, s: Situation, rng: np.random.Generator
) -> Plant:
    """Torque constant that has fallen by 3 times `size` at three times the rated current."""
    current = 3 * s.sheet.torque / p.k
    left = 1 - 3 * size
    share = brentq(lambda x: np.tanh(x) / x - left, 1e-3, 1 / left)
    return p._replace(i_sat=current / share)


def lugre_friction(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Friction of `size` whose bristles bend by 2 to 20 mrad, with up to half as much stiction."""
    return p._replace(
        bristle=size * s.sheet.torque,
        bend=float(np.exp(rng.uniform(np.log(2e-3), np.log(20e-3)))),
        stiction=rng.uniform(0.1, 0.5),
        omega_s=rng.uniform(0.02, 0.08) * s.sheet.top_speed,
    )


def friction_drift(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Friction that grows from nothing to twice `size`, by chance dry, viscous or both."""
    rate, dry = 2 * size * s.sheet.torque / s.duration, float(rng.choice([0.0, 0.5, 1.0]))
    return p._replace(drift_dry=dry * rate, drift_viscous=(1 - dry) * rate / s.sheet.top_speed)


def periodic_load(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Load that swings by `size` at 0.7 to 15 Hz."""
    return p._replace(
        swing=size * s.sheet.torque,
        frequency=float(np.exp(rng.uniform(np.log(0.7), np.log(15.0)))),
        swing_angle=rng.uniform(-np.pi, np.pi),
    )


def torque_ripple(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Torque constant that swings by `size` of itself, 5 to 48 times a turn."""
    return p._replace(
        ripple=size,
        ripple_order=float(rng.integers(5, 49)),
        ripple_angle=rng.uniform(-np.pi, np.pi),
    )


def iron_loss(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Excess loss that brakes by `size` times rated torque at no-load speed."""
    return p._replace(iron=size * s.sheet.torque / np.sqrt(s.sheet.top_speed))


def inverter_dead_time(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Loss of `size` times nominal voltage beyond 0.2 to 1 times rated current."""
    current = s.sheet.torque / p.k
    return p._replace(v_dead=size * s.sheet.voltage, i_dead=rng.uniform(0.2, 1.0) * current)


def drive_coast(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Bridge that lets go for 5 times `size` of the pause, at most all of it."""
    return p._replace(coast=min(5 * size, 1.0), coast_voltage=s.sheet.voltage)


def inductance_saturation(
    p: Plant, size: float, s: Situation, rng: np.random.Generator
) -> Plant:
    """Inductance larger by 5 times `size` without current, half gone at 0.5 to 2 rated ones."""
    current = s.sheet.torque / p.k
    return p._replace(soft=5 * size, i_soft=rng.uniform(0.5, 2.0) * current)


def current_sensor_lag(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Filter of the current sensor, as slow as `input_delay` is late."""
    return p._replace(current_lag=_lateness(size, rng))


def load_dependent_friction(
    p: Plant, size: float, s: Situation, rng: np.random.Generator
) -> Plant:
    """Gear that rubs with `size` of the torque that the motor makes."""
    return p._replace(gear_loss=size)


def supply_sag(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Supply that falls by `size` of the nominal voltage at full duty and rated current."""
    return p._replace(sag=size * p.k / (s.sheet.voltage * s.sheet.torque))


def driver_clipping(p: Plant, size: float, s: Situation, rng: np.random.Generator) -> Plant:
    """Bridge that ends at 45 % of the nominal voltage less twice `size`."""
    return p._replace(top_voltage=(0.45 - 2 * size) * s.sheet.voltage)


def _lateness(size: float, rng: np.random.Generator) -> float:
    low, high = (0.3e-3, 1e-3) if size < 0.02 else (1e-3, 3e-3) if size < 0.06 else (3e-3, 20e-3)
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


HIDE: dict[str, Hide] = {
    one.__name__: one
    for one in (
        coulomb_friction, asymmetric_coulomb_friction, stribeck_friction, quadratic_drag,
        constant_load_torque, gravity_load, cogging_torque, input_delay, brush_voltage_drop,
        armature_heating, flexible_shaft, backlash, load_torque_step, inertia_change,
        torque_constant_saturation, lugre_friction, friction_drift, periodic_load, torque_ripple,
        iron_loss, inverter_dead_time, drive_coast, inductance_saturation, current_sensor_lag,
        load_dependent_friction, supply_sag, driver_clipping,
    )
}  # fmt: skip
"""Key to the function that hides it; `current_sensor_scale` belongs to the sensors."""
