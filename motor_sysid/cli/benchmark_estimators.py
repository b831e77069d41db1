"""`motor-sysid benchmark estimators`: the online estimators on perturbed motors, side by side."""

import argparse
import sys
from typing import TYPE_CHECKING

from motor_sysid.cli.output import write_json, write_text
from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.benchmark.perturbations import Perturbation

MOTORS, SECONDS = 2, 6.0
QUICK_MOTORS, QUICK_SECONDS = 1, 3.0


def run(args: argparse.Namespace) -> int:
    """Run all estimators on all perturbations, and show the tables."""
    _refuse(args)
    from motor_sysid.benchmark.estimator_tables import estimator_tables, page
    from motor_sysid.benchmark.estimators import as_dict, compare_estimators
    from motor_sysid.benchmark.perturbations import PERTURBATIONS
    from motor_sysid.cli.benchmark_progress import print_table

    motors = args.runs or (QUICK_MOTORS if args.quick else MOTORS)
    seconds = QUICK_SECONDS if args.quick else SECONDS
    scores = compare_estimators(
        PERTURBATIONS, motors, seconds, seed=args.seed, progress=_progress
    )
    for table in estimator_tables(scores):
        print_table(table)
    for one in PERTURBATIONS:
        print(f'{one.code}: {one.title}')
    if args.page:
        write_text(page(scores), args.page, 'page')
    write_json(as_dict(scores), args.json)
    return 0


def _progress(perturbation: 'Perturbation', motor: int) -> None:
    text = f'{perturbation.code}, motor {motor + 1}: {perturbation.title}'
    print(text, file=sys.stderr, flush=True)


def _refuse(args: argparse.Namespace) -> None:
    """Refuse options that belong to the other benchmarks."""
    given = {
        '--case': bool(args.case), '--results': args.results is not None, '--fresh': args.fresh,
        '--no-peers': args.no_peers,
    }  # fmt: skip
    wrong = [name for name, there in given.items() if there]
    if wrong:
        raise UserError(
            f'{wrong[0]} is no option of `benchmark estimators`; it takes --quick, --runs, '
            '--seed, --page and --json'
        )
