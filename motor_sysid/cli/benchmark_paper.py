"""`motor-sysid benchmark paper`: the benchmark of the paper, done again."""

import argparse

from motor_sysid.cli.common import write_json
from motor_sysid.errors import UserError

QUICK, FULL = 3, 30
"""Seeds of each method on each study."""


def run(args: argparse.Namespace) -> int:
    """Run it, print the tables, write what was asked for; 0 whatever the gates say."""
    from motor_sysid.benchmark.paper.report import as_dict, tables
    from motor_sysid.benchmark.paper.suite import page, plan
    from motor_sysid.benchmark.paper.suite import run as run_suite
    from motor_sysid.cli.benchmark_progress import print_table, Watch

    _refuse(args)
    tasks = plan(args.runs or (QUICK if args.quick else FULL), quick=args.quick)
    with Watch(len(tasks), goes_on=False) as watch:
        results = run_suite(tasks, processes=args.workers, progress=watch.tell)
    for table in tables(results):
        if not table.wide:
            print_table(table)
    if args.page:
        try:
            args.page.write_text(page(results), encoding='utf-8')
        except OSError as problem:
            raise UserError(f'cannot write {args.page}: {problem.strerror}') from problem
        print(f'page: {args.page}')
    write_json(as_dict(results), args.json)
    return 0


def _refuse(args: argparse.Namespace) -> None:
    """Refuse options that belong to the benchmark of the diagnosis."""
    given = {
        '--case': bool(args.case), '--results': args.results is not None, '--fresh': args.fresh,
        '--seed': args.seed != 0, '--no-peers': args.no_peers,
    }  # fmt: skip
    wrong = [name for name, there in given.items() if there]
    if wrong:
        raise UserError(f'{wrong[0]} is for `benchmark diagnosis`; its seeds here are fixed')
