"""Gains from a model: a speed loop with a wanted time constant."""

from dataclasses import dataclass

from motor_sysid.control.pid import PidGains
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model


@dataclass(frozen=True)
class SpeedPlant:
    """First-order reduction of a motor from voltage to speed: gain / (1 + time_constant s).

    Attributes
    ----------
    gain:
        Speed per volt at rest, rad/s/V.
    time_constant:
        Mechanical time constant with the armature short-circuited, s.
    """

    gain: float
    time_constant: float


def reduce_to_speed(model: Model) -> SpeedPlant:
    """Return the first-order reduction of a `brushed_dc` model, its inductance neglected.

    Raises
    ------
    UserError
        If the model is of another kind.
    """
    if model.motor != 'brushed_dc':
        raise UserError(f'tuning needs a brushed_dc model; this one is {model.motor}')
    r, k_t = model['R'], model['k_t']
    k_e = model['emf_ratio'] * k_t
    damping = r * model['b'] + k_t * k_e
    return SpeedPlant(k_t / damping, r * model['J'] / damping)


def speed_pi(model: Model, closed_loop_time: float, limit: float) -> PidGains:
    """Return PI gains that make the speed follow with one time constant.

    Internal model control: the zero of the controller cancels the pole of the plant
    (Skogestad, J. Process Control 13 (2003), doi:10.1016/S0959-1524(02)00062-8).

    Parameters
    ----------
    closed_loop_time:
        Wanted time constant in s; at least a few samples and the electrical time constant.
    limit:
        Largest voltage.
    """
    if closed_loop_time <= 0:
        raise UserError(f'closed-loop time constant {closed_loop_time:g} s must be positive')
    plant = reduce_to_speed(model)
    kp = plant.time_constant / (plant.gain * closed_loop_time)
    reset_time = min(plant.time_constant, 4 * closed_loop_time)
    return PidGains(kp, kp / reset_time, lower=-limit, upper=limit)
