"""`motor-sysid simulate`: a record of a model with realistic sensors."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from motor_sysid.cli.common import (
    add_effect_file_argument,
    load_effect_files,
    number,
    whole,
)
from motor_sysid.cli.output import new_file, new_record, write_each, write_model
from motor_sysid.cli.reading import load_data
from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Container, Iterable

    import numpy as np
    from numpy.typing import NDArray

    from motor_sysid.control.experiment import Sense
    from motor_sysid.control.profile import Profile
    from motor_sysid.nodes.sensors import SensorSettings
    from motor_sysid.physics.model import Model
    from motor_sysid.physics.stepper import Stepper
    from motor_sysid.signals.record import Record

HELP = 'simulate a motor with effects and realistic sensors; write a CSV or a bag'

_REACH = 0.6
_SLOWEST_LOOP = 0.05
_CROSSOVER = 40.0
_LARGEST_CURRENT = 0.4
_LARGEST_TURN = 0.2
_MOST_SAMPLES = 10**7
_FILES = ('.yaml', '.yml', '.csv')
_DEFAULTS: dict[str, object] = {
    'motor': 'brushed_dc', 'linear': False, 'profile': 'mixed', 'duration': 20.0, 'rate': 1000.0
}  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    _add_plant_arguments(parser)
    _add_motion_arguments(parser)
    sensors = parser.add_argument_group('sensors')
    sensors.add_argument(
        '--counts', type=whole('--counts', 0), default=4096, metavar='N',
        help='encoder counts per turn, or per metre of a linear axis; 0: ideal (default: 4096)',
    )  # fmt: skip
    sensors.add_argument(
        '--current-noise', type=number('--current-noise', 0, closed=True), default=0.02,
        metavar='A', help='(default: %(default)s)',
    )  # fmt: skip
    sensors.add_argument(
        '--current-bits', type=whole('--current-bits', 0, 32), default=12, metavar='N',
        help='bits over -20 A to 20 A; 0: no rounding (default: %(default)s)',
    )  # fmt: skip
    sensors.add_argument('--ideal', action='store_true', help='no noise and no rounding at all')
    sensors.add_argument(
        '--seed', type=whole('--seed', 0), default=0, metavar='N', help='of the noise (default: 0)'
    )


def _add_plant_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('model', nargs='?', type=Path, metavar='MODEL', help='model (YAML)')
    parser.add_argument('--motor', metavar='KIND', help='without MODEL (default: brushed_dc)')
    parser.add_argument(
        '--linear', action='store_true', default=None, help='a linear axis, without MODEL'
    )
    parser.add_argument(
        '--effect', nargs='+', action='extend', default=[], metavar='EFFECT',
        help='effects to add, of a plausible size unless set',
    )  # fmt: skip
    parser.add_argument(
        '--set', nargs='+', action='extend', default=[], metavar='NAME=VALUE',
        help='parameters in SI units: R=1.2 coulomb_friction.tau_c=0.01',
    )  # fmt: skip
    parser.add_argument(
        '-o', '--out', type=new_record, required=True, metavar='FILE',
        help='.csv, .csv.gz, or else a bag folder',
    )  # fmt: skip
    parser.add_argument('--storage', choices=('mcap', 'sqlite3'), default='mcap', help='of a bag')
    parser.add_argument('--save-model', type=new_file, metavar='MODEL', help='write what was run')
    add_effect_file_argument(parser)


def _add_motion_arguments(parser: argparse.ArgumentParser) -> None:
    motion = parser.add_argument_group('motion')
    motion.add_argument(
        '--profile', metavar='NAME',
        help='speed reference of a controller: mixed (default), steps, reversals, ramps, sweep, '
        'or a file that `suggest` wrote, whose signal then drives the controller or the motor',
    )  # fmt: skip
    motion.add_argument(
        '--top-speed', type=number('--top-speed', 0), metavar='SPEED',
        help='rad/s; default: 60 %% of what the supply allows',
    )  # fmt: skip
    motion.add_argument(
        '--open-loop', type=float, metavar='LEVEL',
        help='no controller: the profile drives the input, up to this level (V, N m, N)',
    )  # fmt: skip
    motion.add_argument(
        '--input', type=Path, metavar='DATA', help='drive with the recorded input of DATA instead'
    )
    motion.add_argument(
        '--msg-config', metavar='FILE', help='which topic or column of DATA carries which signal'
    )
    motion.add_argument(
        '--supply', type=number('--supply', 0), default=24.0, metavar='V', help='(default: 24)'
    )
    motion.add_argument(
        '--duration', type=number('--duration', 0), metavar='S', help='(default: 20)'
    )
    motion.add_argument(
        '--rate', type=number('--rate', 1e-4, 1e9), metavar='HZ', help='(default: 1000)'
    )


def run(args: argparse.Namespace) -> int:
    """Simulate and write."""
    from motor_sysid.recording.save import write_record

    _refuse_idle(args)
    for name, value in _DEFAULTS.items():
        if getattr(args, name) is None:
            setattr(args, name, value)
    load_effect_files(args.effect_file)
    driven = _recorded(args)
    model = _model(args, driven.dt if driven else 1 / args.rate)
    record = _follow(model, driven, args) if driven else _record(model, args)
    write_each(
        lambda: write_record(record, args.out, storage=args.storage),
        lambda: write_model(model, args.save_model),
    )
    names = ', '.join(f'{name} [{record.units[name]}]' for name in record)
    print(f'{len(record)} samples of {names} over {record.duration:.3g} s: {args.out}')
    return 0


def _refuse_idle(args: argparse.Namespace) -> None:
    """Refuse options that would do nothing beside another one."""
    file = args.profile is not None and Path(args.profile).suffix in _FILES
    idle = (
        (args.model, 'a MODEL', ('motor', 'linear')),
        (args.input, '--input', ('profile', 'top_speed', 'open_loop', 'duration', 'rate')),
        (file, f'--profile {args.profile}', ('top_speed', 'open_loop', 'duration')),
        (args.open_loop is not None, '--open-loop', ('top_speed',)),
    )
    for given, name, others in idle:
        useless = [other for other in others if getattr(args, other) is not None]
        if given and useless:
            option = useless[0].replace('_', '-')
            raise UserError(f'--{option} does nothing beside {name}; leave one of them out')
    if args.msg_config and not args.input:
        raise UserError('--msg-config says how to read the DATA of --input; give that, too')


def _recorded(args: argparse.Namespace) -> 'Record | None':
    """Return what was recorded of the input, evenly sampled, if it is to be followed."""
    if not args.input:
        return None
    records = load_data([args.input], args.msg_config)
    if len(records) > 1:
        longest = max(records, key=len)
        raise UserError(
            f'{args.input} consists of {len(records)} stretches (the longest begins at '
            f'{longest.time[0]:.6g} s and lasts {longest.duration:.3g} s); give one of them '
            'alone, or allow longer gaps with `max_gap` in a msg_config file'
        )
    return records[0].uniform()


def _model(args: argparse.Namespace, dt: float) -> 'Model':
    from motor_sysid.nodes.hidden import parse_assignments, scales_of_drive, with_hidden
    from motor_sysid.physics.model import Model
    from motor_sysid.physics.store import load_model

    given = parse_assignments(args.set)
    own = {name: value for name, value in given.items() if '.' not in name}
    if args.model:
        model = load_model(args.model).with_values(own)
    else:
        model = Model.base(args.motor, own, linear=args.linear)
    rest = {name: value for name, value in given.items() if '.' in name}
    _refuse_without_effect(rest, {*model.effects, *args.effect})
    scales = scales_of_drive(model, args.supply, dt)
    return with_hidden(model, args.effect, rest, scales)


def _refuse_without_effect(names: 'Iterable[str]', present: 'Container[str]') -> None:
    """Refuse parameters of effects that the motor does not have."""
    from motor_sysid.physics.effects import effect

    for name in names:
        key = name.partition('.')[0]
        if key not in present:
            effect(key)
            raise UserError(f'`{name}` belongs to an effect; give --effect {key}, too')


def _record(model: 'Model', args: argparse.Namespace) -> 'Record':
    from motor_sysid.control.experiment import run_closed, run_open
    from motor_sysid.control.pid import Pid
    from motor_sysid.control.profile import SPEED
    from motor_sysid.control.tuning import speed_pi

    dt = 1 / args.rate
    profile, sense = _profile(model, args), _sensors(model, args, dt)
    if not profile.duration * args.rate <= _MOST_SAMPLES:
        raise UserError(
            f'{profile.duration:g} s at {args.rate:g} Hz are more than {_MOST_SAMPLES:,} samples; '
            'give a shorter --duration or a lower --rate'
        )
    wanted = profile.sampled(dt)
    if profile.signal != SPEED:
        return run_open(model, {profile.signal: wanted}, dt, sense)
    if model.kind.frame:
        return _driven(model, args, wanted)
    if model.motor != 'brushed_dc':
        level = '--open-loop LEVEL or ' if len(_inputs(model)) == 1 else ''
        raise UserError(
            f'a {model.kind.title} is simulated without a controller; give {level}--input DATA'
        )
    gains = speed_pi(model, max(_SLOWEST_LOOP, 20 * dt), args.supply)
    return run_closed(model, wanted, Pid(gains), dt, sense)


def _profile(model: 'Model', args: argparse.Namespace) -> 'Profile':
    """Return the profile of the file, or the built-in one of that name."""
    from motor_sysid.control.experiment import unit_of
    from motor_sysid.control.profile import Profile
    from motor_sysid.control.profile_file import load_profile

    if Path(args.profile).suffix in _FILES:
        return load_profile(Path(args.profile))[0]
    if args.open_loop is not None:
        name, *more = _inputs(model)
        if more:
            own_drive = 'leave --open-loop out, or ' if model.kind.frame else ''
            raise UserError(
                f'a {model.kind.title} is driven by {name}, {", ".join(more)} at once, not by one '
                f'level; {own_drive}give --input DATA'
            )
        unit = unit_of(name, linear=model.linear)
        return Profile(args.profile, args.open_loop, args.duration, signal=name, unit=unit)
    top = args.top_speed or _default_speed(model, args)
    return Profile(args.profile, top, args.duration)


def _default_speed(model: 'Model', args: argparse.Namespace) -> float:
    """Return what the supply allows, and at which phases can still be sampled, rad/s."""
    from motor_sysid.control.tuning import torque_constant

    reach: float = _REACH * args.supply / torque_constant(model)
    if model.kind.frame != 'abc':
        return reach
    return min(reach, _LARGEST_TURN * float(args.rate) / model['pole_pairs'])


def _driven(model: 'Model', args: argparse.Namespace, wanted: 'NDArray[np.float64]') -> 'Record':
    """Run a three-phase motor on the drive that fits it, under speed control."""
    from motor_sysid.control.pid import Pid
    from motor_sysid.control.tuning import current_pi, torque_constant
    from motor_sysid.nodes.plants import make_plant
    from motor_sysid.nodes.plants.base import Setup
    from motor_sysid.nodes.plants.run import run_plant
    from motor_sysid.physics.model import Model

    own = {n: v for n, v in model.parameters.values().items() if '.' not in n}
    limit = _LARGEST_CURRENT * args.supply / model['R']
    setup = Setup(
        Model.base(model.motor, own), model, _sensor_settings(model, args), args.rate,
        supply=args.supply, current_limit=limit,
    )  # fmt: skip
    gains = current_pi(model['J'], torque_constant(model), _CROSSOVER, limit)
    return run_plant(make_plant(setup), Pid(gains), wanted)


def _inputs(model: 'Model') -> tuple[str, ...]:
    """Return the input set to drive: force for a linear axis where there is one."""
    for names in model.kind.inputs:
        if ('force' in names) == model.linear:
            return names
    return model.kind.inputs[0]


def _follow(model: 'Model', record: 'Record', args: argparse.Namespace) -> 'Record':
    from motor_sysid.control.experiment import run_open
    from motor_sysid.physics.drive import input_signals

    inputs = {name: record[name] for name in input_signals(record, model.kind)}
    return run_open(model, inputs, record.dt, _sensors(model, args, record.dt))


def _sensors(model: 'Model', args: argparse.Namespace, dt: float) -> 'Sense':
    """Return the sensors: encoder counts and their difference, and noisy, rounded currents."""
    from motor_sysid.nodes.sensors import DriveSensors

    if args.ideal:
        return lambda plant: plant.outputs
    drive = DriveSensors(_sensor_settings(model, args), dt)

    def sense(plant: 'Stepper') -> dict[str, float]:
        shown = plant.outputs
        if 'position' in shown:
            shown['speed'], shown['position'] = drive.motion(shown, plant.state)
        for name in shown:
            if name.startswith('current'):
                shown[name] = drive.current(shown[name])
        return shown

    return sense


def _sensor_settings(model: 'Model', args: argparse.Namespace) -> 'SensorSettings':
    from motor_sysid.nodes.sensors import SensorSettings

    if args.ideal:
        return SensorSettings(0, 0.0, 0.0, current_bits=0)
    return SensorSettings(
        counts_per_revolution=round(args.counts * 2 * math.pi) if model.linear else args.counts,
        current_noise=args.current_noise,
        current_bits=args.current_bits,
        seed=args.seed,
    )
