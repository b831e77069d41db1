"""`motor-sysid fit`: fit a model to recordings."""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from motor_sysid.cli.common import (
    add_data_arguments,
    add_effect_file_argument,
    load_effect_files,
)
from motor_sysid.cli.output import new_file, write_each, write_json, write_model
from motor_sysid.cli.reading import load_parts, load_start
from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.cli.reading import Start
    from motor_sysid.diagnosis.search.rung import Rung
    from motor_sysid.estimation.batch import Transfer
    from motor_sysid.physics.model import Model
    from motor_sysid.signals.record import Record

HELP = 'fit the parameters of a model to recordings'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_data_arguments(parser, validate=True)
    parser.add_argument('--model', type=Path, metavar='MODEL', help='model (YAML) to start from')
    parser.add_argument('--motor', metavar='KIND', help='motor kind; default: what the data allow')
    parser.add_argument('--nominal', type=Path, metavar='DATASHEET', help='nominal values (YAML)')
    parser.add_argument(
        '--effect', nargs='+', action='extend', default=[], metavar='EFFECT',
        help='effects to fit as well',
    )
    parser.add_argument(
        '--method', default='least_squares', metavar='NAME',
        help='how to fit: svf, iv, huber, prediction_error, pso, ... (docs/estimation.md; '
        'default: %(default)s of the output error)',
    )  # fmt: skip
    parser.add_argument(
        '--prior', action='append', default=[], type=Path, metavar='MODEL',
        help='model (YAML) of a sister motor that a short record is weighed with; may be given '
        'several times (docs/transfer.md)',
    )  # fmt: skip
    parser.add_argument(
        '--spread', nargs='+', action='extend', default=[], metavar='SPREAD',
        help='how far motors of this type differ, with --prior: 0.1 for 10 %% (the default) in '
        'all parameters, b=0.5 for one of them',
    )  # fmt: skip
    parser.add_argument(
        '-o', '--out', type=new_file, metavar='MODEL', help='write the model (YAML)'
    )
    add_effect_file_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Fit, print parameters and errors, write what was asked for."""
    load_effect_files(args.effect_file, args.effect)
    start = load_start(args)
    train, held = load_parts(args, start.k_e)
    if args.prior:
        rung, found = _transferred(args, train, held)
    else:
        rung, found = _fitted(args, start, train, held), None
    for line in (*rung_lines(rung.model, rung.result.reason), *_share_lines(found)):
        print(line)
    print(
        f'error: {rung.training.error_percent:.3g} % on what was fitted, '
        f'{rung.validation.error_percent:.3g} % held out'
    )
    idle = _not_told(rung.model)
    for line in (*rung.result.unidentifiable, *rung.result.warnings, *idle):
        print(f'note: {line}')
    document = {**_document(rung, idle), **_prior_document(found)}
    write_each(lambda: write_model(rung.model, args.out), lambda: write_json(document, args.json))
    return 0


def _fitted(
    args: argparse.Namespace, start: 'Start', train: 'list[Record]', held: 'list[Record]'
) -> 'Rung':
    from motor_sysid.diagnosis.fitting import fit_model

    if args.spread:
        raise UserError('--spread says how far sisters differ; name one of them with --prior')
    if start.model is not None and start.nominal:
        print(f'note: values start from {args.model}, not from the data sheet', file=sys.stderr)
    return fit_model(
        train,
        held,
        model=start.model,
        motor=start.motor,
        nominal=start.nominal,
        effects=args.effect,
        method=args.method,
        validation_fraction=args.hold_back,
    )


def _transferred(
    args: argparse.Namespace, train: 'list[Record]', held: 'list[Record]'
) -> 'tuple[Rung, Transfer]':
    from dataclasses import replace

    from motor_sysid.diagnosis.fitting import transfer_model
    from motor_sysid.physics.store import load_model

    if args.model or args.motor or args.nominal or args.effect or args.method != 'least_squares':
        raise UserError(
            '--prior names motor and effects, and is a least-squares fit; leave out --model, '
            '--motor, --nominal, --effect and --method'
        )
    if len({path.resolve() for path in args.prior}) < len(args.prior):
        raise UserError('--prior names one file twice; each sister counts once')
    spread, spreads = _spreads(args.spread)
    rung, found = transfer_model(
        train,
        held,
        sisters=[load_model(path) for path in args.prior],
        spread=spread,
        spreads=spreads,
        validation_fraction=args.hold_back,
    )
    names = ', '.join(path.name for path in args.prior)
    model = rung.model.with_provenance(prior=names)
    return replace(rung, result=replace(rung.result, model=model)), found


def _spreads(texts: Sequence[str]) -> tuple[float, dict[str, float]]:
    """Return the spread of all parameters and those of single ones."""
    from motor_sysid.estimation.batch.sisters import SPREAD
    from motor_sysid.nodes.hidden import parse_assignments

    spread = SPREAD
    for text in (t for t in texts if '=' not in t):
        try:
            spread = float(text)
        except ValueError:
            raise UserError(f'--spread {text} is no number; give 0.1, or b=0.5') from None
    return spread, parse_assignments([t for t in texts if '=' in t])


def _share_lines(found: 'Transfer | None') -> list[str]:
    """Return a table of what came from the data."""
    if found is None:
        return []
    lines = ['from the data, the rest from the prior:']
    for one in found.shares:
        prior = f'{one.prior:.6g} ± {one.prior_sigma:.2g}' if one.data < 1 else 'none'
        lines.append(f'  {one.name:<34}{100 * one.data:>13.0f} %  (prior {prior})')
    agree = 'contradict each other' if found.contradicted else 'agree'
    return [*lines, f'data and prior {agree} (p = {found.p_value:.2g})']


def rung_lines(model: 'Model', reason: str) -> list[str]:
    """Return a table of the parameters."""
    lines = [f'{model.kind.title}: {" + ".join(["linear", *model.effects])} ({reason})']
    for p in model.parameters:
        spread = f'± {p.sigma:.2g}' if p.sigma is not None else '(fixed)' if not p.free else ''
        lines.append(f'  {p.name:<34}{p.value:>14.6g} {spread:<12} {p.unit:<14}{p.description}')
    return lines


def _not_told(model: 'Model') -> list[str]:
    """Say which effects these data do not tell from nothing."""
    from motor_sysid.diagnosis.search.gates import is_told
    from motor_sysid.physics.effects import effect

    said = []
    for key in model.effects:
        if not is_told(model, key):
            own = [model.parameters[f'{key}.{a.name}'] for a in effect(key).card.amplitudes]
            sizes = ', '.join(
                f'{p.name} = {p.value:.3g} ± {p.sigma or 0:.2g} {p.unit}' for p in own
            )
            said.append(
                f'{key} is not told from nothing by these data ({sizes}): fit without it, or '
                'record what shows it (`motor-sysid suggest`)'
            )
    return said


def _prior_document(found: 'Transfer | None') -> dict[str, object]:
    if found is None:
        return {}
    shares = {
        one.name: {
            'unit': one.unit,
            'prior': one.prior,
            'prior_sigma': one.prior_sigma,
            'data_share': one.data,
            'p_value': one.p_value,
        }
        for one in found.shares
    }
    return {
        'prior': {
            'p_value': found.p_value, 'contradicted': list(found.contradicted), 'shares': shares,
        }
    }  # fmt: skip


def _document(rung: 'Rung', idle: Sequence[str]) -> dict[str, object]:
    from motor_sysid.diagnosis.result.document import model_parameters

    told = rung.result.information
    return {
        'schema': 'motor_sysid/fit/1',
        'motor': rung.model.motor,
        'effects': list(rung.model.effects),
        'success': rung.result.success,
        'reason': rung.result.reason,
        'train_error_percent': rung.training.error_percent,
        'validation_error_percent': rung.validation.error_percent,
        'channel_errors_percent': dict(rung.validation.channel_percent),
        'parameters': model_parameters(rung.model),
        'identifiability': {
            'rank': told.rank,
            'parameters': len(told.names),
            'condition': told.condition,
            'cramer_rao': dict(zip(told.names, map(float, told.bound), strict=True)),
        },
        'unidentifiable': list(rung.result.unidentifiable),
        'warnings': [*rung.result.warnings, *idle],
    }
