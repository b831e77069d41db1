"""The catalogue of effects.  To add one: write its file and add its name to `_FILES`.

A user's own effects come from `add_effect_file` or from packages that declare an entry point in
the group ``motor_sysid.effects`` (its name is the key, its object the module).
"""

from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
import importlib.util
from pathlib import Path
import sys

from motor_sysid.errors import UserError
from motor_sysid.physics.effect import Effect
from motor_sysid.physics.effect_file import checked, load_effect
from motor_sysid.signals.units import did_you_mean

_FILES = (
    'coulomb_friction',
    'asymmetric_coulomb_friction',
    'stribeck_friction',
    'lugre_friction',
    'load_dependent_friction',
    'quadratic_drag',
    'iron_loss',
    'friction_drift',
    'constant_load_torque',
    'load_torque_step',
    'periodic_load',
    'gravity_load',
    'cogging_torque',
    'torque_ripple',
    'voltage_angle_lag',
    'torque_constant_saturation',
    'flexible_shaft',
    'backlash',
    'inertia_change',
    'input_delay',
    'supply_sag',
    'driver_clipping',
    'inverter_dead_time',
    'drive_coast',
    'rotor_angle_lag',
    'brush_voltage_drop',
    'armature_heating',
    'armature_inductance',
    'inductance_saturation',
    'emf_harmonics',
    'current_sensor_lag',
    'current_sensor_scale',
    'current_sensor_offset',
    'speed_sensor_lag',
    'speed_sensor_scale',
    'speed_sensor_offset',
)

LEARNED = (
    'learned_torque_speed',
    'learned_torque_current',
    'learned_torque_position',
    'learned_voltage_current',
    'learned_voltage_speed',
)
"""Laws without a shape of their own, which `motor-sysid learn` fills with data.  They are no part
of the catalogue: they would explain anything, so no diagnosis tries them."""

_GROUP = 'motor_sysid.effects'


@cache
def catalogue() -> dict[str, Effect]:
    """Return every known effect by key: built-in ones, then those of installed packages."""
    found = [load_effect(name, import_module(f'{__name__}.{name}')) for name in _FILES]
    outside = entry_points(group=_GROUP)
    found += [checked(load_effect(entry.name, entry.load())) for entry in outside]
    return {each.key: each for one in found for each in one.repeated()}


@cache
def _learned() -> dict[str, Effect]:
    return {name: load_effect(name, import_module(f'{__name__}.{name}')) for name in LEARNED}


def effect(key: str) -> Effect:
    """Return an effect of the catalogue, or a learned one.

    Raises
    ------
    UserError
        If there is none of that key.
    """
    if key in LEARNED:
        return _learned()[key]
    try:
        return catalogue()[key]
    except KeyError:
        meant = did_you_mean(key, [*catalogue(), *LEARNED])
        own = 'one of your own is read with `--effect-file`, or installed as an entry point'
        known = '' if meant else f'; known are {", ".join(catalogue())}; {own}'
        raise UserError(f'unknown effect `{key}`{meant}{known}') from None


def add_effect_file(path: Path) -> Effect:
    """Load a user's effect file and add it to the catalogue; its key is the file's stem.

    Raises
    ------
    UserError
        If the file cannot be read, is no effect, or bears the name of one of the catalogue.
    """
    if not path.is_file():
        raise UserError(f'no effect file {path}')
    if path.stem in (*_FILES, *LEARNED):
        raise UserError(f'{path}: `{path.stem}` is an effect of the catalogue; rename the file')
    name = f'motor_sysid_user_effect_{path.stem}'
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise UserError(f'effect file {path} is not a Python file')
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as problem:
        del sys.modules[name]
        reason = f'{type(problem).__name__}: {problem}'
        raise UserError(f'effect file {path} cannot be read: {reason}') from problem
    added = checked(load_effect(path.stem, module))
    catalogue().update({one.key: one for one in added.repeated()})
    return added
