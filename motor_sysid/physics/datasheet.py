"""A data sheet: nominal values of a motor, as manufacturers print them, in a YAML file.

Everything in it is optional::

    motor_type: brushed_dc
    nominal: {resistance_ohm: 2.5, inductance_H: 0.0026, torque_constant_Nm_per_A: 0.046}
    encoder_counts_per_rev: 2000
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import yaml

from motor_sysid.errors import UserError
from motor_sysid.physics.motors import motors

_SYMBOLS = {
    'resistance_ohm': 'R',
    'inductance_H': 'L',
    'torque_constant_Nm_per_A': 'k_t',
    'inertia_total_kgm2': 'J',
    'viscous_friction_Nms': 'b',
    'mass_total_kg': 'J',
    'viscous_friction_Ns_per_m': 'b',
    'rated_torque_Nm': 'rated_torque',
    'pole_pairs': 'pole_pairs',
    'phase_resistance_ohm': 'R',
    'phase_inductance_H': 'L',
    'inductance_d_H': 'L_d',
    'inductance_q_H': 'L_q',
    'magnet_flux_linkage_Vs': 'psi_f',
    'resistance_line_line_ohm': 'R',
    'inductance_line_line_H': 'L',
    'back_emf_constant_line_line_Vs_per_rad': 'k_e',
}
_KNOWN = {'motor_type', 'supply_voltage_V', 'encoder_counts_per_rev'}
_BETWEEN_TERMINALS = '_line_line_'
"""In the name of what is measured between two terminals: twice the value of a phase."""
_OF_A_PHASE = 'phase_'
"""What the name of a value of one phase begins with."""


@dataclass(frozen=True)
class Datasheet:
    """Nominal values.

    Attributes
    ----------
    motor:
        Motor kind, or None.
    nominal:
        Parameter symbol to value in SI; and `rated_torque` in N m.
    """

    motor: str | None
    nominal: Mapping[str, float]


def load_datasheet(path: str | Path) -> Datasheet:
    """Read a data sheet.

    Raises
    ------
    UserError
        If the file cannot be read, is not YAML, says nothing that is understood, or a value is no
        positive number.
    """
    try:
        text = Path(path).read_text(encoding='utf-8')
        content = yaml.safe_load(text)
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as problem:
        raise UserError(f'cannot read data sheet {path}: {problem}') from problem
    if not isinstance(content, dict):
        raise UserError(f'data sheet {path} is not a mapping; see docs/models.md')
    kind = content.get('motor_type')
    given = content.get('nominal') or {}
    if not isinstance(given, dict):
        raise UserError(f'data sheet {path}: `nominal` is not a mapping of names to numbers')
    nominal = {
        _SYMBOLS[name]: _positive(path, name, value) * _per_model(name, kind)
        for name, value in given.items()
        if name in _SYMBOLS
    }
    if kind is not None and kind not in motors():
        raise UserError(
            f'data sheet {path}: motor_type `{kind}` is not known; known are {", ".join(motors())}'
        )
    if _whole(kind) and 'k_e' in nominal:
        nominal.setdefault('k_t', nominal['k_e'])
    if not (set(content) & _KNOWN or nominal):
        raise UserError(
            f'data sheet {path} says nothing that is understood ({", ".join(map(str, content))}); '
            f'it may have {", ".join(sorted(_KNOWN))}, and under `nominal` '
            f'{", ".join(_SYMBOLS)}'
        )
    if 'supply_voltage_V' in content:
        nominal['v_free'] = _positive(path, 'supply_voltage_V', content['supply_voltage_V'])
    return Datasheet(kind, nominal)


def _per_model(name: str, kind: object) -> float:
    """Return by what a value is multiplied for a kind with parameters between terminals or not."""
    if _BETWEEN_TERMINALS in name:
        return 1.0 if _whole(kind) else 0.5
    return 2.0 if _whole(kind) and name.startswith(_OF_A_PHASE) else 1.0


def _whole(kind: object) -> bool:
    """Whether a kind's parameters, torque constant and back-EMF are those between terminals."""
    return isinstance(kind, str) and kind in motors() and motors()[kind].terminals


def _positive(path: str | Path, name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        raise UserError(f'data sheet {path}: `{name}` is {value!r}; it must be a number above 0')
    return float(value)
