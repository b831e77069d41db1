"""A brushed motor in small steps of Euler's method, apart from every model of the package.

Dry friction holds until the torque exceeds it and stops the rotor where its speed changes sign;
only brushes are smoothed, over a small current.  The drive holds each voltage over a sample, in
steps of its PWM; an encoder counts; a converter shows the current.  Units are SI.
"""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP = 1e-5
"""Step of the integration, s."""

CURRENT, SPEED, ANGLE, FAR_ANGLE, FAR_SPEED, WARMTH, SHOWN = range(7)


class Motor(NamedTuple):
    """What the motor is, and what hides in it: all of that is absent at its default."""

    R: float
    L: float
    k: float
    J: float
    b: float
    friction: float = 0.0
    stiction: float = 0.0
    fades_at: float = 1.0
    drag: float = 0.0
    load: float = 0.0
    load_from: float = 0.0
    more_inertia: float = 0.0
    inertia_from: float = 0.0
    cogging: float = 0.0
    teeth: float = 1.0
    ripple: float = 0.0
    bars: float = 1.0
    weight: float = 0.0
    weight_at: float = 0.0
    brushes: float = 0.0
    brushes_width: float = 0.01
    dead: float = 0.0
    dead_width: float = 1.0
    supply_resistance: float = 0.0
    heating: float = 0.0
    cooling: float = 1.0
    thins_to: float = 0.0
    thins_within: float = 0.0
    shaft: float = 0.0
    shaft_damping: float = 0.0
    far_inertia: float = 1.0
    far_friction: float = 0.0
    play: float = 0.0
    gear: float = 1.0
    delay: float = 0.0


class Rig(NamedTuple):
    """Drive, sensors and controller: gains of zero leave the loop open."""

    supply: float
    levels: float
    counts: float
    offset: float
    resolution: float
    range: float
    proportional: float = 0.0
    integral: float = 0.0
    speed_filter: float = 0.0
    current_filter: float = 0.0


@numba.njit(cache=True)
def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


@numba.njit(cache=True)
def _current(motor: Motor, rig: Rig, volts: float, x: Array) -> None:
    """Move current, warmth and what the current sensor shows."""
    sag = motor.supply_resistance * (volts / rig.supply) ** 2 * x[CURRENT]
    inner = volts - sag - motor.brushes * np.tanh(x[CURRENT] / motor.brushes_width)
    inner -= motor.dead * _clip(x[CURRENT] / motor.dead_width, 1.0)
    r = motor.R * (1 + 0.0039 * x[WARMTH])
    settled = (inner - _constant(motor, x) * x[SPEED]) / r
    x[CURRENT] = settled + (x[CURRENT] - settled) * np.exp(-r / motor.L * STEP)
    losses = motor.heating * motor.R * x[CURRENT] ** 2
    x[WARMTH] += STEP * (losses - motor.cooling * x[WARMTH])
    x[SHOWN] += STEP / max(rig.current_filter, STEP) * (x[CURRENT] - x[SHOWN])


@numba.njit(cache=True)
def _constant(motor: Motor, x: Array) -> float:
    return motor.k * (1 + motor.ripple * np.sin(motor.bars * x[ANGLE] + 0.4))


@numba.njit(cache=True)
def _twist(motor: Motor, x: Array) -> float:
    """Return the torque of the shaft on the far side, which moves: nothing within its play."""
    angle, speed = x[ANGLE] / motor.gear - x[FAR_ANGLE], x[SPEED] / motor.gear - x[FAR_SPEED]
    beyond = angle - _clip(angle, motor.play)
    torque = motor.shaft * beyond + motor.shaft_damping * speed
    if motor.play > 0.0:
        torque = max(torque, 0.0) if beyond > 0.0 else min(torque, 0.0) if beyond < 0.0 else 0.0
    x[FAR_SPEED] += STEP / motor.far_inertia * (torque - motor.far_friction * x[FAR_SPEED])
    x[FAR_ANGLE] += STEP * x[FAR_SPEED]
    return torque


@numba.njit(cache=True)
def _torque(motor: Motor, time: float, x: Array) -> float:
    """Return all torques but dry friction."""
    b = motor.b
    if motor.thins_within > 0.0:
        b = motor.thins_to + (b - motor.thins_to) * np.exp(-time / motor.thins_within)
    torque = _constant(motor, x) * x[CURRENT] - b * x[SPEED]
    torque -= motor.drag * x[SPEED] * abs(x[SPEED])
    torque -= motor.cogging * np.sin(motor.teeth * x[ANGLE])
    torque -= motor.weight * np.sin(x[ANGLE] + motor.weight_at)
    if time >= motor.load_from:
        torque -= motor.load
    if motor.shaft > 0.0:
        torque -= _twist(motor, x) / motor.gear
    return torque


@numba.njit(cache=True)
def _turn(motor: Motor, time: float, x: Array) -> None:
    """Move speed and angle: dry friction holds, or brakes and stops."""
    inertia = motor.J + (motor.more_inertia if time >= motor.inertia_from else 0.0)
    torque, speed = _torque(motor, time, x), x[SPEED]
    rise = (motor.stiction - motor.friction) * np.exp(-((speed / motor.fades_at) ** 2))
    dry = motor.friction + rise
    if speed == 0.0:
        moved = STEP * (torque - _clip(torque, dry)) / inertia
    else:
        moved = speed + STEP * (torque - np.sign(speed) * dry) / inertia
        if dry > 0.0 and moved * speed < 0.0:
            moved = 0.0
    x[SPEED] = moved
    x[ANGLE] += STEP * moved


@numba.njit(cache=True)
def measure(motor: Motor, rig: Rig, asked: Array, dt: float, noise: Array) -> Array:
    """Return (N, 4) voltage, current, speed and position of a motor that starts from rest.

    Parameters
    ----------
    motor, rig:
        What is measured, and with what.
    asked:
        (N,) voltage in V; with gains, the speed in rad/s that the controller is asked for.
    dt:
        Time between samples, s.
    noise:
        (N,) noise of the current sensor, A.
    """
    x, out = np.zeros(7), np.zeros((asked.size, 4))
    x[ANGLE] = 0.37
    x[FAR_ANGLE] = x[ANGLE] / motor.gear
    held, count = np.zeros(round(motor.delay / STEP) + 1), 2 * np.pi / rig.counts
    last, shown, slot, summed, time = np.floor(x[ANGLE] / count) * count, 0.0, 0, 0.0, 0.0
    share = 1 - np.exp(-dt / rig.speed_filter) if rig.speed_filter > 0.0 else 1.0
    for row in range(asked.size):
        position = np.floor(x[ANGLE] / count) * count
        shown += share * ((position - last) / dt - shown)
        last, current = position, x[SHOWN if rig.current_filter > 0.0 else CURRENT]
        steps = np.round((current + rig.offset + noise[row]) / rig.resolution)
        volts = asked[row]
        if rig.proportional > 0.0:
            volts = rig.proportional * (asked[row] - shown) + summed
            if abs(volts) < rig.supply:
                summed += rig.integral * (asked[row] - shown) * dt
        level = np.round(_clip(volts / rig.supply, 1.0) * rig.levels)
        volts = level / rig.levels * rig.supply
        out[row] = volts, _clip(steps * rig.resolution, rig.range), shown, position
        for _ in range(round(dt / STEP)):
            held[slot] = volts
            slot = (slot + 1) % held.size
            time += STEP
            _current(motor, rig, held[slot], x)
            _turn(motor, time, x)
    return out
