"""A script for MATLAB (Control System Toolbox) or GNU Octave (package control)."""

from motor_sysid.errors import UserError
from motor_sysid.export import words
from motor_sysid.export.linear import linear_plant
from motor_sysid.export.settings import Settings
from motor_sysid.physics.model import Model

TITLE = 'script with parameters and state space (MATLAB, GNU Octave)'
SUFFIX = '.m'
USES = ('name', 'rate')

_TAKEN = frozenset({
    'break', 'case', 'catch', 'classdef', 'continue', 'do', 'else', 'elseif', 'end',
    'end_try_catch', 'end_unwind_protect', 'endfor', 'endfunction', 'endif', 'endparfor',
    'endswitch', 'endwhile', 'for', 'function', 'global', 'if', 'otherwise', 'parfor',
    'persistent', 'return', 'spmd', 'switch', 'try', 'until', 'unwind_protect',
    'unwind_protect_cleanup', 'while', 'c2d', 'exist', 'ss',
})  # fmt: skip
"""Words of MATLAB and Octave, and the functions that the script calls."""


def write(model: Model, settings: Settings) -> tuple[str, tuple[str, ...]]:
    """Return the text, and what is left out.

    Raises
    ------
    UserError
        If MATLAB does not take the name.
    """
    if settings.name in _TAKEN:
        raise UserError(
            f'name `{settings.name}` is taken in MATLAB; take another, such as '
            f'`{settings.name}_motor`'
        )
    if settings.name.startswith('_'):
        raise UserError(f'name `{settings.name}`: in MATLAB a name begins with a letter')
    plant, name = linear_plant(model), settings.name
    lines = [f'% {line}' for line in words.heading(model)]
    lines += ['% dx/dt = A x + B u, y = C x + D u', ' '.join(['% states:', *_names(plant.states)])]
    for p in model.parameters:
        told = words.with_sigma(p.value, p.sigma or 0.0, p.unit)
        value = words.number(p.value)
        lines.append(f'{name}.{words.symbol(p.name)} = {value};  % {told}: {p.description}')
    for letter in 'abcd':
        matrix = getattr(plant, letter).tolist()
        lines.append(f'{name}.{letter.upper()} = {words.rows(matrix, "[", "; ", "];")}')
    lines.append(f'{name}.sys = ss({name}.A, {name}.B, {name}.C, {name}.D);')
    named = {'InputName': plant.inputs, 'OutputName': plant.outputs, 'StateName': plant.states}
    lines += [f'{name}.sys.{what} = {_cell([n for n, _ in of])};' for what, of in named.items()]
    if plant.delay:
        lines += [
            f'{name}.input_delay = {words.number(plant.delay)};  % s; Octave knows no delays',
            f"if ~exist('OCTAVE_VERSION'), {name}.sys.InputDelay = {name}.input_delay; end",
        ]
    if settings.rate:
        lines.append(f'{name}.sysd = c2d({name}.sys, {words.number(1.0 / settings.rate)});')
    lines += [f'% {line}' for line in words.left_out(plant.left_out)]
    return '\n'.join(lines) + '\n', plant.left_out


def _names(pairs: tuple[tuple[str, str], ...]) -> list[str]:
    return [f'{name} [{unit}]' if unit else name for name, unit in pairs]


def _cell(names: list[str]) -> str:
    return '{' + ', '.join(f"'{name}'" for name in names) + '}'
