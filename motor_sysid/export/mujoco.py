"""A joint and its actuator for MuJoCo (MJCF), https://mujoco.readthedocs.io, XML reference.

The armature is inertia about the joint that no body has; damping and dry friction (`frictionloss`)
act on the joint.  The actuator commands what drives the motor: with a voltage its force is
``k_t / R (u - k_e omega)``, gain and velocity bias of an affine `general` actuator, behind the
gear.
"""

from motor_sysid.export import words
from motor_sysid.export.joint import joint, mass, notes_of, told
from motor_sysid.export.rigid import drive
from motor_sysid.export.settings import Settings
from motor_sysid.physics.model import Model

TITLE = 'joint and actuator of MuJoCo (MJCF)'
SUFFIX = '.xml'
USES = ('name', 'gear', 'supply', 'top_speed', 'body_inertia')


def write(model: Model, settings: Settings) -> tuple[str, tuple[str, ...]]:
    """Return the text, and what is left out."""
    body, driven, number = joint(model, settings), drive(model), words.number
    notes, figure = (*notes_of(body), *driven.left_out), told(model, settings)
    kind = 'slide' if model.linear else 'hinge'
    lines = [
        *words.heading(model),
        'The armature is all that turned with the motor when it was recorded, less '
        f'{settings.body_inertia:g} {mass(model)}',
        'of bodies that the simulation adds by itself (the option body-inertia).',
        f'<include file="{settings.name}.xml"/>, <joint class="{settings.name}" .../>,',
        f'<general class="{settings.name}" joint=.../>; control: {driven.signal} [{driven.unit}]',
        f'armature {figure["inertia"]}',
        f'damping {figure["damping"]}',
        f'frictionloss {figure["dry"]}',
        *words.left_out(notes),
    ]
    limit = settings.supply
    span = f' ctrllimited="true" ctrlrange="{-limit:g} {limit:g}"' if limit else ''
    lines = [
        *words.xml_comment(lines), '<mujoco>', '  <default>',
        f'    <default class="{settings.name}">',
        f'      <joint type="{kind}" armature="{number(body.inertia)}" '
        f'damping="{number(body.damping)}" frictionloss="{number(body.dry)}"/>',
        f'      <general gear="{settings.gear:g}" gainprm="{number(driven.torque)}" '
        f'biastype="affine" biasprm="0 0 {number(-driven.torque * driven.emf)}"{span}/>',
        '    </default>', '  </default>', '</mujoco>',
    ]  # fmt: skip
    return '\n'.join(lines) + '\n', notes
