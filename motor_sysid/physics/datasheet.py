"""A data sheet: nominal values of a motor, as manufacturers print them, in a YAML file.

Everything in it is optional::

    motor_type: brushed_dc
    nominal: {resistance_ohm: 2.5, inductance_H: 0.0026, torque_constant_Nm_per_A: 0.046}
    encoder_counts_per_rev: 2000
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
import difflib
import math
from pathlib import Path

from motor_sysid.errors import UserError
from motor_sysid.physics.motors import motor, motors
from motor_sysid.physics.motors.base import Motor
from motor_sysid.yaml_text import load_yaml, read_utf8

_RATED = 'rated_torque'
_SYMBOLS = {
    'resistance_ohm': 'R',
    'inductance_H': 'L',
    'torque_constant_Nm_per_A': 'k_t',
    'inertia_total_kgm2': 'J',
    'viscous_friction_Nms': 'b',
    'mass_total_kg': 'J',
    'viscous_friction_Ns_per_m': 'b',
    'rated_torque_Nm': _RATED,
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
_PRINTED = {
    'back_emf_constant_Vs_per_rad', 'torque_constant_Nm_per_A_peak', 'rated_voltage_V',
    'rated_current_A', 'rated_current_A_peak', 'dc_link_V',
}  # fmt: skip
"""What sheets say beside that; no model needs it."""
_QUANTITIES = (
    'resistance', 'inductance', 'torque_constant', 'inertia', 'viscous_friction', 'pole_pairs',
    'phase_resistance', 'phase_inductance', 'magnet_flux_linkage', 'rated_torque',
)  # fmt: skip
"""How the names of entries begin that are meant for a model."""
_CLOSE = 0.8
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
    unread:
        Entries under `nominal` that are not understood, or that the motor kind has no place for.
    """

    motor: str | None
    nominal: Mapping[str, float]
    unread: tuple[str, ...] = ()

    @property
    def k_e(self) -> float | None:
        """Back-EMF constant in V s/rad, in SI the torque constant; None if unknown."""
        return self.nominal.get('k_t')

    def suits(self, kind: Motor) -> bool:
        """Whether it may be of a motor of a kind; an axis takes inertia and friction of any."""
        if self.motor is None or 'R' not in {p.name for p in kind.parameters}:
            return True
        return kind.key in (self.motor, motor(self.motor).unmeasured)


def load_datasheet(path: str | Path, wanted: str | None = None) -> Datasheet:
    """Read a data sheet.

    Parameters
    ----------
    path:
        The file.
    wanted:
        Motor kind that the values are for; by default that of the sheet.  Some kinds have those
        of a phase, others those between two terminals.

    Raises
    ------
    UserError
        If the file cannot be read, is not YAML, says nothing that is understood, has an entry
        twice or one that seems to mean another, or a value is no positive number.
    """
    try:
        content = load_yaml(read_utf8(Path(path)))
    except UserError as problem:
        raise UserError(f'cannot read data sheet {path}: {problem}') from problem
    if not isinstance(content, dict):
        raise UserError(f'data sheet {path} is not a mapping; see docs/models.md')
    kind = content.get('motor_type')
    meant = wanted or kind
    given = content.get('nominal') or {}
    if not isinstance(given, dict):
        raise UserError(f'data sheet {path}: `nominal` is not a mapping of names to numbers')
    _refuse_misspelt(path, content, given)
    _refuse_twice(path, given)
    nominal = {
        _SYMBOLS[name]: _positive(path, name, value) * _per_model(name, meant)
        for name, value in given.items()
        if name in _SYMBOLS
    }
    if kind is not None and not (isinstance(kind, str) and kind in motors()):
        raise UserError(
            f'data sheet {path}: motor_type `{kind}` is not known; known are {", ".join(motors())}'
        )
    if _whole(meant) and 'k_e' in nominal:
        nominal.setdefault('k_t', nominal['k_e'])
    if not (set(content) & _KNOWN or nominal):
        raise UserError(
            f'data sheet {path} says nothing that is understood ({", ".join(map(str, content))}); '
            f'it may have {", ".join(sorted(_KNOWN))}, and under `nominal` '
            f'{", ".join(_SYMBOLS)}'
        )
    if 'supply_voltage_V' in content:
        nominal['v_free'] = _positive(path, 'supply_voltage_V', content['supply_voltage_V'])
    if 'encoder_counts_per_rev' in content:  # for people; no model needs it
        _positive(path, 'encoder_counts_per_rev', content['encoder_counts_per_rev'])
    known = _PRINTED | {name for name in _SYMBOLS if _has_place(meant, _SYMBOLS[name])}
    unread = tuple(str(name) for name in given if name not in known)
    return Datasheet(kind, {**_for_axes(meant, nominal), **nominal}, unread)


def _has_place(kind: object, symbol: str) -> bool:
    """Whether a motor kind, or one that takes its place, has a parameter; an axis asks for few."""
    if not isinstance(kind, str) or kind not in motors() or symbol == _RATED:
        return True
    kinds = [kind, motor(kind).unmeasured, motor(kind).blurred]
    names = {p.name for one in kinds if one for p in motor(one).parameters}
    filled = symbol == 'k_e' and _whole(kind)  # stands in for the torque constant
    return symbol in names or filled or 'R' not in names


def _for_axes(kind: object, nominal: Mapping[str, float]) -> dict[str, float]:
    """Return what a motor with two axes has by other names: inductances and flux."""
    if kind != 'pmsm':
        return {}
    found = {f'L_{axis}': nominal['L'] for axis in 'dq' if 'L' in nominal}
    if {'k_t', 'pole_pairs'} <= set(nominal):
        found['psi_f'] = nominal['k_t'] / (1.5 * nominal['pole_pairs'])
    return found


def _refuse_misspelt(
    path: str | Path, content: Mapping[str, object], given: Mapping[str, object]
) -> None:
    """Refuse entries that seem to mean another one; any other is for people."""
    for name in map(str, content):
        if meant := _close(name, {*_KNOWN, 'nominal'}):
            raise UserError(
                f'data sheet {path}: unknown entry `{name}`; did you mean `{meant}`?'
            )
        if meant := name if name in _SYMBOLS else _close(name, _SYMBOLS):
            raise UserError(
                f'data sheet {path}: unknown entry `{name}`; did you mean `{meant}` under '
                '`nominal`?'
            )
    for name in (str(name) for name in given if name not in _PRINTED | set(_SYMBOLS)):
        if meant := _close(name, _SYMBOLS) or _alike(name):
            raise UserError(
                f'data sheet {path}: unknown entry `{name}` under `nominal`; did you mean '
                f'`{meant}`? What is for people may stand beside `nominal`'
            )


def _refuse_twice(path: str | Path, given: Mapping[str, object]) -> None:
    """Refuse two entries for one parameter."""
    first: dict[str, str] = {}
    for name in (name for name in given if name in _SYMBOLS):
        other = first.setdefault(_SYMBOLS[name], name)
        if other != name:
            raise UserError(
                f'data sheet {path}: `{other}` and `{name}` both give `{_SYMBOLS[name]}`; leave '
                'one of them out'
            )


def _close(name: str, known: Iterable[str]) -> str:
    """Return the known entry that another name is a slip or the symbol of, or nothing."""
    entries = {entry.lower(): entry for entry in known}
    if name in entries.values():
        return ''
    symbol = [entry for entry in entries.values() if _SYMBOLS.get(entry) == name]
    close = difflib.get_close_matches(name.lower(), list(entries), 1, _CLOSE)
    return symbol[0] if symbol else entries[close[0]] if close else ''


def _alike(name: str) -> str:
    """Return the entry for the quantity that a name begins with, or nothing."""
    quantity = next((q for q in _QUANTITIES if name.lower().startswith(q)), None)
    return next((entry for entry in _SYMBOLS if quantity and entry.startswith(quantity)), '')


def _per_model(name: str, kind: object) -> float:
    """Return by what a value is multiplied for a kind with parameters between terminals or not."""
    if _BETWEEN_TERMINALS in name:
        return 1.0 if _whole(kind) else 0.5
    return 2.0 if _whole(kind) and name.startswith(_OF_A_PHASE) else 1.0


def _whole(kind: object) -> bool:
    """Whether a kind's parameters, torque constant and back-EMF are those between terminals."""
    return isinstance(kind, str) and kind in motors() and motors()[kind].terminals


def _positive(path: str | Path, name: str, value: object) -> float:
    """Return a number above 0; YAML reads ``1e-3`` (without a dot) as text."""
    try:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError
        number = float(value)
        if not 0 < number < math.inf:
            raise ValueError
    except (ValueError, OverflowError):
        raise UserError(
            f'data sheet {path}: `{name}` is {value!r}; it must be a finite number above 0'
        ) from None
    return number
