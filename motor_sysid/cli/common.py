"""What the verbs share: arguments, effects and progress."""

import argparse
from collections.abc import Callable, Sequence
import math
from pathlib import Path
import sys

from motor_sysid.cli.output import json_target
from motor_sysid.errors import UserError

HOLD_BACK = 0.2
"""Part of a recording that is held back."""


def number(
    option: str, least: float, most: float = math.inf, *, closed: bool = False
) -> Callable[[str], float]:
    """Return the type of an option that takes a number.

    Parameters
    ----------
    option:
        Its name, for messages.
    least, most:
        The number lies between them, and may be `least` if `closed`.
    """
    span = f'from {least:g} on' if closed else f'above {least:g}'
    span += f' and below {most:g}' if most < math.inf else ''

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if least < value < most or (closed and value == least):
            return value
        raise UserError(f'{option} {text} is no number {span}')

    return read


def whole(option: str, least: int, most: int | None = None) -> Callable[[str], int]:
    """Return the type of an option that takes a whole number from `least` on, up to `most`."""
    span = f'from {least} on' if most is None else f'from {least} to {most}'

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if least <= value and (most is None or value <= most):
            return value
        raise UserError(f'{option} {text} is no whole number {span}')

    return read


def add_data_arguments(parser: argparse.ArgumentParser, *, validate: bool = False) -> None:
    """Declare DATA, and how to read it."""
    parser.add_argument(
        'data', nargs='+', type=Path, metavar='DATA',
        help='bag folder, .mcap, .db3, CSV, CSV.GZ, .mat or .npz; several are used together',
    )  # fmt: skip
    add_reading_arguments(parser)
    if validate:
        parser.add_argument(
            '--validate', nargs='+', action='extend', default=[], type=Path, metavar='DATA',
            help='recordings to judge on; default: the last part of each DATA is held back',
        )  # fmt: skip
        add_hold_back(parser, 'part of each DATA that is held back without --validate')


def add_hold_back(
    parser: argparse.ArgumentParser, meaning: str, default: float | None = HOLD_BACK
) -> None:
    """Declare --hold-back; with None as default `HOLD_BACK` is up to the verb."""
    parser.add_argument(
        '--hold-back', type=number('--hold-back', 0, 1), default=default, metavar='FRACTION',
        help=f'{meaning} (default: {HOLD_BACK:g})',
    )  # fmt: skip


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how to read data."""
    parser.add_argument(
        '--msg-config', metavar='FILE',
        help='which topic or column carries which signal; a file, or the name of one that ships '
        'with the package (emps, ...); default: topics of this package, or headers with units',
    )  # fmt: skip
    add_json_argument(parser)


def add_json_argument(parser: argparse.ArgumentParser) -> None:
    """Declare --json."""
    parser.add_argument(
        '--json', type=json_target, metavar='FILE',
        help='also write the result as JSON; `-`: to stdout, and all text to stderr',
    )  # fmt: skip


def add_effect_file_argument(parser: argparse.ArgumentParser) -> None:
    """Declare --effect-file."""
    parser.add_argument(
        '--effect-file', action='append', default=[], type=Path, metavar='FILE',
        help='a file with an effect of your own (docs/effects.md); may be given several times',
    )  # fmt: skip


def load_effect_files(paths: Sequence[Path], asked: Sequence[str] = ()) -> None:
    """Add the user's own effects to the catalogue.

    Raises
    ------
    UserError
        If a file is no effect, or there is no effect of a key that is asked for.
    """
    from motor_sysid.physics.effects import add_effect_file, effect

    for path in paths:
        add_effect_file(path)
    for key in asked:
        effect(key)


def progress() -> Callable[[str], None]:
    """Return a function that tells the user what is going on."""

    def tell(text: str) -> None:
        print(f'  {text} ...', file=sys.stderr, flush=True)

    return tell
