"""`motor-sysid diagnose`: find out which physical effect a motor model lacks."""

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
import sys
import time
from typing import TextIO, TYPE_CHECKING, TypedDict

from motor_sysid.cli.common import (
    add_data_arguments,
    add_effect_file_argument,
    load_effect_files,
    number,
    progress,
    whole,
)
from motor_sysid.cli.output import (
    new_file,
    new_page,
    write_each,
    write_json,
    write_model,
    writing,
)
from motor_sysid.cli.reading import load_parts, load_start

if TYPE_CHECKING:
    from motor_sysid.diagnosis import Diagnosis, Settings
    from motor_sysid.physics.model import Model
    from motor_sysid.signals.record import Record

HELP = 'name the physical effect that a motor model lacks, with evidence'

WILDEST = 1e4
"""Error in percent beyond which it is only said that it is beyond."""


class Asked(TypedDict):
    """Arguments of `motor_sysid.diagnosis.diagnose` beside the data."""

    motor: str | None
    model: 'Model | None'
    nominal: Mapping[str, float]
    effects: list[str] | None
    settings: 'Settings'


def add_question_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the data, and what is asked of them."""
    add_data_arguments(parser, validate=True)
    parser.add_argument('--model', type=Path, metavar='MODEL', help='model (YAML) to start from')
    parser.add_argument('--motor', metavar='KIND', help='motor kind; default: what the data allow')
    parser.add_argument(
        '--nominal', type=Path, metavar='DATASHEET', help='data sheet (YAML) with nominal values'
    )
    parser.add_argument(
        '--effects',
        nargs='+',
        action='extend',
        metavar='EFFECT',
        help='try only these; default: the catalogue',
    )
    parser.add_argument(
        '--max-effects', type=whole('--max-effects', 0), default=4, metavar='N',
        help='most to add (default: 4)',
    )  # fmt: skip
    parser.add_argument(
        '--effort', type=number('--effort', 0), default=1.0, metavar='TIMES',
        help='how long to search where nothing explains the data, in units of the usual '
        '(default: %(default)g: one to three minutes on two cores)',
    )  # fmt: skip
    parser.add_argument(
        '--alpha', type=number('--alpha', 0, 1), default=0.01, metavar='RATE',
        help='false-alarm rate of evidence, if `motor-sysid calibrate` has told what that takes '
        '(default: %(default)g)',
    )  # fmt: skip
    add_effect_file_argument(parser)


def question_of(args: argparse.Namespace) -> 'tuple[list[Record], list[Record], Asked]':
    """Return the training and the validation data, and what is asked of them.

    Raises
    ------
    UserError
        If something cannot be read, or makes no sense.
    """
    load_effect_files(args.effect_file, args.effects or ())
    start = load_start(args)
    asked: Asked = {
        'motor': start.motor,
        'model': start.model,
        'nominal': start.nominal,
        'effects': args.effects,
        'settings': replace(
            usual_settings(),
            max_effects=args.max_effects,
            validation_fraction=args.hold_back,
            alpha=args.alpha,
            effort=args.effort,
        ),
    }
    return *load_parts(args, start.k_e), asked


def usual_settings() -> 'Settings':
    """Return what every verb diagnoses with: the usual settings, and the user's calibrations."""
    from motor_sysid.diagnosis import Settings
    from motor_sysid.diagnosis.calibration.store import load_calibrations

    return Settings(calibrations=tuple(load_calibrations(complain=_complain)))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_question_arguments(parser)
    parser.add_argument(
        '-o', '--out', type=new_file, metavar='MODEL', help='write the final model (YAML)'
    )
    parser.add_argument('--report', type=new_page, metavar='HTML', help='write the page, too')


def run(args: argparse.Namespace) -> int:
    """Diagnose, print the verdict, write what was asked for."""
    from motor_sysid.diagnosis import diagnose

    train, validation, asked = question_of(args)
    began = time.perf_counter()
    found = diagnose(train, validation, **asked, progress=progress())
    found = replace(found, seconds=time.perf_counter() - began)
    print('\n'.join(summary(found)))
    write_each(
        lambda: write_result(found, args.json),
        lambda: write_model(found.model, args.out),
        lambda: _write_page(found, args.report),
    )
    return 0


def write_result(found: 'Diagnosis', target: Path | TextIO | None) -> None:
    """Write a diagnosis and its page's view as JSON, if that was asked for."""
    from motor_sysid.diagnosis.result.document import diagnosis_document
    from motor_sysid.workbench.view import build_view

    if target is not None:
        write_json({**diagnosis_document(found), 'view': build_view(found)}, target)


def _write_page(found: 'Diagnosis', path: Path | None) -> None:
    from motor_sysid.workbench.report import write_report

    if path is not None:
        with writing(path):
            print(f'report: {write_report(found, path)}')


def _complain(text: str) -> None:
    print(f'note: {text}', file=sys.stderr)


def _percent(error: float) -> str:
    return f'{error:.3g}' if not error > WILDEST else f'> {WILDEST:.0e}'


def summary(found: 'Diagnosis') -> list[str]:
    """Return the verdict as lines of text: words, ladder, candidates."""
    lines = ['', f'Verdict: {found.verdict.value.replace("_", " ")}', *found.reasons, '']
    lines.append(f'{"model":<58}{"train":>10}{"held out":>12}   error in percent')
    for step in found.steps:
        name = ' + '.join(['linear', *step.model.effects])
        lines.append(
            f'{name:<58}{step.train_error_percent:>10.3g}{step.validation_error_percent:>12.3g}'
        )
    lines.append(f'{"sensor noise alone":<58}{"":>10}{found.noise_floor_percent:>12.3g}')
    for step in found.steps:
        if step.candidates:
            lines += ['', f'tried on {" + ".join(["linear", *step.model.effects])}:']
        for one in step.candidates:
            lines.append(
                f'  {one.title:<32} evidence dBIC {one.delta_bic:>12.4g}   held out '
                f'{_percent(one.validation_error_percent):>8} %   {one.note or "helps"}'
            )
    if found.experiment:
        wanted = found.experiment
        lines += ['', f'Record next: {wanted["profile"]} ({wanted["purpose"]})']
    lines += [f'note: {w}' for w in found.warnings]
    return [*lines, f'({found.seconds:.1f} s)']
