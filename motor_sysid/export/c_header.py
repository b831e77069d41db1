"""A header for C and C++: parameters as macros and, with a rate, one step of the linear motor."""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.export import feedforward, words
from motor_sysid.export.linear import linear_plant
from motor_sysid.export.settings import Settings
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

TITLE = 'header with parameters and feedforward; with a rate, matrices of one step (C, C++)'
SUFFIX = '.h'
USES = ('name', 'gear', 'top_speed', 'rate')


def write(model: Model, settings: Settings) -> tuple[str, tuple[str, ...]]:
    """Return the text, and what is left out."""
    prefix = settings.name.upper()
    lines = ['/*', *(f' * {line}' for line in words.heading(model)), ' */']
    lines += [f'#ifndef {prefix}_H', f'#define {prefix}_H', '']
    for p in model.parameters:
        told = words.with_sigma(p.value, p.sigma or 0.0, p.unit)
        lines.append(
            f'#define {prefix}_{words.symbol(p.name).upper()} {words.number(p.value)}'
            f'  /* {told}: {p.description} */'
        )
    found, notes = _feedforward(model, settings)
    lines += ['', *(f'/* {line} */' for line in feedforward.LAW)] if found else []
    lines += [f'#define {prefix}_FF_{n.upper()} {words.number(v)}' for n, v in found.items()]
    lines += [f'/* {line} */' for line in words.left_out(notes)]
    if settings.rate:
        plant = linear_plant(model)
        names = ', '.join(name for name, _ in plant.states)
        lines += ['', f'/* x[k+1] = AD x[k] + BD u[k];  x = {names} */']
        if plant.delay:
            lines.append(f'/* u[k] acts {words.number(plant.delay)} s after it was commanded */')
        lines += _step(plant.held(1.0 / settings.rate), prefix, settings.rate)
        lines += [f'/* {line} */' for line in words.left_out(plant.left_out)]
        notes = tuple(dict.fromkeys((*notes, *plant.left_out)))
    return '\n'.join([*lines, '', f'#endif /* {prefix}_H */']) + '\n', notes


def _feedforward(model: Model, settings: Settings) -> tuple[dict[str, float], tuple[str, ...]]:
    """Return the coefficients of a feedforward, none for a motor that nothing drives."""
    try:
        found = feedforward.figures(model, settings)
        return found, feedforward.left_out(model, settings, found)
    except UserError as problem:
        return {}, (f'feedforward: {problem}',)


def _step(held: tuple[Array, Array], prefix: str, rate: float) -> list[str]:
    """Return lines with the matrices of one step."""
    lines = [f'#define {prefix}_DT {words.number(1.0 / rate)}  /* s */']
    for name, matrix in zip(('AD', 'BD'), held, strict=True):
        n, m = matrix.shape
        body = words.rows(matrix.tolist(), '{\n    {', '},\n    {', '}\n}')
        lines.append(f'static const double {prefix}_{name}[{n}][{m}] = {body};')
    return lines
