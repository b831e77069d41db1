"""A motor simulated the hard way, and on purpose with nothing of `motor_sysid.physics`.

Classical Runge-Kutta steps, at least two in an electrical time constant and never longer than
`LONGEST_STEP`.  Dry friction and brushes are true signs: in a step both signs are held, the
instant at which speed or current passes through zero is found, the step is cut there, and the
part that is at rest stays there until the other forces exceed what holds it (Karnopp 1985,
doi:10.1115/1.3140698, without his dead zone).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.plant import Plant
from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

LONGEST_STEP = 40e-6
"""s."""

_I, _OMEGA, _THETA, _OMEGA_L, _THETA_L, _HEAT, _BEND, _I_SHOWN = range(8)
_STATES = 8
_CUTS = 8
_HIGHEST_VOLTAGE = 48.0
_HOT = 5.0  # resistance of a hot winding over that of a cold one, at most


@dataclass(frozen=True)
class Control:
    """Where the voltage comes from.

    Attributes
    ----------
    reference:
        (N,) voltage in V, or with a controller speed in rad/s.
    kp, ki:
        Gains of a PI speed controller, V s/rad and V/rad; both zero for open loop.
    limit:
        Largest voltage, V.
    resolution:
        Step of the voltage that the PWM can set, V.
    counts:
        Encoder counts per turn that the controller takes its speed from; 0: the true speed.
    """

    reference: Array
    kp: float = 0.0
    ki: float = 0.0
    limit: float = np.inf
    resolution: float = 0.0
    counts: float = 0.0


@dataclass(frozen=True)
class Truth:
    """What really happened.

    Attributes
    ----------
    voltage:
        (N,) commanded voltage, held from each sample to the next, V.
    current, speed, position:
        (N,) at the sample times, A, rad/s, rad.
    energy:
        (N,) heat stored in the winding, J.
    shown_current:
        (N,) behind the filter of the current sensor, A.
    """

    voltage: Array
    current: Array
    speed: Array
    position: Array
    energy: Array
    shown_current: Array


def run(
    plant: Plant,
    control: Control,
    dt: float,
    process_torque: Array | None = None,
    start: Array | None = None,
    substeps: int | None = None,
) -> Truth:
    """Simulate a motor.

    Parameters
    ----------
    plant, control:
        The motor and what drives it; ``control.reference`` gives the number of samples N.
    dt:
        Sample time, s.
    process_torque:
        (N,) random torque on the shaft, held over each sample, N m.
    start:
        (6,) current, speed, position, load speed, load position, stored heat; default: at rest.
        Bristles begin unbent, the filter of the current at the current.
    substeps:
        Steps per sample; by default as many as accuracy asks for.
    """
    count = control.reference.size
    random = np.zeros(count) if process_torque is None else process_torque
    state = np.zeros(_STATES)
    if start is not None:
        state[: start.size] = start
    state[_I_SHOWN] = state[_I]
    steps = substeps or steps_per_sample(plant, dt)
    voltage, states = np.zeros(count), np.empty((count, _STATES))
    c, numbers = control, Plant(*map(float, plant))
    _run(
        numbers, c.reference, float(c.kp), float(c.ki), float(c.limit), float(c.resolution),
        float(c.counts), dt, steps, random, state, voltage, states,
    )  # fmt: skip
    i, shown = states[:, _I], states[:, _I_SHOWN]
    return Truth(
        voltage, i, states[:, _OMEGA], states[:, _THETA], states[:, _HEAT],
        shown if plant.current_lag > 0 else i,
    )  # fmt: skip


def steps_per_sample(plant: Plant, dt: float) -> int:
    """Return the number of steps that resolves every time constant."""
    hottest = plant.R * (_HOT if plant.heat > 0 else 1.0)
    longest = min(LONGEST_STEP, 0.5 * plant.L / hottest)
    if plant.share > 0:
        small = plant.J * min(plant.share, 1 - plant.share)
        swing, fade = np.sqrt(small / plant.stiffness), small / plant.damping
        longest = min(longest, 0.15 * swing, 0.3 * fade)
    if plant.bristle > 0:
        stiffness = plant.bristle / plant.bend
        slips = plant.bend * plant.k / _HIGHEST_VOLTAGE
        longest = min(longest, slips, 0.15 * np.sqrt(plant.J / stiffness))
    if plant.current_lag > 0:
        longest = min(longest, plant.current_lag)
    return max(int(np.ceil(dt / longest)), 20)


@kept(error_model='numpy')
def _run(  # type: ignore[no-untyped-def]
    plant, reference, kp, ki, limit, resolution, counts, dt, steps, random, x, voltage, states
):  # fmt: skip
    """Fill `voltage` (N,) and `states` (N, 8)."""
    work = np.empty((3, _STATES))
    integral, before, h = 0.0, _count(x[_THETA], counts), dt / steps
    for k in range(reference.size):
        states[k] = x
        u = reference[k]
        if kp != 0.0:
            speed = x[_OMEGA]
            if counts > 0.0:
                now = _count(x[_THETA], counts)
                speed, before = (now - before) / dt, now
            error = reference[k] - speed
            u = kp * error + integral
            if abs(u) < limit or u * error < 0.0:
                integral += ki * error * dt
        u = min(max(u, -limit), limit)
        if resolution > 0.0:
            u = resolution * np.floor(u / resolution + 0.5)
        voltage[k] = u
        for j in range(steps):
            t = k * dt + j * h
            late = _delayed(voltage, k, t + 0.5 * h - plant.delay, h, dt)
            if plant.top_voltage > 0.0:
                late = min(max(late, -plant.top_voltage), plant.top_voltage)
            _advance(plant, x, late, t, h, random[k], work)


@kept(error_model='numpy')
def _count(angle, counts):  # type: ignore[no-untyped-def]
    """Angle in rad as an encoder shows it."""
    if counts == 0.0:
        return angle
    step = 2.0 * np.pi / counts
    return step * np.floor(angle / step)


@kept(error_model='numpy')
def _delayed(voltage, newest, middle, h, dt):  # type: ignore[no-untyped-def]
    """Mean voltage over the step of length `h` around the time `middle`."""
    last = int(np.floor((middle + 0.5 * h) / dt + 1e-9))
    first = int(np.floor((middle - 0.5 * h) / dt + 1e-9))
    now = voltage[min(last, newest)] if last >= 0 else 0.0
    if first == last:
        return now
    old = voltage[first] if first >= 0 else 0.0
    part = (middle + 0.5 * h - last * dt) / h
    return part * now + (1.0 - part) * old


@kept(error_model='numpy')
def _advance(plant, x, u, t, h, random, work):  # type: ignore[no-untyped-def]
    """Advance the state by one step, cut wherever speed or current passes through zero."""
    left, new = h, work[2]
    for _ in range(_CUTS):
        moving, flowing = _signs(plant, x, u, t, random)
        _step(plant, x, u, t, left, random, moving, flowing, work)
        at_speed = _cut(x[_OMEGA], new[_OMEGA], moving)
        at_current = _cut(x[_I], new[_I], flowing)
        part = min(at_speed, at_current)
        if part >= 1.0:
            break
        _step(plant, x, u, t, part * left, random, moving, flowing, work)
        x[:] = new
        x[_OMEGA if at_speed <= at_current else _I] = 0.0
        t += part * left
        left *= 1.0 - part
    x[:] = new


@kept(error_model='numpy')
def _cut(old, new, sign):  # type: ignore[no-untyped-def]
    """Part of the step after which a value of that sign is zero; 1 if it does not get there."""
    if new * sign >= 0.0:
        return 1.0
    return old / (old - new)


@kept(error_model='numpy')
def _signs(plant, x, u, t, random):  # type: ignore[no-untyped-def]
    """Signs of dry friction and brush drop over the next step; 0 where it rests or has none."""
    moving = np.sign(x[_OMEGA])
    if not _dry(plant):
        moving = 0.0
    elif moving == 0.0:
        net = _torque(plant, x, t, random)
        way = np.sign(net)
        moving = way if abs(net) > _friction(plant, x, way, 0.0, t) else 0.0
    flowing = np.sign(x[_I])
    if plant.v_b == 0.0:
        flowing = 0.0
    elif flowing == 0.0:
        net = u - plant.k * x[_OMEGA]
        flowing = np.sign(net) if abs(net) > plant.v_b else 0.0
    return moving, flowing


@kept(error_model='numpy')
def _dry(plant):  # type: ignore[no-untyped-def]
    rubs = plant.tau_plus > 0.0 or plant.tau_minus > 0.0 or plant.tau_s > 0.0
    return rubs or plant.drift_dry != 0.0 or plant.gear_loss > 0.0


@kept(error_model='numpy')
def _friction(plant, x, way, speed, t):  # type: ignore[no-untyped-def]
    """Size of the dry friction when moving that way, N m."""
    size = plant.tau_plus if way > 0.0 else plant.tau_minus
    size = max(size + plant.drift_dry * t, 0.0)
    if plant.tau_s > 0.0:
        size += plant.tau_s * np.exp(-(abs(speed / plant.omega_s) ** plant.sharpness))
    if plant.gear_loss > 0.0:
        size += plant.gear_loss * abs(_constant(plant, x[_I], x[_THETA]) * x[_I])
    return size


@kept(error_model='numpy')
def _twist(plant, x):  # type: ignore[no-untyped-def]
    """Torque through the elastic shaft, N m."""
    angle = x[_THETA] - x[_THETA_L]
    beyond = angle - min(max(angle, -plant.gap), plant.gap)
    if beyond == 0.0 and plant.gap > 0.0:
        return 0.0
    torque = plant.stiffness * beyond + plant.damping * (x[_OMEGA] - x[_OMEGA_L])
    return torque if plant.gap == 0.0 or torque * beyond > 0.0 else 0.0


@kept(error_model='numpy')
def _constant(plant, i, theta):  # type: ignore[no-untyped-def]
    """Torque and back-EMF constant at that current and angle, N m/A."""
    k = plant.k
    if plant.ripple != 0.0:
        k *= 1.0 + plant.ripple * np.sin(plant.ripple_order * theta + plant.ripple_angle)
    if plant.i_sat == 0.0:
        return k
    share = abs(i) / plant.i_sat
    return k * np.tanh(share) / share if share > 1e-6 else k


@kept(error_model='numpy')
def _bristles(plant, omega, bend):  # type: ignore[no-untyped-def]
    """Torque of the bristles against the motion, N m, and the rate of their bend, rad/s."""
    limit = 1.0 + plant.stiction * np.exp(-((omega / plant.omega_s) ** 2))
    slip = omega - abs(omega) * bend / (plant.bend * limit)
    stiffness = plant.bristle / plant.bend
    damping = 2.0 * np.sqrt(stiffness * plant.J)
    fades = np.exp(-((omega * damping / plant.bristle) ** 2))
    return stiffness * bend + damping * fades * slip, slip


@kept(error_model='numpy')
def _bridge(plant, i, u, emf):  # type: ignore[no-untyped-def]
    """Voltage that dead time, coasting and a soft supply add to what was asked for, V."""
    added = 0.0
    if plant.v_dead != 0.0:
        added -= plant.v_dead * min(max(i / plant.i_dead, -1.0), 1.0)
    if plant.coast != 0.0:
        added += plant.coast * max(1.0 - abs(u) / plant.coast_voltage, 0.0) * emf
    return added - plant.sag * u * u * i


@kept(error_model='numpy')
def _torque(plant, x, t, random):  # type: ignore[no-untyped-def]
    """Torque on the rotor but for dry friction, N m."""
    i, omega, theta = x[_I], x[_OMEGA], x[_THETA]
    torque = _constant(plant, i, theta) * i - plant.b * omega - plant.drag * omega * abs(omega)
    torque += random - plant.tau_l
    if plant.gravity != 0.0:
        torque -= plant.gravity * np.sin(theta - plant.gravity_angle)
    if plant.cogging != 0.0:
        angle = plant.order * theta
        torque += plant.cogging * np.sin(angle + plant.cogging_angle)
        torque += plant.second * np.sin(2.0 * angle + plant.second_angle)
    if t >= plant.step_time:
        torque -= plant.step_torque
    torque -= plant.drift_viscous * t * omega + plant.iron * np.sign(omega) * np.sqrt(abs(omega))
    if plant.swing != 0.0:
        torque += plant.swing * np.sin(2.0 * np.pi * plant.frequency * t + plant.swing_angle)
    if plant.bristle != 0.0:
        torque -= _bristles(plant, omega, x[_BEND])[0]
    if plant.share > 0.0:
        torque -= _twist(plant, x)
    return torque


@kept(error_model='numpy')
def _rates(plant, x, u, t, random, moving, flowing, out):  # type: ignore[no-untyped-def]
    """Time derivatives (8,) of the state while both signs are held."""
    inertia = plant.J
    if t >= plant.inertia_time:
        inertia *= 1.0 + plant.inertia_gain
    resistance = plant.R * (1.0 + plant.heat * x[_HEAT])
    emf = _constant(plant, x[_I], x[_THETA]) * x[_OMEGA]
    inductance = plant.L
    if plant.soft != 0.0:
        inductance *= 1.0 + plant.soft * 0.5 ** ((x[_I] / plant.i_soft) ** 2)
    given = u + _bridge(plant, x[_I], u, emf)
    out[_I] = (given - resistance * x[_I] - emf - plant.v_b * flowing) / inductance
    if plant.v_b > 0.0 and flowing == 0.0:
        out[_I] = 0.0
    net = _torque(plant, x, t, random)
    if moving != 0.0:
        net -= moving * _friction(plant, x, moving, x[_OMEGA], t)
    rests = moving == 0.0 and _dry(plant)
    out[_OMEGA] = 0.0 if rests else net / (inertia * (1.0 - plant.share))
    out[_THETA] = 0.0 if rests else x[_OMEGA]
    out[_OMEGA_L] = _twist(plant, x) / (inertia * plant.share) if plant.share > 0.0 else 0.0
    out[_THETA_L] = x[_OMEGA_L]
    out[_HEAT] = resistance * x[_I] ** 2 - x[_HEAT] / plant.t_th
    out[_BEND] = _bristles(plant, x[_OMEGA], x[_BEND])[1] if plant.bristle > 0.0 else 0.0
    lag = plant.current_lag
    out[_I_SHOWN] = (x[_I] - x[_I_SHOWN]) / lag if lag > 0.0 else 0.0


@kept(error_model='numpy')
def _step(plant, x, u, t, h, random, moving, flowing, work):  # type: ignore[no-untyped-def]
    """One classical Runge-Kutta step; the new state is left in ``work[2]``."""
    k, at, new = work
    _rates(plant, x, u, t, random, moving, flowing, k)
    for s in range(_STATES):
        new[s] = x[s] + h / 6.0 * k[s]
        at[s] = x[s] + 0.5 * h * k[s]
    _rates(plant, at, u, t, random, moving, flowing, k)
    for s in range(_STATES):
        new[s] += h / 3.0 * k[s]
        at[s] = x[s] + 0.5 * h * k[s]
    _rates(plant, at, u, t, random, moving, flowing, k)
    for s in range(_STATES):
        new[s] += h / 3.0 * k[s]
        at[s] = x[s] + h * k[s]
    _rates(plant, at, u, t, random, moving, flowing, k)
    for s in range(_STATES):
        new[s] += h / 6.0 * k[s]
