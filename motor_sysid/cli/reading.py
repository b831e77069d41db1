"""What the verbs read: models, data sheets, and recordings, looked over as `check` does."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.physics.datasheet import Datasheet
    from motor_sysid.physics.model import Model
    from motor_sysid.signals.finding import Finding
    from motor_sysid.signals.record import Record


FEWEST = 20
"""Samples that must be left to fit: fewer show no noise."""

MODELS = ('.yaml', '.yml')
"""How the name of a model file ends."""

_NAMED = 3


@dataclass(frozen=True)
class Start:
    """What a fit starts from: --model, --motor and --nominal.

    Attributes
    ----------
    model:
        A model, or None.
    motor:
        Motor kind, or None: what the data allow.
    nominal:
        Data-sheet values: parameter name to value in SI.
    k_e:
        Back-EMF constant of the data sheet in V s/rad, if known.
    """

    model: 'Model | None'
    motor: str | None
    nominal: Mapping[str, float]
    k_e: float | None = None


def load_start(args: argparse.Namespace) -> Start:
    """Read what to start from.

    Raises
    ------
    UserError
        If a file cannot be read, or two of them name different motors.
    """
    from motor_sysid.physics.store import load_model

    refuse_two_motors(args)
    model = load_model(args.model) if args.model else None
    sheet = load_sheet(args.nominal, model.motor if model else args.motor)
    if sheet is None:
        return Start(model, args.motor, {})
    if model is not None and not sheet.suits(model.kind):
        raise UserError(
            f'{args.model} is a `{model.motor}`, the data sheet {args.nominal} is of a '
            f'`{sheet.motor}`; give the sheet of this motor'
        )
    return Start(model, args.motor or sheet.motor, sheet.nominal, sheet.k_e)


def load_sheet(path: Path | None, wanted: str | None = None) -> 'Datasheet | None':
    """Read a data sheet, if there is one, for a motor kind; what is not understood is told."""
    from motor_sysid.physics.datasheet import load_datasheet

    if path is None:
        return None
    sheet = load_datasheet(path, wanted)
    if sheet.unread:
        names = ', '.join(f'`{name}`' for name in sheet.unread)
        _note(f'the data sheet {path} has {names}, which nothing here makes use of')
    return sheet


def load_first_model(args: argparse.Namespace) -> 'Model':
    """Read MODEL, where DATA follow it.

    Raises
    ------
    UserError
        If it cannot be read, or stands in the place of DATA.
    """
    from motor_sysid.physics.store import load_model

    data_first = args.model.suffix.lower() not in MODELS
    if data_first and any(path.suffix.lower() in MODELS for path in args.data):
        raise UserError(f'{args.model} is no model; MODEL (YAML) comes first, then DATA')
    return load_model(args.model)


def load_data(
    paths: Sequence[Path], msg_config: str | None, k_e: float | None = None
) -> 'list[Record]':
    """Read recordings; what had to be mended, and what is doubtful, is told on stderr.

    A recording that is given twice counts once.

    Parameters
    ----------
    paths:
        The recordings.
    msg_config:
        How to read them.
    k_e:
        Back-EMF constant from the data sheet in V s/rad, if known.

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
    records = _once(records)
    findings = examine(records, k_e) if records else ()
    errors = [f for f in findings if f.severity == 'error']
    if errors:
        raise UserError(_refusal(records, errors, k_e))
    _warn(paths, [f for f in findings if f.severity == 'warning'])
    return records


def _refusal(
    records: 'Sequence[Record]', errors: 'Sequence[Finding]', k_e: float | None
) -> str:
    """Say which recordings cannot be used, and why; all of them where none is at fault alone."""
    from motor_sysid.signals.doctor import examine

    own = {record.provenance.source: examine([record], k_e) for record in records}
    alone = {name: [f for f in all_of if f.severity == 'error'] for name, all_of in own.items()}
    faulty = {name: found for name, found in alone.items() if found}
    if len(own) == 1 or not faulty:
        faulty = {', '.join(own): list(errors)}
    lines = []
    for name, found in faulty.items():
        lines.append(f'{name} cannot be used (`motor-sysid check` tells more):')
        lines += [f'  {error.message}\n    {error.remedy}' for error in found]
    return '\n'.join(lines)


def _warn(paths: Sequence[Path], warnings: 'Sequence[Finding]') -> None:
    """Say what is doubtful, one line for each kind of trouble."""
    first = {finding.code: finding for finding in reversed(warnings)}
    names = ', '.join(map(str, paths[:_NAMED]))
    names += f' and {len(paths) - _NAMED} more' if len(paths) > _NAMED else ''
    for finding in reversed(first.values()):
        print(f'{names}: {finding.message}', file=sys.stderr)
    if first:
        _note('`motor-sysid check` tells what follows from that, and what to do')


def _once(records: 'Sequence[Record]') -> 'list[Record]':
    """Return each record once: one that counts twice makes standard errors too small."""
    kept: dict[str, Record] = {}
    for record in records:
        first = kept.setdefault(record.digest(), record)
        if first is not record:
            _note(f'{record.provenance.source} repeats {first.provenance.source}; it counts once')
    return list(kept.values())


def load_parts(
    args: argparse.Namespace, k_e: float | None = None
) -> 'tuple[list[Record], list[Record]]':
    """Read DATA and what to judge on: --validate, or else the end of the former.

    Raises
    ------
    UserError
        As `load_both`; and if hardly a sample would be left to fit or to judge on.
    """
    train, held = load_both(args.data, args.validate, args.msg_config, k_e)
    longest = max(len(record) for record in train)
    kept = round((1 - args.hold_back) * longest)
    if not held and (kept < FEWEST or longest - kept < 2):
        raise UserError(
            f'--hold-back {args.hold_back:g} leaves {kept} samples to fit and {longest - kept} to '
            f'judge on, of the {longest} of the longest record; {FEWEST} and 2 are the fewest'
        )
    return train, held


def load_both(
    data: Sequence[Path],
    validate: Sequence[Path],
    msg_config: str | None,
    k_e: float | None = None,
) -> 'tuple[list[Record], list[Record]]':
    """Read what is to be fitted, and what to judge on.

    Raises
    ------
    UserError
        As `load_data`; and if what is to judge has been fitted: it would tell nothing.
    """
    train, held = load_data(data, msg_config, k_e), load_data(validate, msg_config, k_e)
    fitted = {record.digest(): record.provenance.source for record in train}
    for record in held:
        if record.digest() in fitted:
            raise UserError(
                f'{record.provenance.source} of --validate is fitted as well '
                f'({fitted[record.digest()]}), so it cannot judge; give another recording, or '
                'leave --validate out: then the last part of each DATA is held back'
            )
    return train, held


def refuse_two_motors(args: argparse.Namespace) -> None:
    """Refuse a motor kind beside a model, which names one."""
    if args.model and args.motor:
        raise UserError('--model names the motor already; leave --motor out')


def _note(text: str) -> None:
    print(f'note: {text}', file=sys.stderr)
