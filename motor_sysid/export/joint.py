"""Inertia and friction on the side of the joint, as simulators of robots take them."""

from motor_sysid.errors import UserError
from motor_sysid.export import words
from motor_sysid.export.rigid import Rigid, rigid
from motor_sysid.export.settings import Settings
from motor_sysid.physics.model import Model


def joint(model: Model, settings: Settings) -> Rigid:
    """Return inertia and friction behind the gear, without what the simulator adds by itself.

    Raises
    ------
    UserError
        If the model knows voltages alone, or has less inertia than the simulator adds.
    """
    body, gear = rigid(model, settings.top_speed), settings.gear
    if body.unit == 'V':
        raise UserError(
            f'a {model.kind.title}, tells its friction in volts and no torque in N m; record the '
            'current, or export feedforward, which takes volts'
        )
    inertia = gear**2 * body.inertia - settings.body_inertia
    if inertia < 0:
        raise UserError(
            f'the bodies have {settings.body_inertia:g} kg m^2 about the joint, more than all '
            f'that turned with the motor, {gear**2 * body.inertia:.4g}: give the inertia of what '
            'was mounted when the data were recorded'
        )
    return Rigid(
        inertia, gear**2 * body.damping, gear * body.dry, gear * body.constant, body.misfit,
        body.unit, body.left_out,
    )  # fmt: skip


def figures(model: Model, settings: Settings) -> dict[str, float]:
    """Return inertia, damping and dry friction of the joint by name."""
    body = joint(model, settings)
    return {'inertia': body.inertia, 'damping': body.damping, 'dry': body.dry}


def notes_of(body: Rigid) -> tuple[str, ...]:
    """Return what a joint with viscous and dry friction leaves out."""
    if not body.constant:
        return body.left_out
    return (*body.left_out, f'a constant torque of {body.constant:.4g} {body.unit}')


def told(model: Model, settings: Settings) -> dict[str, str]:
    """Return the figures with standard deviation and unit, for a comment."""
    body, found = joint(model, settings), figures(model, settings)
    sigmas = words.spread(model, lambda m: figures(m, settings))
    speed = 'm/s' if model.linear else 'rad/s'
    units = {'inertia': mass(model), 'damping': f'{body.unit}/({speed})', 'dry': body.unit}
    return {name: words.with_sigma(found[name], sigmas[name], units[name]) for name in found}


def mass(model: Model) -> str:
    """Return the unit of an inertia."""
    return 'kg' if model.linear else 'kg m^2'
