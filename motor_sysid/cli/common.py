"""What the verbs share: data arguments, loading, progress and JSON output."""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import json
import math
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.signals.record import Record


FEWEST = 20
"""Samples that must be left to fit: fewer show no noise."""


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
        if text.strip().lstrip('+-').isdecimal():
            value = int(text)
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


def add_hold_back(parser: argparse.ArgumentParser, meaning: str) -> None:
    """Declare --hold-back."""
    parser.add_argument(
        '--hold-back', type=number('--hold-back', 0, 1), default=0.2, metavar='FRACTION',
        help=f'{meaning} (default: %(default)s)',
    )  # fmt: skip


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare how to read data."""
    parser.add_argument(
        '--msg-config', metavar='FILE',
        help='which topic or column carries which signal; a file, or the name of one that ships '
        'with the package (emps, ...); default: topics of this package, or headers with units',
    )  # fmt: skip
    parser.add_argument('--json', type=Path, metavar='FILE', help='also write the result as JSON')


def add_effect_file_argument(parser: argparse.ArgumentParser) -> None:
    """Declare --effect-file."""
    parser.add_argument(
        '--effect-file', action='append', default=[], type=Path, metavar='FILE',
        help='a file with an effect of your own (docs/effects.md); may be given several times',
    )  # fmt: skip


def load_data(paths: Sequence[Path], msg_config: str | None) -> 'list[Record]':
    """Read recordings; what had to be mended is told on stderr.

    Raises
    ------
    UserError
        If one cannot be read, or the data doctor finds an error (a wrong unit, no input ...) that
        would make every result wrong without a word.
    """
    from motor_sysid.recording import load
    from motor_sysid.signals.doctor import examine

    records: list[Record] = []
    for path in paths:
        loaded = load(path, msg_config)
        for finding in loaded.findings:
            if finding.severity != 'info':
                print(f'{path}: {finding.message}', file=sys.stderr)
        records.extend(loaded.records)
    errors = [f for f in examine(records) if f.severity == 'error'] if records else []
    if errors:
        problems = '\n'.join(f'  {error.message}\n    {error.remedy}' for error in errors)
        names = ', '.join(map(str, paths))
        raise UserError(f'{names} cannot be used (`motor-sysid check` tells more):\n{problems}')
    return records


def load_parts(args: argparse.Namespace) -> 'tuple[list[Record], list[Record]]':
    """Read what is to be fitted, and what to judge on: --validate, or else the end of the former.

    Raises
    ------
    UserError
        As `load_data`; and if hardly a sample would be left to fit or to judge on.
    """
    train = load_data(args.data, args.msg_config)
    held = load_data(args.validate, args.msg_config)
    longest = max(len(record) for record in train)
    kept = round((1 - args.hold_back) * longest)
    if not held and (kept < FEWEST or longest - kept < 2):
        raise UserError(
            f'--hold-back {args.hold_back:g} leaves {kept} samples to fit and {longest - kept} to '
            f'judge on, of the {longest} of the longest record; {FEWEST} and 2 are the fewest'
        )
    return train, held


def refuse_two_motors(args: argparse.Namespace) -> None:
    """Refuse a motor kind beside a model, which names one."""
    if args.model and args.motor:
        raise UserError('--model names the motor already; leave --motor out')


def load_effect_files(paths: Sequence[Path]) -> None:
    """Add the user's own effects to the catalogue."""
    from motor_sysid.physics.effects import add_effect_file

    for path in paths:
        add_effect_file(path)


def progress() -> Callable[[str], None]:
    """Return a function that tells the user what is going on."""

    def tell(text: str) -> None:
        print(f'  {text} ...', file=sys.stderr, flush=True)

    return tell


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say in words that a file or folder cannot be written."""
    try:
        yield
    except OSError as problem:
        raise UserError(f'cannot write {path}: {problem.strerror}') from problem


def write_text(text: str, path: Path, what: str) -> None:
    """Write a file, and say `what` lies where.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    with writing(path):
        path.write_text(text, encoding='utf-8')
    print(f'{what}: {path}')


def write_json(document: object, path: Path | None) -> None:
    """Write a result as JSON, if a file was asked for; see `write_text`."""
    if path is not None:
        write_text(json.dumps(document, indent=1) + '\n', path, 'result')
