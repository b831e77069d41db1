"""Gains from a model: a speed loop with a wanted time constant."""

from dataclasses import dataclass
import math

import numpy as np

from motor_sysid.control.pid import PidGains
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.signals.channels import BY_NAME
from motor_sysid.signals.record import Record


@dataclass(frozen=True)
class SpeedPlant:
    """First-order reduction of a motor from its input to speed: gain / (1 + time_constant s).

    Attributes
    ----------
    gain:
        Speed per unit of input at rest, e.g. rad/s/V.
    time_constant:
        Mechanical time constant with the electrical states settled, s.
    neglected:
        Slowest time constant of the electrical states, s.
    """

    gain: float
    time_constant: float
    neglected: float = 0.0


def reduce_to_speed(model: Model) -> SpeedPlant:
    """Return the first-order reduction of a motor, its electrical transients neglected.

    The linear core ``dx/dt = A x + B u`` is reduced to the speed alone by settling every other
    state but the position: ``a = A_ww - A_we A_ee^-1 A_ew``, and the same for the input.

    Raises
    ------
    UserError
        If the motor has more than one input.
    """
    kind = model.kind
    values = {name: np.array([value]) for name, value in model.parameters.values().items()}
    a, b = (part[0] for part in kind.matrices(values)[:2])
    if b.shape[1] != 1:
        raise UserError(f'tuning needs a motor with one input; a {kind.title} has {b.shape[1]}')
    speed = kind.states.index('omega')
    fast = [j for j, name in enumerate(kind.states) if name not in ('omega', 'theta')]
    inner = a[np.ix_(fast, fast)]
    settled = np.linalg.solve(inner, np.column_stack([a[fast, speed], b[fast, 0]]))
    damping, drive = np.array([a[speed, speed], b[speed, 0]]) - a[speed, fast] @ settled
    slowest = max(-float(damping), 1e-9)
    rates = np.abs(np.linalg.eigvals(inner).real)
    neglected = 1.0 / float(np.min(rates)) if rates.size else 0.0
    return SpeedPlant(float(drive) / slowest, 1.0 / slowest, neglected)


def torque_constant(model: Model) -> float:
    """Return the torque in N m of one ampere of the current that drives.

    That is the armature current, the q current, or the current through the two phases of a
    six-step drive; a motor without currents has 1 (its input is torque, or stands for one).
    """
    kind, values = model.kind, model.parameters.values()
    angle = (math.pi / 3 - values.get('angle_offset', 0.0)) / values.get('pole_pairs', 1.0)
    flowing = {
        'current': 1.0, 'current_d': 0.0, 'current_q': 1.0, 'current_a': -1.0, 'current_b': 1.0,
        'current_c': 0.0, 'position': angle,
    }  # fmt: skip
    if not any(output.signal.startswith('current') for output in kind.outputs):
        return 1.0
    signals = {name: np.full(2, value) for name, value in flowing.items()}
    units = {name: BY_NAME[name].units[0] for name in flowing}
    return float(kind.drive_torque(values, Record(np.array([0.0, 1.0]), signals, units))[0])


def current_pi(inertia: float, torque: float, bandwidth: float, limit: float) -> PidGains:
    """Return PI gains of a speed loop that commands the driving current.

    The loop crosses over at `bandwidth`, and the integral sets in at a quarter of it: a phase
    margin of 76 degrees less what the current loop costs.

    Parameters
    ----------
    inertia:
        kg m^2.
    torque:
        Of one ampere, N m; see `torque_constant`.
    bandwidth:
        rad/s; well below that of the current loop.
    limit:
        Largest current, A.

    Raises
    ------
    UserError
        If one of them is not positive.
    """
    given = {'inertia': inertia, 'torque constant': torque, 'bandwidth': bandwidth}
    for name, value in given.items():
        if not value > 0:
            raise UserError(f'the {name} of a speed loop, {value:g}, must be positive')
    kp = inertia * bandwidth / torque
    return PidGains(kp, kp * bandwidth / 4, lower=-limit, upper=limit)


def speed_pi(model: Model, closed_loop_time: float, limit: float) -> PidGains:
    """Return PI gains that make the speed follow with one time constant.

    Internal model control: the zero of the controller cancels the pole of the plant
    (Skogestad, J. Process Control 13 (2003), doi:10.1016/S0959-1524(02)00062-8).

    Parameters
    ----------
    closed_loop_time:
        Wanted time constant in s; at least a few samples and the electrical time constant.
    limit:
        Largest input, V for a motor with voltage.
    """
    if closed_loop_time <= 0:
        raise UserError(f'closed-loop time constant {closed_loop_time:g} s must be positive')
    plant = reduce_to_speed(model)
    kp = plant.time_constant / (plant.gain * closed_loop_time)
    reset_time = min(plant.time_constant, 4 * closed_loop_time)
    return PidGains(kp, kp / reset_time, lower=-limit, upper=limit)
