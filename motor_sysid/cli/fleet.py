"""`motor-sysid fleet`: which motor of many is not like the others, and in what."""

import argparse
from collections.abc import Callable, Iterable
from functools import partial
import os
from pathlib import Path
import sys
from typing import TYPE_CHECKING, TypeVar

from motor_sysid.cli.common import (
    add_effect_file_argument,
    add_reading_arguments,
    load_effect_files,
    number,
    whole,
)
from motor_sysid.cli.output import new_page, write_each, write_json, writing
from motor_sysid.cli.reading import load_data, load_start
from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.fleet import Fleet, Member
    from motor_sysid.signals.record import Record

Task = TypeVar('Task')
Answer = TypeVar('Answer')

LIMIT = 1800.0
"""Longest time for one motor, s."""

HELP = 'say which of many motors of one type is not like the others, and in what'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument(
        'folder', type=Path, metavar='DIR',
        help='has a recording (bag, .mcap, .db3, CSV, CSV.GZ, .mat, .npz), or a folder with '
        'several, for each motor',
    )  # fmt: skip
    add_reading_arguments(parser)
    parser.add_argument(
        '--model', type=Path, metavar='MODEL',
        help='model (YAML) that all are said to follow; default: what most are found to be',
    )  # fmt: skip
    parser.add_argument('--motor', metavar='KIND', help='motor kind; default: what the data allow')
    parser.add_argument('--nominal', type=Path, metavar='DATASHEET', help='nominal values (YAML)')
    parser.add_argument(
        '--alpha', type=number('--alpha', 0, 1), default=0.01, metavar='RATE',
        help='chance of any odd parameter though all motors are alike (default: %(default)g)',
    )  # fmt: skip
    parser.add_argument(
        '--workers', type=whole('--workers', 1), default=os.cpu_count() or 1, metavar='N',
        help='processes to work in (default: one for each processor)',
    )  # fmt: skip
    parser.add_argument('--page', type=new_page, metavar='HTML', help='write a page with pictures')
    add_effect_file_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Diagnose and fit every motor, print who is odd, write what was asked for."""
    from motor_sysid.fleet import Question, survey
    from motor_sysid.fleet.document import fleet_document

    load_effect_files(args.effect_file)
    start = load_start(args)
    records, unread = _records(args, start.k_e)
    question = Question(start.motor, start.model, start.nominal)
    found = survey(records, question, alpha=args.alpha, each=_Processes(args), tell=_tell)
    print('\n'.join([*summary(found), *(f'not read: {text}' for text in unread)]))
    document = {**fleet_document(found), 'unread': unread}
    write_each(
        lambda: write_json(document, args.json), lambda: _write_page(found, args.page)
    )
    return 0


class _Processes:
    """Does tasks in as many processes as the user asks for; one that crashes costs its task."""

    def __init__(self, args: argparse.Namespace) -> None:
        self.workers = args.workers
        self.warm_up = partial(load_effect_files, args.effect_file)

    def __call__(
        self, tasks: Iterable[Task], work: Callable[[Task], Answer], /
    ) -> Iterable[tuple[Task, Answer]]:
        """Yield tasks with their answers as they come."""
        from motor_sysid.benchmark import workers

        team = workers.each(
            tasks, work, workers=self.workers, limit=LIMIT, warm_up=self.warm_up
        )
        for task, answer in team:
            if isinstance(answer, workers.Lost):
                print(f'note: a motor could not be looked at: {answer.reason}', file=sys.stderr)
            else:
                yield task, answer


def _records(
    args: argparse.Namespace, k_e: float | None
) -> 'tuple[dict[str, list[Record]], list[str]]':
    """Read every motor; one that cannot be read does not cost the others."""
    from motor_sysid.fleet import motors_in

    found: dict[str, list[Record]] = {}
    unread = []
    for name, paths in motors_in(args.folder).items():
        try:
            found[name] = load_data(paths, args.msg_config, k_e)
        except UserError as problem:
            unread.append(f'{name}: {problem}')
    if not found:
        raise UserError('; '.join(unread))
    return found, unread


def summary(fleet: 'Fleet') -> list[str]:
    """Return what there is to say as lines of text."""
    from motor_sysid.diagnosis.result.figures import with_unit
    from motor_sysid.fleet import FEWEST

    lines = ['', f'model of all: {" + ".join(["linear", *fleet.effects])} ({fleet.motor})', '']
    lines.append(f'{"motor":<24}{"held-out error, %":>26}   its own diagnosis')
    lines += [_line(one) for one in fleet.members]
    lines += ['', f'{"parameter":<34}{"mean":>16}{"from motor to motor":>22}']
    for one in fleet.spreads:
        by = f'{100 * one.scatter:.2g} %' if one.relative else with_unit(one.scatter, one.unit, 2)
        lines.append(f'{one.parameter:<34}{with_unit(one.mean, one.unit):>16}{by:>22}')
    odd = {one.name: texts for one in fleet.members if (texts := fleet.oddities(one))}
    lines += ['', *(f'{name}: {text}' for name, texts in odd.items() for text in texts)]
    if not odd:
        lines.append('No motor differs from the others.')
    if len(fleet.members) < FEWEST:
        lines.append(
            f'note: parameters are compared from {FEWEST} motors on; fewer do not tell how much '
            'motors of this type differ'
        )
    return lines


def _line(one: 'Member') -> str:
    errors = ' -> '.join(f'{e:.3g}' for e in one.errors[:2] if e == e)
    errors += f' ({one.errors[2]:.3g})' if one.errors[2] == one.errors[2] else ''
    verdict = one.verdict.value.replace('_', ' ') if one.verdict else one.reason
    return f'{one.name:<24}{errors:>26}   {", ".join(one.effects) or verdict}'


def _tell(text: str) -> None:
    print(f'  {text}', file=sys.stderr, flush=True)


def _write_page(fleet: 'Fleet', path: Path | None) -> None:
    from motor_sysid.benchmark.page import whole as whole_page
    from motor_sysid.fleet.picture import body, STYLE

    if path is None:
        return
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(whole_page('Fleet', body(fleet), STYLE), encoding='utf-8')
    print(f'page: {path}')
