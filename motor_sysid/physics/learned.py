"""Parameters of learned laws: values at knots, or amplitudes of waves, and where they hold."""

from motor_sysid.physics.effect import Amplitude, Scale, Shape
from motor_sysid.physics.laws import KNOTS

WAVES = 8
"""Waves per turn of a learned law over the position, at most."""

HELD = 1e9
"""Distance over which a law fades that is held beyond its range."""


def values(unit: str, scale: Scale) -> tuple[Amplitude, ...]:
    """Return the values of a table, from the most negative knot to the most positive one."""
    last = len(KNOTS) - 1
    names = [f'm_{k}' for k in range(last, 0, -1)] + [f'p_{k}' for k in range(last + 1)]
    places = [-x for x in KNOTS[:0:-1]] + list(KNOTS)
    return tuple(
        Amplitude(name, unit, f'value at {100 * place:g} % of the range', scale)
        for name, place in zip(names, places, strict=True)
    )


def waves(unit: str, scale: Scale) -> tuple[Amplitude, ...]:
    """Return the amplitudes of waves over one turn: cosines, then sines."""
    return tuple(
        Amplitude(f'{letter}_{n}', unit, f'{kind} of {n} per turn', scale)
        for letter, kind in (('a', 'cosine'), ('b', 'sine'))
        for n in range(1, WAVES + 1)
    )


def limits(unit: str, scale: Scale) -> tuple[Shape, ...]:
    """Return the range in which a table was learned, and how it ends beyond."""
    return (
        Shape('back', unit, 'how far below zero it was seen', scale, (1.0,), 1e-6, 1e3, False),
        Shape('ahead', unit, 'how far above zero it was seen', scale, (1.0,), 1e-6, 1e3, False),
        Shape(
            'fade', unit, 'distance beyond the range over which it falls to zero', Scale.ONE,
            (HELD,), 1e-12, 1e12, False,
        ),
    )  # fmt: skip
