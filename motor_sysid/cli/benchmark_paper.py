"""`motor-sysid benchmark paper`: the benchmark of the paper, done again."""

import argparse
from pathlib import Path
import tempfile
from typing import TYPE_CHECKING

from motor_sysid.cli.output import write_json, write_text
from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.benchmark.paper.report import Results
    from motor_sysid.benchmark.paper.store import PaperFile

QUICK, FULL = 3, 30
"""Seeds of each method on each study."""

FILE = Path('paper_benchmark.jsonl')


def run(args: argparse.Namespace) -> int:
    """Run it, print the tables, write what was asked for; 0 whatever the gates say."""
    from motor_sysid.benchmark.paper.report import as_dict, tables
    from motor_sysid.benchmark.paper.suite import page
    from motor_sysid.cli.benchmark_progress import print_table

    _refuse(args)
    results = _measured(args)
    for table in tables(results):
        if not table.wide:
            print_table(table)
    if args.page:
        write_text(page(results), args.page, 'page')
    write_json(as_dict(results), args.json)
    return 0


def _measured(args: argparse.Namespace) -> 'Results':
    """Run what is not kept yet; a quick benchmark is kept only where that was asked for."""
    from motor_sysid.benchmark.paper.store import PaperFile

    if args.quick and not args.results:
        with (
            tempfile.TemporaryDirectory() as folder,
            PaperFile(Path(folder) / FILE.name) as file,
        ):
            return _run(args, file, kept=False)
    path = args.results or FILE
    with PaperFile(path, fresh=args.fresh) as file:
        results = _run(args, file, kept=True)
    print(f'results: {path}')
    return results


def _run(args: argparse.Namespace, file: 'PaperFile', *, kept: bool) -> 'Results':
    from motor_sysid.benchmark.paper.suite import plan
    from motor_sysid.benchmark.paper.suite import run as run_suite
    from motor_sysid.cli.benchmark_progress import Watch

    tasks = plan(args.runs or (QUICK if args.quick else FULL), quick=args.quick)
    with Watch(len(tasks), goes_on=kept) as watch:
        return run_suite(tasks, file, processes=args.workers, progress=watch.tell)


def _refuse(args: argparse.Namespace) -> None:
    """Refuse options that belong to the benchmark of the diagnosis."""
    given = {'--case': bool(args.case), '--seed': args.seed != 0, '--no-peers': args.no_peers}
    wrong = [name for name, there in given.items() if there]
    if wrong:
        raise UserError(f'{wrong[0]} is for `benchmark diagnosis`; its seeds here are fixed')
