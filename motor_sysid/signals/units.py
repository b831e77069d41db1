"""Units in and SI out: ``parse_unit('rpm')`` knows the factor and the SI unit it leads to."""

from collections.abc import Iterable
from dataclasses import dataclass
import difflib
import math
import re

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motor_sysid.errors import UserError

Array = NDArray[np.float64]

TURN = 2 * math.pi
COUNT = 'count'


@dataclass(frozen=True)
class Unit:
    """A unit and the way to SI: ``value_si = value * factor + offset``.

    Attributes
    ----------
    symbol:
        As written by the user, e.g. ``rpm``.
    si:
        The SI unit that values have after conversion, e.g. ``rad/s`` (``degC`` for temperatures,
        ``1`` for pure numbers, ``count`` for encoder counts, which still need counts per turn).
    """

    symbol: str
    si: str
    factor: float
    offset: float = 0.0

    def to_si(self, values: ArrayLike) -> Array:
        """Convert values (any shape) to SI."""
        array = np.asarray(values, dtype=np.float64)
        if self.factor == 1 and self.offset == 0:
            return array
        return np.asarray(array * self.factor + self.offset, dtype=np.float64)

    def from_si(self, values: ArrayLike) -> Array:
        """Convert SI values (any shape) to this unit."""
        array = np.asarray(values, dtype=np.float64)
        return np.asarray((array - self.offset) / self.factor, dtype=np.float64)


def _atoms() -> dict[str, tuple[float, dict[str, int]]]:
    table: dict[str, tuple[float, dict[str, int]]] = {}

    def add(names: str, factor: float, **dimension: int) -> None:
        for name in names.split():
            table[name] = (factor, dimension)

    add('V volt volts', 1.0, V=1)
    add('A amp amps ampere', 1.0, A=1)
    add('s sec second seconds', 1.0, s=1)
    add('min minute minutes', 60.0, s=1)
    add('h', 3600.0, s=1)
    add('Hz', 1.0, s=-1)
    add('rad radian radians', 1.0, rad=1)
    add('deg degree degrees °', math.pi / 180, rad=1)
    add('r rev revs turn turns cycle cycles revolution revolutions', TURN, rad=1)
    add('rpm rev_min', TURN / 60, rad=1, s=-1)
    add('rps', TURN, rad=1, s=-1)
    add('m metre metres meter meters', 1.0, m=1)
    add('in inch inches', 0.0254, m=1)
    add('ft feet', 0.3048, m=1)
    add('g', 1e-3, kg=1)
    add('N', 1.0, N=1)
    add('Nm', 1.0, N=1, m=1)
    add('ohm Ohm Ω', 1.0, V=1, A=-1)
    add('H', 1.0, V=1, s=1, A=-1)
    add('W', 1.0, V=1, A=1)
    add('count counts tick ticks cnt', 1.0, count=1)
    add('1 - none', 1.0)
    add('% percent', 0.01)
    return table


ATOMS = _atoms()
PREFIXES = {'k': 1e3, 'd': 1e-1, 'c': 1e-2, 'm': 1e-3, 'u': 1e-6, 'µ': 1e-6, 'μ': 1e-6, 'n': 1e-9}
TEMPERATURES = {
    'degC': (1.0, 0.0), '°C': (1.0, 0.0), 'C': (1.0, 0.0), 'celsius': (1.0, 0.0),
    'K': (1.0, -273.15), 'kelvin': (1.0, -273.15),
    'degF': (5 / 9, -160 / 9), '°F': (5 / 9, -160 / 9),
}  # fmt: skip
CASELESS = {
    word.lower(): word
    for word in (
        'V', 'A', 'N', 'Nm', 'Hz', 's', 'mV', 'mA',
        *(atom for atom in ATOMS if len(atom) > 2 and atom.isalpha()),
    )
}  # fmt: skip
TURNING = {'1/min', 'U/min', 'min-1', 'min^-1', 'min⁻¹'}
"""What data sheets write for rpm."""
ORDER = ('V', 'A', 'rad', 'count', 'kg', 'N', 'm', 's')


def parse_unit(text: str) -> Unit:
    """Return the unit written as `text`: ``rpm``, ``mA``, ``rad/s``, ``N m``, ``m/s^2`` ...

    Products are written with a blank, ``*``, ``.`` or ``·``, quotients with ``/`` (everything
    after the first ``/`` divides).  Case matters only where
    it tells two units apart.

    Raises
    ------
    UserError
        If the unit is not known; the message names what is.
    """
    symbol = text.strip()
    if found := _temperature(symbol) or _product('rpm' if symbol in TURNING else symbol):
        return Unit(symbol, *found)
    known = sorted({*ATOMS, *TEMPERATURES, 'mV', 'mA', 'ms', 'us', 'rad/s', 'deg/s', 'rev/s'})
    raise UserError(
        f'unit `{symbol}` is not known{did_you_mean(symbol, known)}; known are '
        'V mV A mA s ms us ns rad deg turns counts rad/s deg/s rpm turns/s m mm m/s N "N m" degC '
        '% and their products and quotients'
    )


def is_unit(text: str) -> bool:
    """Tell whether `parse_unit` knows a unit."""
    try:
        return bool(parse_unit(text))
    except UserError:
        return False


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return `` (did you mean `x`?)`` where a known word is close, else an empty text."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f' (did you mean `{close[0]}`?)' if close else ''


def _temperature(text: str) -> tuple[str, float, float] | None:
    if text not in TEMPERATURES:
        return None
    factor, offset = TEMPERATURES[text]
    return 'degC', factor, offset


def _product(text: str) -> tuple[str, float, float] | None:
    """SI unit, factor and offset (0) of a product of powers, or None."""
    factor, dimension = 1.0, dict.fromkeys(ORDER, 0)
    for i, part in enumerate(re.sub(r'\bper\b', '/', text).split('/')):
        sign = 1 if i == 0 else -1
        for word in re.split(r'[\s*.·]+', part.strip()) if part.strip() else ['1']:
            atom = _power(word)
            if atom is None:
                return None
            factor *= atom[0] ** sign
            for base, exponent in atom[1].items():
                dimension[base] += sign * exponent
    return _si_symbol(dimension), factor, 0.0


def _power(word: str) -> tuple[float, dict[str, int]] | None:
    """Factor and dimension of one word such as ``mA``, ``s^2`` or ``s²``."""
    match = re.fullmatch(r'(.+?)(?:\^?(-?[2-9])|([²³]))?', word)
    if match is None:
        return None
    power = int(match[2] or {'²': 2, '³': 3, None: 1}[match[3]])
    atom = _prefixed(match[1])
    if atom is None:
        return None
    return atom[0] ** power, {base: exponent * power for base, exponent in atom[1].items()}


def _prefixed(word: str) -> tuple[float, dict[str, int]] | None:
    word = word if word in ATOMS else CASELESS.get(word.lower(), word)
    if word in ATOMS:
        return ATOMS[word]
    scale, rest = PREFIXES.get(word[:1]), word[1:]
    if scale is None or rest not in ATOMS or rest in {'1', '-', '%', 'min', 'none', 'percent'}:
        return None
    factor, dimension = ATOMS[rest]
    return scale * factor, dimension


def _si_symbol(dimension: dict[str, int]) -> str:
    def side(sign: int) -> list[str]:
        powers = [(base, sign * dimension[base]) for base in ORDER if sign * dimension[base] > 0]
        return [base if power == 1 else f'{base}^{power}' for base, power in powers]

    above, below = side(1), side(-1)
    return '/'.join([' '.join(above) or '1', *below])
