"""Coefficients of a feedforward: the command that a wanted motion takes.

    u = k_s sign(v) + k_v v + k_a a + k_c + k_g_sin sin(position) + k_g_cos cos(position)

for speed v and acceleration a of the joint; the last two where the model has a gravity load.
Libraries of robot control call k_s, k_v and k_a by the same names; inertia, friction and back-EMF
are what they consist of.  (Ellis, Control System Design Guide, 4th ed. 2012, chapter 8.)
"""

from collections.abc import Mapping

import yaml

from motor_sysid.export import words
from motor_sysid.export.rigid import Drive, drive, rigid
from motor_sysid.export.settings import Settings
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import linear_unit, Model

TITLE = 'command that a wanted motion takes: k_s, k_v, k_a (YAML)'
SUFFIX = '.yaml'
USES = ('gear', 'top_speed')

GRAVITY = 'gravity_load'

LAW = (
    'command = k_s sign(v) + k_v v + k_a a + k_c + k_g_sin sin(position) + k_g_cos cos(position)',
    'v, a: speed and acceleration of the joint; no gravity without k_g',
)


def write(model: Model, settings: Settings) -> tuple[str, tuple[str, ...]]:
    """Return the text, and what is left out."""
    driven = drive(model)
    found = figures(model, settings)
    sigmas = words.spread(model, lambda m: figures(m, settings))
    content = {
        'command': f'{driven.signal} [{driven.unit}]',
        'gear': settings.gear,
        'coefficients': {
            name: {'value': value, 'unit': _unit(model, driven, name), 'sigma': sigmas[name]}
            for name, value in found.items()
        },
    }
    notes = left_out(model, settings, found)
    lines = [*words.heading(model), *LAW, *words.left_out(notes)]
    text = ''.join(f'# {line}'.rstrip() + '\n' for line in lines)
    return text + yaml.safe_dump(content, sort_keys=False, allow_unicode=True), notes


def left_out(
    model: Model, settings: Settings, found: Mapping[str, float]
) -> tuple[str, ...]:
    """Return what the coefficients that were found leave out."""
    own = effect(GRAVITY).card.title if 'k_g_sin' in found else None
    notes = rigid(model, settings.top_speed).left_out
    return (*(n for n in notes if own is None or not n.startswith(own)), *drive(model).left_out)


def figures(model: Model, settings: Settings) -> dict[str, float]:
    """Return the coefficients by name, per speed and acceleration of the joint."""
    body, driven, gear = rigid(model, settings.top_speed), drive(model), settings.gear
    found = {
        'k_s': body.dry / driven.torque,
        'k_v': gear * (driven.emf + body.damping / driven.torque),
        'k_a': gear * body.inertia / driven.torque,
        'k_c': -body.constant / driven.torque,
    }
    if GRAVITY in model.effects and gear == 1.0:
        found |= {
            f'k_g_{wave}': model[f'{GRAVITY}.tau_{wave}'] / driven.torque
            for wave in ('sin', 'cos')
        }
    return found


def _unit(model: Model, driven: Drive, name: str) -> str:
    per = {'k_v': ' s/rad', 'k_a': ' s^2/rad'}.get(name, '')
    return driven.unit + (linear_unit(per) if model.linear else per)
