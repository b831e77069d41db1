"""What every format writes: numbers, where the model comes from, and how sure its numbers are."""

from collections.abc import Callable, Mapping, Sequence
import math
import re

from motor_sysid import __version__
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

_ROUNDING = 1e-9
"""Change of a figure, relative to it, that comes of rounding."""


def number(value: float) -> str:
    """Return a number in twelve digits, which is more than any fit knows, never as an integer."""
    text = f'{value:.12g}'
    return text if any(c in text for c in '.en') else f'{text}.0'


def symbol(name: str) -> str:
    """Return the name of a parameter as C and MATLAB take it: letters of ASCII, digits and `_`."""
    plain = re.sub(r'\W', '_', name, flags=re.ASCII)
    return plain if plain[0].isalpha() else f'p{plain}'


def heading(model: Model) -> list[str]:
    """Return lines that say what this is and where it comes from."""
    titles = ', '.join(effect(key).card.title for key in model.effects) or 'no effects'
    made = f'Written by motor_sysid {__version__} from a model'
    notes = '\n'.join(f'{name}: {note}' for name, note in model.provenance.items())
    return [f'{made} of a {model.kind.title}: {titles}', *notes.replace('*/', '* /').splitlines()]


def left_out(notes: tuple[str, ...]) -> list[str]:
    """Return lines that say what the format has no place for."""
    return ['Not in it:', *(f'  {note}' for note in notes)] if notes else []


def xml_comment(lines: Sequence[str]) -> list[str]:
    """Return lines as an XML comment, in which two hyphens must not follow each other."""
    told = [re.sub('-(?=-)', '- ', line) for line in lines]
    return ['<!--', *(f'  {line}' for line in told), '-->']


def rows(matrix: list[list[float]], begin: str, between: str, end: str) -> str:
    """Return the rows of a matrix as text."""
    lines = [', '.join(map(number, row)) for row in matrix]
    return begin + between.join(lines) + end


def spread(model: Model, figures: Callable[[Model], Mapping[str, float]]) -> dict[str, float]:
    """Return the standard deviations of figures that follow from a model.

    Each free parameter goes up and down by its own standard deviation, to the edge of its box at
    most, and the changes are added as squares: a model file knows no correlations.  A figure that
    hangs on a parameter of which the data told nothing has an infinite one.
    """
    total = dict.fromkeys(figures(model), 0.0)
    for p in model.parameters:
        if not p.free or not p.sigma:
            continue
        reach = p.sigma if math.isfinite(p.sigma) else 0.01 * (abs(p.value) or 1.0)
        ends = [min(max(p.value + s * reach, p.lower), p.upper) for s in (1.0, -1.0)]
        up, down = (figures(model.with_values({p.name: end})) for end in ends)
        for name in total:
            change = abs(up[name] - down[name])
            change = change if change > _ROUNDING * abs(up[name]) else 0.0
            if change and not math.isfinite(p.sigma):
                total[name] = math.inf
            elif change:
                total[name] += (change * p.sigma / (ends[0] - ends[1])) ** 2
    return {name: math.sqrt(value) for name, value in total.items()}


def with_sigma(value: float, sigma: float, unit: str) -> str:
    """Return a figure with its standard deviation for a comment."""
    if math.isinf(sigma):
        return f'{value:.4g} {unit}, of which the data tell nothing'
    return f'{value:.4g} ± {sigma:.2g} {unit}' if sigma else f'{value:.4g} {unit}'
