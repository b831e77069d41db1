"""A three-phase machine on its bridge, with nothing of `motor_sysid.physics` in it.

State: three phase currents, speed, angle, heat, and speed of a load behind a shaft and the
shaft's twist.  Classical Runge-Kutta steps of a few microseconds.  The neutral floats.  Each leg
is a set-valued law: while current flows into the machine its terminal lies at ``low``, while
current flows back at ``high``, and without current anywhere in between.  A chopping leg has
``v -+ dead`` (dead time), an open one the two rails and the diodes; so zero-current clamping and
free-wheeling are one and the same thing.  In a step the signs are held, the instant at which a
current or the speed passes through zero is found, and the step is cut there (as Karnopp 1985,
doi:10.1115/1.3140698, without his dead zone).
"""

import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept

Array = NDArray[np.float64]

LONGEST_STEP = 10e-6
"""s."""

OMEGA, THETA, HEAT, OMEGA_L, TWIST = 3, 4, 5, 6, 7
STATES = 8
_CUTS = 16
_ROOT_LN2 = math.sqrt(math.log(2.0))


@kept(error_model='numpy')
def shape(machine, angle):  # type: ignore[no-untyped-def]
    """Back-EMF of a phase over ``k_e omega``, at its electrical angle."""
    waves = machine.fifth * math.sin(5.0 * angle) + machine.seventh * math.sin(7.0 * angle)
    if machine.corner == 0.0:
        return -(math.sin(angle) + waves)
    ramp = (6.0 / math.pi) * math.asin(math.sin(angle))
    size, c = abs(ramp), machine.corner
    if size > 1.0 + c:
        size = 1.0
    elif size > 1.0 - c:
        size -= (size - 1.0 + c) ** 2 / (4.0 * c)
    return -(math.copysign(size, ramp) + waves)


@kept(error_model='numpy')
def shapes(machine, theta, out):  # type: ignore[no-untyped-def]
    """Fill `out` (3,) with the shapes of the three phases at an angle of the shaft."""
    angle = machine.pole_pairs * theta
    for k in range(3):
        out[k] = shape(machine, angle - k * 2.0 * math.pi / 3.0)


@kept(error_model='numpy')
def _flux(machine, inductance, current):  # type: ignore[no-untyped-def]
    """Flux linkage of an axis, V s, and its slope, H."""
    if machine.soft == 0.0:
        return inductance * current, inductance
    share = current / machine.i_soft * _ROOT_LN2
    area = machine.i_soft * 0.5 * math.sqrt(math.pi) / _ROOT_LN2 * math.erf(share)
    rise = machine.soft * math.exp(-share * share)
    return inductance * (current + machine.soft * area), inductance * (1.0 + rise)


@kept(error_model='numpy')
def _rotated(a, b, c, cos, sin):  # type: ignore[no-untyped-def]
    """Parts of three phases on and across the magnet."""
    alpha, beta = (2.0 * a - b - c) / 3.0, (b - c) / math.sqrt(3.0)
    return alpha * cos + beta * sin, beta * cos - alpha * sin


@kept(error_model='numpy')
def slopes(machine, x, v, form, out):  # type: ignore[no-untyped-def]
    """Fill ``out[:3]`` with di/dt of the phases under terminal voltages; return the torque.

    The torque is that of the currents, N m; `form` are the shapes at the present angle.
    """
    speed_e = machine.pole_pairs * x[OMEGA]
    angle = machine.pole_pairs * x[THETA]
    cos, sin = math.cos(angle), math.sin(angle)
    emf = machine.k_e * x[OMEGA]
    u_d, u_q = _rotated(
        v[0] - emf * form[0], v[1] - emf * form[1], v[2] - emf * form[2], cos, sin
    )
    i_d, i_q = _rotated(x[0], x[1], x[2], cos, sin)
    flux_d, l_d = _flux(machine, machine.L_d, i_d)
    flux_q, l_q = _flux(machine, machine.L_q, i_q)
    resistance = machine.R * (1.0 + machine.heat * x[HEAT])
    d = (u_d - resistance * i_d + speed_e * flux_q) / l_d - speed_e * i_q
    q = (u_q - resistance * i_q - speed_e * flux_d) / l_q + speed_e * i_d
    alpha, beta = d * cos - q * sin, d * sin + q * cos
    side = 0.5 * math.sqrt(3.0) * beta
    out[0], out[1], out[2] = alpha, side - 0.5 * alpha, -side - 0.5 * alpha
    pull = machine.k_e * (form[0] * x[0] + form[1] * x[1] + form[2] * x[2])
    return pull + 1.5 * machine.pole_pairs * (flux_d * i_q - flux_q * i_d)


@kept(error_model='numpy')
def _holding(machine, x, v, form, phase, out):  # type: ignore[no-untyped-def]
    """Return the terminal voltage at which the current of one phase does not change, V."""
    v[phase] = 0.0
    slopes(machine, x, v, form, out)
    at_zero = out[phase]
    v[phase] = 1.0
    slopes(machine, x, v, form, out)
    return -at_zero / (out[phase] - at_zero)


@kept(error_model='numpy')
def terminals(machine, x, low, high, flow, form, v, out):  # type: ignore[no-untyped-def]
    """Fill `v` (3,) with the terminal voltages for given directions of flow (0: none)."""
    still = 0
    for k in range(3):
        v[k] = low[k] if flow[k] > 0.0 else high[k]
        still += flow[k] == 0.0
    if still == 1:
        for k in range(3):
            if flow[k] == 0.0:
                v[k] = _holding(machine, x, v, form, k, out)
    elif still > 1:
        emf = machine.k_e * x[OMEGA]
        least, most = _neutral(emf, low, high, form)
        for k in range(3):
            v[k] = 0.5 * (least + most) + emf * form[k]


@kept(error_model='numpy')
def _neutral(emf, low, high, form):  # type: ignore[no-untyped-def]
    """Range of the neutral's voltage in which no leg conducts, V; empty if one must."""
    least, most = -np.inf, np.inf
    for k in range(3):
        least = max(least, low[k] - emf * form[k])
        most = min(most, high[k] - emf * form[k])
    return least, most


@kept(error_model='numpy')
def _flows(machine, x, low, high, form, flow, v, out):  # type: ignore[no-untyped-def]
    """Fill `flow` (3,) with the direction of each current over the next step; 0: held at zero."""
    still = 0
    for k in range(3):
        flow[k] = 1.0 if low[k] == high[k] else np.sign(x[k])
        still += flow[k] == 0.0
    if still == 0:
        return
    if still > 1:
        emf = machine.k_e * x[OMEGA]
        least, most = _neutral(emf, low, high, form)
        if least <= most:
            for k in range(3):
                flow[k] = 0.0
            return
        for k in range(3):
            if low[k] - emf * form[k] == least:
                flow[k] = 1.0
            elif high[k] - emf * form[k] == most:
                flow[k] = -1.0
    for k in range(3):
        if flow[k] == 0.0:
            terminals(machine, x, low, high, flow, form, v, out)
            flow[k] = 1.0 if v[k] < low[k] else -1.0 if v[k] > high[k] else 0.0


@kept(error_model='numpy')
def _load(machine, x, t):  # type: ignore[no-untyped-def]
    """Torque on the shaft that neither currents nor dry friction make, N m."""
    omega = x[OMEGA]
    torque = -machine.b * omega - machine.drag * omega * abs(omega) - machine.tau_l
    if machine.cogging != 0.0:
        torque += machine.cogging * math.sin(machine.order * x[THETA] + machine.cogging_angle)
    if machine.swing != 0.0:
        torque -= machine.swing * math.sin(machine.swing_rate * t + machine.swing_angle)
    if t >= machine.step_time:
        torque -= machine.step_torque
    return torque - _wound(machine, x)


@kept(error_model='numpy')
def _wound(machine, x):  # type: ignore[no-untyped-def]
    """Torque of the shaft on the load behind it, N m."""
    if machine.J_load == 0.0:
        return 0.0
    return machine.spring * x[TWIST] + machine.damper * (x[OMEGA] - x[OMEGA_L])


@kept(error_model='numpy')
def _dry(machine, speed, torque):  # type: ignore[no-untyped-def]
    """Size of dry friction under a torque of the currents, N m."""
    rise = machine.tau_s * math.exp(-((speed / machine.omega_s) ** 2))
    return machine.tau_c + rise + machine.mu * abs(torque)


@kept(error_model='numpy')
def _sticks(machine):  # type: ignore[no-untyped-def]
    """Whether there is dry friction."""
    return machine.tau_c + machine.tau_s + machine.mu > 0.0


@kept(error_model='numpy')
def _moving(machine, x, torque, t):  # type: ignore[no-untyped-def]
    """Direction of motion over the next step; 0 where dry friction holds."""
    if not _sticks(machine):
        return 1.0
    if x[OMEGA] != 0.0:
        return np.sign(x[OMEGA])
    net = torque + _load(machine, x, t)
    return np.sign(net) if abs(net) > _dry(machine, 0.0, torque) else 0.0


@kept(error_model='numpy')
def _rates(machine, x, low, high, flow, way, t, work, out):  # type: ignore[no-untyped-def]
    """Fill `out` (8,) with the time derivatives; ``work[:3, 1]`` are the terminal voltages."""
    form, v = work[0, :3], work[1, :3]
    shapes(machine, x[THETA], form)
    terminals(machine, x, low, high, flow, form, v, out)
    driven = slopes(machine, x, v, form, out)
    for k in range(3):
        if flow[k] == 0.0:
            out[k] = 0.0
    out[OMEGA] = 0.0
    if way != 0.0:
        inertia = machine.J + (machine.step_inertia if t >= machine.step_time else 0.0)
        torque = driven + _load(machine, x, t) - way * _dry(machine, x[OMEGA], driven)
        out[OMEGA] = torque / inertia
    out[THETA] = x[OMEGA] if way != 0.0 else 0.0
    resistance = machine.R * (1.0 + machine.heat * x[HEAT])
    loss = resistance * (x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    out[HEAT] = loss - x[HEAT] / machine.t_th
    out[OMEGA_L] = out[TWIST] = 0.0
    if machine.J_load > 0.0:
        out[OMEGA_L] = _wound(machine, x) / machine.J_load
        out[TWIST] = x[OMEGA] - x[OMEGA_L]


@kept(error_model='numpy')
def _step(machine, x, low, high, flow, way, t, h, work, new):  # type: ignore[no-untyped-def]
    """One classical Runge-Kutta step from `x` to `new`."""
    k, at = work[2], work[3]
    for j in range(STATES):
        new[j] = at[j] = x[j]
    for stage in range(4):
        now = t + h * (0.0 if stage == 0 else 1.0 if stage == 3 else 0.5)
        _rates(machine, at, low, high, flow, way, now, work, k)
        share = h / 6.0 if stage == 0 or stage == 3 else h / 3.0
        reach = h if stage == 2 else 0.5 * h
        for j in range(STATES):  # loops: an array expression takes numba a second to compile
            new[j] += share * k[j]
            at[j] = x[j] + reach * k[j]


@kept(error_model='numpy')
def advance(machine, x, low, high, t, h, work):  # type: ignore[no-untyped-def]
    """Advance the state by one step, cut wherever a current or the speed passes through zero.

    Parameters
    ----------
    x:
        (8,) state, changed in place.
    low, high:
        (3,) terminal voltages with current into the machine and out of it, V.
    work:
        (6, 8) scratch; ``work[1, :3]`` are the terminal voltages at the end, ``work[1, 3:]`` gets
        their mean over the step.
    """
    left = h
    new, flow, form, v = work[4], work[5, :3], work[0, :3], work[1, :3]
    mean, before = work[1, 3:], work[5, 3:]
    for k in range(3):
        mean[k] = 0.0
    for _ in range(_CUTS):
        shapes(machine, x[THETA], form)
        _flows(machine, x, low, high, form, flow, v, work[2])
        terminals(machine, x, low, high, flow, form, v, work[2])
        way = _moving(machine, x, slopes(machine, x, v, form, work[2]), t)
        for k in range(3):
            before[k] = v[k]
        _step(machine, x, low, high, flow, way, t, left, work, new)
        part, first = 1.0, -1
        for k in range(4):
            sign = way if k == OMEGA else 0.0 if low[k] == high[k] else flow[k]
            dry = k < OMEGA or _sticks(machine)
            if dry and new[k] * sign < 0.0 and x[k] * sign > 0.0:
                share = x[k] / (x[k] - new[k])
                if share < part:
                    part, first = share, k
        if first < 0:
            break
        _step(machine, x, low, high, flow, way, t, part * left, work, new)
        for k in range(3):
            mean[k] += 0.5 * (before[k] + v[k]) * part * left / h
        _take(x, new)
        _stop(x, first)
        t += part * left
        left *= 1.0 - part
    for k in range(3):
        mean[k] += 0.5 * (before[k] + v[k]) * left / h
    _take(x, new)


@kept(error_model='numpy')
def _take(x, new):  # type: ignore[no-untyped-def]
    for j in range(STATES):
        x[j] = new[j]


@kept(error_model='numpy')
def _stop(x, which):  # type: ignore[no-untyped-def]
    """Set one current, or the speed, to zero; the currents keep their sum of zero."""
    x[which] = 0.0
    if which < OMEGA:
        one, two = (which + 1) % 3, (which + 2) % 3
        rest = 0.5 * (x[one] - x[two]) if x[one] != 0.0 and x[two] != 0.0 else 0.0
        x[one], x[two] = rest, -rest


@kept(error_model='numpy')
def span(machine, x, low, high, t, h, steps, work, shown):  # type: ignore[no-untyped-def]
    """Advance by `steps` steps of `h` s; `shown` (3,) gets the mean terminal voltages."""
    for k in range(3):
        shown[k] = 0.0
    for j in range(steps):
        advance(machine, x, low, high, t + j * h, h, work)
        for k in range(3):
            shown[k] += work[1, 3 + k] / steps
