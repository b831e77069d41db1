"""Verb `replay`: the identifier's own code over a bag, faster than real time."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from motor_sysid.cli.common import add_effect_file_argument, add_json_argument, load_effect_files
from motor_sysid.cli.output import new_file, write_each, write_json, write_text
from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.nodes.configuration import Configuration
    from motor_sysid.nodes.replay import Replay

HELP = 'run the identifier over a bag and print its estimates'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('bag', type=Path, help='bag folder, .mcap or .db3')
    parser.add_argument(
        '--check', action='store_true',
        help='compare with the estimates that the live node published, bit for bit',
    )  # fmt: skip
    parser.add_argument('--model', type=Path, help='model to start from (default: as recorded)')
    parser.add_argument('--estimator', metavar='KEY', help='default: as recorded, else rls')
    parser.add_argument('--msg-config', help='which topic carries which signal')
    parser.add_argument(
        '--node', default='identifier', metavar='NAME',
        help='recorded identifier, with its namespace where there are several: left/identifier',
    )  # fmt: skip
    add_effect_file_argument(parser)
    parser.add_argument('--csv', type=new_file, help='write every estimate to this file')
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Replay, print, and tell with the exit code of `--check` whether all is equal (0) or not."""
    from motor_sysid.nodes.replay import replay
    from motor_sysid.nodes.topics import DEFAULT_CONFIG
    from motor_sysid.recording import load_msg_config

    load_effect_files(args.effect_file)
    config = load_msg_config(args.msg_config) if args.msg_config else DEFAULT_CONFIG
    result = replay(args.bag, _configuration(args), config, args.node)
    _print(result)
    write_each(
        lambda: _write_csv(result, args.csv), lambda: write_json(_as_json(result), args.json)
    )
    return _verdict(result) if args.check else 0


def _configuration(args: argparse.Namespace) -> 'Configuration | None':
    """Return what the user chose, on top of what was recorded."""
    if not (args.model or args.estimator):
        return None
    from dataclasses import replace

    from motor_sysid.nodes.configuration import Configuration
    from motor_sysid.nodes.replay import NotRecorded, recorded_configuration
    from motor_sysid.physics.store import load_model
    from motor_sysid.recording.rosbag import Bag

    model = load_model(args.model) if args.model else None
    try:
        first = recorded_configuration(Bag(args.bag), args.node)
    except NotRecorded:
        if model is None:
            raise
        return Configuration(model, args.estimator or 'rls')
    return replace(
        first, model=model or first.model, estimator=args.estimator or first.estimator
    )


def _print(result: 'Replay') -> None:
    speed = result.duration / result.seconds if result.seconds else 0.0
    print(
        f'{result.samples} samples, {result.duration:.1f} s, replayed in {result.seconds:.1f} s '
        f'({speed:.0f} times real time) with {result.configuration.estimator}'
    )
    if result.dropped:
        print(f'{result.dropped} messages had no partner with the same stamp')
    for note in result.notes:
        print(f'note: {note}')
    for name, (value, sigma, unit, identifiable) in _last(result).items():
        doubt = '' if identifiable else '  (not identifiable from this bag)'
        print(f'  {name:16s} {value:12.6g} ± {sigma:.2g} {unit}{doubt}')


def _last(result: 'Replay') -> Mapping[str, tuple[float, float, str, bool]]:
    if not result.estimates:
        raise UserError('the bag is too short: not one estimate came of it')
    return result.estimates[-1].estimate or {}


def _verdict(result: 'Replay') -> int:
    check = result.check
    if check is None:
        raise UserError('the bag holds no estimates of a live node to compare with')
    if check.unreachable:
        print(f'{check.unreachable} recorded estimates rest on samples that the bag lacks')
    if check.difference:
        print(f'DIFFERENT: {check.difference}')
        return 1
    if not check.compared:
        raise UserError('no recorded estimate rests on the samples of this bag alone')
    print(f'EQUAL: {check.compared} live estimates, bit for bit')
    return 0


def _as_json(result: 'Replay') -> dict[str, object]:
    check = result.check
    return {
        'schema': 'motor_sysid/replay/1',
        'estimator': result.configuration.estimator,
        'samples': result.samples,
        'duration_s': result.duration,
        'seconds': result.seconds,
        'dropped': result.dropped,
        'estimates': {
            name: {
                'value': value,
                'sigma': sigma,
                'unit': unit,
                'identifiable': identifiable,
            }
            for name, (value, sigma, unit, identifiable) in _last(result).items()
        },
        'check': None if check is None else {
            'compared': check.compared,
            'unreachable': check.unreachable,
            'equal': check.equal,
            'difference': check.difference,
        },
    }  # fmt: skip


def _write_csv(result: 'Replay', path: Path | None) -> None:
    """Write stamp, value and sigma of every estimate; floats read back bit for bit.

    Where effects came or went, a parameter that an estimate does not have leaves its cells empty.
    """
    if path is None:
        return
    estimates = [event.estimate or {} for event in result.estimates]
    names = {name: found[2] for one in estimates for name, found in one.items()}
    head = [f'{name} [{unit}],{name}_sigma [{unit}]' for name, unit in names.items()]
    lines = [','.join(['time [s]', *head])]
    for event in result.estimates:
        row = [f'{event.stamp // 10**9}.{event.stamp % 10**9:09d}']
        for name in names:
            found = (event.estimate or {}).get(name)
            row += [repr(float(found[0])), repr(float(found[1]))] if found else ['', '']
        lines.append(','.join(row))
    write_text('\n'.join(lines) + '\n', path, 'estimates')
