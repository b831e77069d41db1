"""The dynamics of a joint for URDF, http://wiki.ros.org/urdf/XML/joint."""

from motor_sysid.errors import UserError
from motor_sysid.export import words
from motor_sysid.export.joint import joint, notes_of, told
from motor_sysid.export.rigid import drive
from motor_sysid.export.settings import Settings
from motor_sysid.physics.model import Model

TITLE = 'damping and friction of a joint (URDF)'
SUFFIX = '.xml'
USES = ('name', 'gear', 'supply', 'top_speed', 'body_inertia')


def write(model: Model, settings: Settings) -> tuple[str, tuple[str, ...]]:
    """Return the text, and what is left out."""
    body, number = joint(model, settings), words.number
    figure = told(model, settings)
    notes = (
        f'inertia of {figure["inertia"]} at the joint: URDF '
        'has no place for that of a rotor, nor for what drives it',
        *notes_of(body),
    )
    lines = [
        *words.heading(model),
        f'damping {figure["damping"]}',
        f'friction {figure["dry"]}',
        *words.left_out(notes),
    ]
    kind = 'prismatic' if model.linear else 'continuous'
    lines = [
        *words.xml_comment(lines),
        f'<joint name="{settings.name}" type="{kind}">',
        f'  <dynamics damping="{number(body.damping)}" friction="{number(body.dry)}"/>',
        *_limit(model, settings), '</joint>',
    ]  # fmt: skip
    return '\n'.join(lines) + '\n', notes


def _limit(model: Model, settings: Settings) -> list[str]:
    """Return what the supply allows: the torque at rest, and the speed without load.

    Raises
    ------
    UserError
        If it is a current or a torque, which limits no speed, and no top speed is known.
    """
    if settings.supply is None:
        return []
    driven, body, gear = drive(model), joint(model, settings), settings.gear
    effort = gear * driven.torque * settings.supply
    if driven.emf:
        slope = gear**2 * driven.torque * driven.emf + body.damping
        speed = max(effort - body.dry, 0.0) / slope
    elif settings.top_speed:
        speed = settings.top_speed / gear
    else:
        raise UserError(
            f'a supply of {settings.supply:g} {driven.unit} limits the torque and no speed; give '
            '--top-speed, or leave --supply out'
        )
    return [f'  <limit effort="{words.number(effort)}" velocity="{words.number(speed)}"/>']
