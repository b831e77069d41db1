"""`motor-sysid suggest`: the next experiment, and what it will decide."""

import argparse
from collections.abc import Mapping
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING

from motor_sysid.cli.common import (
    add_effect_file_argument,
    add_reading_arguments,
    load_effect_files,
    progress,
)
from motor_sysid.cli.output import new_file, write_each, write_json
from motor_sysid.cli.reading import load_data, load_first_model
from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.control.pid import PidGains
    from motor_sysid.diagnosis import Experiment

HELP = 'say what to record next to separate rival effects or determine weak parameters'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    parser.add_argument('model', type=Path, metavar='MODEL', help='model (YAML)')
    parser.add_argument(
        'data', nargs='+', type=Path, metavar='DATA', help='what has been recorded so far'
    )
    add_reading_arguments(parser)
    asked = parser.add_argument_group('what is open (default: what a diagnosis of DATA leaves)')
    one = asked.add_mutually_exclusive_group()
    one.add_argument(
        '--rivals', nargs='+', action='extend', default=[], metavar='EFFECTS',
        help='effects to tell apart; A+B belong together, `none` is the model as it is',
    )  # fmt: skip
    one.add_argument(
        '--diagnosis', type=Path, metavar='JSON', help='a diagnosis that names the rivals'
    )
    one.add_argument(
        '--parameters', nargs='+', action='extend', default=[], metavar='NAME',
        help='parameters to determine',
    )
    _add_limits(parser)
    parser.add_argument(
        '-o', '--out', type=new_file, metavar='FILE',
        help='write the profile: .yaml for the node `excitation` and for simulate, or .csv',
    )  # fmt: skip
    add_effect_file_argument(parser)


def _add_limits(parser: argparse.ArgumentParser) -> None:
    limits = parser.add_argument_group('limits (default: what the motor has done in DATA)')
    for names, unit, words in (
        (('--voltage', '--input'), 'V', 'largest input either way; V, or N m, N, A of an axis'),
        (('--speed',), 'SPEED', 'largest speed either way, rad/s or m/s'),
        (('--current',), 'A', 'largest current either way'),
        (('--travel',), 'WAY', 'largest distance from the start either way, rad or m'),
        (('--time',), 'S', 'longest experiment (default: 10)'),
    ):
        limits.add_argument(*names, type=float, metavar=unit, help=words)
    limits.add_argument('--one-way', action='store_true', help='the motor must not turn back')


def run(args: argparse.Namespace) -> int:
    """Choose the experiment, print it, write what was asked for."""
    from motor_sysid.diagnosis import suggest
    from motor_sysid.diagnosis.experiment import limits_of
    from motor_sysid.diagnosis.search.bench import prepared
    from motor_sysid.physics.drive import input_signals

    load_effect_files(args.effect_file)
    model = load_first_model(args)
    records = load_data(args.data, args.msg_config)
    evens = prepared(records, model.motor, model.parameters.values())
    limits = limits_of(
        evens, model.kind, input=args.voltage, speed=args.speed, current=args.current,
        travel=args.travel, time=args.time, reverse=False if args.one_way else None,
    )  # fmt: skip
    made = suggest(
        model, records, rivals=args.rivals, diagnosis=_document(args.diagnosis),
        parameters=args.parameters, limits=limits, progress=progress(),
    )  # fmt: skip
    first, driven = evens[0], input_signals(evens[0], model.kind)[0]
    way = 'm' if {'m', 'm/s'} & set(first.units.values()) else 'rad'
    units = {'input': first.units[driven], 'speed': f'{way}/s', 'current': 'A', 'travel': way}
    print('\n'.join(summary(made, units)))
    document = {'schema': 'motor_sysid/suggest/1', 'experiment': made.to_dict()}
    write_each(
        lambda: _write_profile(made, args.out, first.dt),
        lambda: write_json(document, args.json),
    )
    return 0


def _write_profile(made: 'Experiment', path: Path | None, dt: float) -> None:
    from motor_sysid.control.profile_file import save_profile

    if path is not None and made.profile is not None:
        save_profile(
            made.profile, path, limits=made.limits.sizes(), note=_note(made), dt=dt
        )
        print(f'profile: {path}')
        if path.suffix == '.csv':
            print('note: a CSV holds the profile alone; write YAML for limits that a node keeps')
    elif path is not None:
        print(f'{path} is not written: there is no experiment to do')


def _note(made: 'Experiment') -> str:
    """Return what stands above a profile in its file."""
    gains = made.follower
    planned = f'; planned with kp = {gains.kp:.4g}, ki = {gains.ki:.4g}' if gains else ''
    return made.summary + planned


def _document(path: Path | None) -> dict[str, object] | None:
    if path is None:
        return None
    try:
        document = json.loads(path.read_text(encoding='utf-8'))
    except (OSError, ValueError) as problem:
        raise UserError(f'cannot read diagnosis {path}: {problem}') from problem
    if not isinstance(document, dict):
        raise UserError(f'{path} is no diagnosis; write one with `diagnose --json`')
    return document


def _planned_with(gains: 'PidGains', limit: float, unit: str, way: str) -> list[str]:
    """Say which speed controller keeps to the predicted peaks."""
    lines = [
        f'Planned with a PI speed controller, kp = {gains.kp:.4g} {unit} s/{way}, '
        f'ki = {gains.ki:.4g} {unit}/{way}: a brisker one asks for more.'
    ]
    if unit == 'V' and math.isfinite(limit):
        lines.append(
            f'  ros2 run motor_sysid pid --ros-args -p profile:=topic -p kp:={gains.kp:.4g} '
            f'-p ki:={gains.ki:.4g} -p voltage_limit:={limit:.4g}'
        )
    return lines


def summary(made: 'Experiment', units: Mapping[str, str]) -> list[str]:
    """Return the experiment as lines of text; `units` are those of input, speed and the like."""
    from motor_sysid.diagnosis.result.figures import with_unit

    lines = ['', made.summary[0].upper() + made.summary[1:] + '.', *made.reasons]
    if made.profile is None:
        return lines
    lines += ['', f'Do: {made.described()}.']
    if made.peaks:
        peaks = ', '.join(f'{n} {with_unit(v, units.get(n, ""))}' for n, v in made.peaks.items())
        lines.append(f'Predicted peaks{", worst rival" if made.separations else ""}: {peaks}.')
    if made.follower:
        lines += _planned_with(
            made.follower, made.limits.input, units['input'], units['travel']
        )
    for one in made.separations:
        lines.append(f'  {" against ".join(one.rivals)}: expected dBIC {one.delta_bic:.0f}')
    for row in made.sharpenings:
        lines.append(
            f'  {row.name} = {with_unit(row.value, row.unit, 4)}: sigma '
            f'{with_unit(row.sigma_before, row.unit)} -> '
            f'{with_unit(row.sigma_after, row.unit)}'
        )
    return lines
