"""`motor-sysid benchmark`: diagnosis, estimators, fits on motors whose truth is known."""

import argparse
import os
from pathlib import Path
import tempfile
from typing import TYPE_CHECKING

from motor_sysid.cli.common import add_json_argument
from motor_sysid.cli.output import new_file, write_json, write_text
from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.benchmark.outcome import Result
    from motor_sysid.benchmark.store import ResultsFile

HELP = 'measure diagnosis and online estimators, or do the benchmark of the paper again'

QUICK, FULL = 24, 2000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        'what',
        choices=('diagnosis', 'three_phase', 'voltage_only', 'estimators', 'paper', 'report'),
        help='what to measure: the diagnosis, the same of three-phase motors or of motors whose '
        'current is not measured, the online estimators under the perturbations P1 to P11, or '
        'identification as in the paper; or `report`: only show results that files hold',
    )  # fmt: skip
    parser.add_argument(
        'files', nargs='*', type=Path, metavar='RESULTS', help='for `report`: results files'
    )
    parser.add_argument(
        '--quick', action='store_true',
        help=f'{QUICK} cases (some minutes) in place of {FULL} (fewer of `three_phase` and '
        '`voltage_only`), kept only with --results; of '
        '`paper` a part with 3 seeds (half a minute) in place of 30, kept likewise; of '
        '`estimators` one motor for 3 s in place of two for 6 s',
    )  # fmt: skip
    parser.add_argument(
        '--runs', type=int, metavar='N', help='number of cases, of seeds, or of motors'
    )
    parser.add_argument(
        '--case', action='append', default=[], metavar='NAME',
        help='run this case alone and say everything about it; may be given several times',
    )  # fmt: skip
    parser.add_argument(
        '--seed', type=int, default=0, metavar='N', help='other cases (default: %(default)s)'
    )
    parser.add_argument(
        '--results', type=Path, metavar='FILE',
        help='where each case is kept as soon as it is done; a benchmark that was stopped goes on '
        'from there (default: benchmark.jsonl, of `paper` paper_benchmark.jsonl)',
    )  # fmt: skip
    parser.add_argument(
        '--fresh', action='store_true', help='start the results file anew, whatever it holds'
    )
    parser.add_argument(
        '--workers', type=int, default=os.cpu_count() or 1, metavar='N',
        help='processes (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--limit', type=float, default=300.0, metavar='SECONDS',
        help='longest time for a case; one that takes longer has failed (default: %(default)g)',
    )  # fmt: skip
    parser.add_argument(
        '--no-peers', action='store_true', help='do not run the other methods on the same records'
    )
    parser.add_argument('--page', type=new_file, metavar='FILE', help='write the page (HTML), too')
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Run the benchmark, or read its results, and show the report."""
    from motor_sysid.benchmark.store import merged
    from motor_sysid.cli import benchmark_estimators, benchmark_paper

    _refuse(args)
    if args.what == 'paper':
        return benchmark_paper.run(args)
    if args.what == 'estimators':
        return benchmark_estimators.run(args)
    if args.case:
        return _cases(args)
    if args.what == 'report':
        program, results = merged(args.files)
    else:
        program, results = _measured(args)
    _show(results, {'state of the program': program}, args)
    return 0


def _refuse(args: argparse.Namespace) -> None:
    if args.what == 'report' and not args.files:
        raise UserError('report needs at least one results file')
    if args.what != 'report' and args.files:
        raise UserError(
            f'{args.files[0]}: results files go with `report`; to add to one use --results'
        )
    if (args.runs is not None and args.runs < 1) or args.workers < 1:
        raise UserError(
            f'{args.runs} runs with {args.workers} workers; both must be at least 1'
        )
    if not args.limit > 0:
        raise UserError(f'--limit is {args.limit:g} s; it must be above 0')
    if args.case and args.page:
        raise UserError('--page shows many cases; leave it out beside --case')
    if not 0 <= args.seed < 2**32:
        raise UserError(f'--seed is {args.seed}; it must be from 0 to {2**32 - 1}')


def _cases(args: argparse.Namespace) -> int:
    """Run cases in this process, where a debugger sees them, and tell all of each."""
    import json

    from motor_sysid.benchmark.diagnosis import one, Task
    from motor_sysid.benchmark.scenarios import named_case
    from motor_sysid.benchmark.suites import suite_of

    plain = [name for name in args.case if not suite_of(name)]
    for name in plain:
        named_case(name)
    peers = _peers(args) if plain else ()
    results = []
    for name in args.case:
        results.append(one(Task(name, args.seed, peers)))
        print(json.dumps(results[-1].as_dict(), indent=1), flush=True)
    write_json([result.as_dict() for result in results], args.json)
    return 0


def _measured(args: argparse.Namespace) -> 'tuple[str, list[Result]]':
    from motor_sysid.benchmark.lines import state_of_program
    from motor_sysid.benchmark.store import ResultsFile

    state = state_of_program()
    if args.quick and not args.results:
        with (
            tempfile.TemporaryDirectory() as folder,
            ResultsFile(Path(folder) / 'benchmark.jsonl', args.seed) as file,
        ):
            results = _run(args, file)
    else:
        path = args.results or Path('benchmark.jsonl')
        with ResultsFile(path, args.seed, fresh=args.fresh) as file:
            results = _run(args, file)
        print(f'results: {path}')
    changed = state_of_program() != state
    return f'{state}{" (it changed meanwhile)" if changed else ""}', results


def _run(args: argparse.Namespace, file: 'ResultsFile') -> 'list[Result]':
    from motor_sysid.benchmark.diagnosis import run as run_diagnosis
    from motor_sysid.benchmark.suites import SUITES
    from motor_sysid.cli.benchmark_progress import Watch

    suite = args.what if args.what in SUITES else ''
    full = SUITES[suite].cases if suite else FULL
    count = args.runs if args.runs is not None else QUICK if args.quick else full
    with Watch(count) as watch:
        return run_diagnosis(
            count, file, seed=args.seed, peers=() if suite else _peers(args),
            suite=suite, processes=args.workers, limit=args.limit, progress=watch,
        )  # fmt: skip


def _peers(args: argparse.Namespace) -> tuple[str, ...]:
    from motor_sysid.benchmark.peers import PEERS

    if args.no_peers:
        return ()
    for peer in PEERS.values():
        if peer.lacks:
            print(f'{peer.title} is left out: {peer.lacks}')
    return tuple(name for name, peer in PEERS.items() if not peer.lacks)


def _show(results: 'list[Result]', facts: dict[str, str], args: argparse.Namespace) -> None:
    from motor_sysid.benchmark.page import page
    from motor_sysid.benchmark.tables import as_dict, tables
    from motor_sysid.cli.benchmark_progress import print_table

    for table in tables(results):
        if not table.wide:
            print_table(table)
    if args.page:
        write_text(page(results, facts), args.page, 'page')
    write_json({**as_dict(results), **facts}, args.json)
