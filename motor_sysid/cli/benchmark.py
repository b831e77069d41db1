"""`motor-sysid benchmark`: how often the diagnosis is right, on motors whose truth is known."""

import argparse
import json
import os
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.benchmark.outcome import Result

HELP = 'measure how often the diagnosis is right, on simulated motors with hidden effects'

QUICK, FULL = 40, 400


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument('what', choices=('diagnosis',), help='what to measure')
    parser.add_argument(
        '--quick', action='store_true', help=f'{QUICK} cases (some minutes) in place of {FULL}'
    )
    parser.add_argument('--runs', type=int, metavar='N', help='number of cases')
    parser.add_argument(
        '--seed', type=int, default=0, metavar='N', help='other cases (default: %(default)s)'
    )
    parser.add_argument(
        '--workers', type=int, default=os.cpu_count() or 1, metavar='N',
        help='processes (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--page', type=Path, metavar='FILE', help='write the report, Markdown, to this file too'
    )
    parser.add_argument('--json', type=Path, metavar='FILE', help='write every case as JSON')


def run(args: argparse.Namespace) -> int:
    """Run the benchmark and print its report."""
    from motor_sysid.benchmark import cases, diagnosis, tables

    count = args.runs if args.runs is not None else QUICK if args.quick else FULL
    if count < 1 or args.workers < 1:
        raise UserError(f'{count} runs with {args.workers} workers; both must be at least 1')
    results = diagnosis.run(
        cases.scenarios(count), seed=args.seed, workers=args.workers, progress=_progress
    )
    text = tables.report(results)
    print(text)
    if args.page:
        _write(args.page, text)
    if args.json:
        _write(args.json, json.dumps(tables.as_dict(results), indent=1) + '\n')
    return 0


def _progress(result: 'Result', done: int, total: int) -> None:
    print(
        f'{done}/{total} {result.title}: {result.answer} ({result.outcome.value}, '
        f'{result.seconds:.1f} s)',
        file=sys.stderr,
        flush=True,
    )


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text)
    except OSError as error:
        raise UserError(f'{path} cannot be written: {error.strerror}') from None
