"""The dynamics of a joint for URDF, http://wiki.ros.org/urdf/XML/joint."""

from motor_sysid.export import words
from motor_sysid.export.joint import figures, joint, notes_of
from motor_sysid.export.rigid import drive
from motor_sysid.export.settings import Settings
from motor_sysid.physics.model import Model

TITLE = 'damping and friction of a joint (URDF)'
SUFFIX = '.xml'


def write(model: Model, settings: Settings) -> tuple[str, tuple[str, ...]]:
    """Return the text, and what is left out."""
    body, number = joint(model, settings), words.number
    sigmas = words.spread(model, lambda m: figures(m, settings))
    mass, speed = ('kg', 'm/s') if model.linear else ('kg m^2', 'rad/s')
    notes = (
        f'inertia of {words.with_sigma(body.inertia, sigmas["inertia"], mass)} at the joint: URDF '
        'has no place for that of a rotor, nor for what drives it',
        *notes_of(body),
    )
    told = [
        *words.heading(model),
        f'damping {words.with_sigma(body.damping, sigmas["damping"], f"{body.unit}/({speed})")}',
        f'friction {words.with_sigma(body.dry, sigmas["dry"], body.unit)}',
        *words.left_out(notes),
    ]
    kind = 'prismatic' if model.linear else 'continuous'
    lines = [
        *words.xml_comment(told),
        f'<joint name="{settings.name}" type="{kind}">',
        f'  <dynamics damping="{number(body.damping)}" friction="{number(body.dry)}"/>',
        *_limit(model, settings), '</joint>',
    ]  # fmt: skip
    return '\n'.join(lines) + '\n', notes


def _limit(model: Model, settings: Settings) -> list[str]:
    """Return what the supply allows: the torque at rest, and the speed without load."""
    if settings.supply is None:
        return []
    driven, body = drive(model), joint(model, settings)
    effort = settings.gear * driven.torque * settings.supply
    slope = settings.gear**2 * driven.torque * driven.emf + body.damping
    speed = max(effort - body.dry, 0.0) / slope
    return [f'  <limit effort="{words.number(effort)}" velocity="{words.number(speed)}"/>']
