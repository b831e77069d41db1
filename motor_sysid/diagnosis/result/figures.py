"""Numbers as people write them, with a unit and its prefix."""

import math

_PREFIXES = ((1e6, 'M'), (1e3, 'k'), (1.0, ''), (1e-3, 'm'), (1e-6, 'µ'), (1e-9, 'n'))
_NONE = ('1', 'rad', '%', '')
_WHOLE = ('kg', 'ohm', '1/')

DIGITS, MOST_DIGITS = 3, 6
"""Digits of a number; more only so that two of them differ."""


def apart(one: float, other: float) -> tuple[str, str]:
    """Return two numbers with so many digits that they differ: ``('14.85', '14.83')``."""
    for digits in range(DIGITS, MOST_DIGITS):
        texts = f'{one:.{digits}g}', f'{other:.{digits}g}'
        if texts[0] != texts[1]:
            return texts
    return f'{one:.{DIGITS}g}', f'{other:.{DIGITS}g}'


def _figures(value: float, digits: int) -> str:
    """Return a number to so many digits, without a power of ten where people would write none."""
    return f'{value:.0f}' if 10**digits <= abs(value) < 1e5 else f'{value:.{digits}g}'


def with_unit(value: float, unit: str, digits: int = 3) -> str:
    """Return a value with its unit, prefixed where that is usual: ``3.1 mN m``."""
    if unit in _NONE or unit.startswith(_WHOLE) or not math.isfinite(value) or value == 0:
        plain = _figures(value, digits)
        return plain if unit in ('1', '') else f'{plain} {unit}'
    size = abs(value)
    if 0.1 <= size < 1e4 or size < 1e-9:
        return f'{_figures(value, digits)} {unit}'
    factor, letter = next((f, p) for f, p in _PREFIXES if size >= 0.9995 * f or f == 1e-9)
    return f'{_figures(value / factor, digits)} {letter}{unit}'
