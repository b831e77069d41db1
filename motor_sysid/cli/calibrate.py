"""`motor-sysid calibrate`: how much evidence chance makes on the user's own motor."""

import argparse
from collections.abc import Sequence
from functools import partial
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

from motor_sysid.cli.common import (
    add_data_arguments,
    add_effect_file_argument,
    load_effect_files,
    number,
    progress,
    whole,
)
from motor_sysid.cli.output import new_page, write_each, write_json
from motor_sysid.cli.reading import load_parts, refuse_two_motors
from motor_sysid.errors import UserError

if TYPE_CHECKING:
    from motor_sysid.diagnosis.calibration.calibration import Calibration
    from motor_sysid.diagnosis.calibration.null import Chance, Plan
    from motor_sysid.physics.model import Model
    from motor_sysid.signals.record import Record

HELP = 'find the threshold of evidence for your motor, from complete-model runs of it'

FEWEST = 20
LIMIT = 300.0
MOST_LOST = 0.05


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_data_arguments(parser, validate=True)
    parser.add_argument(
        '--model', type=Path, metavar='MODEL',
        help='model (YAML) that lacks nothing; default: what a diagnosis of DATA ends with',
    )  # fmt: skip
    parser.add_argument('--motor', metavar='KIND', help='motor kind; default: what the data allow')
    parser.add_argument(
        '--effects', nargs='+', action='extend', metavar='EFFECT',
        help='look only for these; default: all',
    )
    parser.add_argument(
        '--runs', type=int, default=300, metavar='N', help='complete-model runs (default: 300)'
    )
    parser.add_argument(
        '--alpha', type=number('--alpha', 0, 1), default=0.01, metavar='RATE',
        help='false-alarm rate to show the threshold of (default: %(default)g)',
    )  # fmt: skip
    parser.add_argument(
        '--seed', type=whole('--seed', 0), default=0, metavar='N',
        help='of the runs (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '--workers', type=whole('--workers', 1), default=os.cpu_count() or 1, metavar='N',
        help='processes; the result does not depend on it (default: %(default)s)',
    )  # fmt: skip
    parser.add_argument(
        '-o', '--out', type=new_page, metavar='FILE',
        help="where to keep it; default: the user's folder, where `diagnose` finds it",
    )  # fmt: skip
    add_effect_file_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Plan, run, conclude, keep."""
    from motor_sysid.diagnosis.calibration.calibration import concluded
    from motor_sysid.diagnosis.calibration.null import make_plan
    from motor_sysid.physics.effects import catalogue

    _refuse(args)
    load_effect_files(args.effect_file, args.effects or ())
    train, held = load_parts(args)
    plan = make_plan(
        _complete(args, train, held),
        train,
        held,
        fraction=args.hold_back,
        candidates=args.effects or list(catalogue()),
        seed=args.seed,
        tell=progress(),
    )
    print('\n'.join(_planned(plan)))
    found = concluded(plan, _runs(plan, args), [*train, *held])
    print('\n'.join(summary(found, args.alpha)))
    write_each(
        lambda: _keep(found, args.out),
        lambda: write_json(_document(found, args.alpha), args.json),
    )
    return 0


def _keep(found: 'Calibration', path: Path | None) -> None:
    from motor_sysid.diagnosis.calibration.store import save_calibration

    print(f'calibration: {save_calibration(found, path)}')


def _refuse(args: argparse.Namespace) -> None:
    if args.runs < FEWEST:
        raise UserError(
            f'--runs {args.runs} tells nothing about rare events; make it at least {FEWEST}, '
            'better 300'
        )
    refuse_two_motors(args)


def _complete(
    args: argparse.Namespace, train: 'Sequence[Record]', held: 'Sequence[Record]'
) -> 'Model':
    """Return the model that lacks nothing: the given one, or what a diagnosis ends with."""
    from motor_sysid.diagnosis import diagnose, Settings, Verdict
    from motor_sysid.physics.store import load_model

    if args.model:
        return load_model(args.model)
    found = diagnose(
        train,
        held,
        motor=args.motor,
        effects=args.effects,
        settings=Settings(validation_fraction=args.hold_back),
        progress=progress(),
    )
    if found.verdict is Verdict.INSUFFICIENT_DATA:
        raise UserError(f'{found.reasons[0]} There is nothing to calibrate for.')
    if found.verdict is Verdict.UNKNOWN_EFFECT:
        print(
            'note: something unknown is missing here; it counts as noise, so the threshold will '
            'be too high rather than too low'
        )
    return found.model


def _planned(plan: 'Plan') -> list[str]:
    """Say what will be simulated."""
    model = ' + '.join([f'linear {plan.model.kind.title}', *plan.model.effects])
    lines = [f'complete model: {model}']
    lines += [f'driven by: {words}' for words in plan.driven_by]
    lines += [f'noise: {words}' for words in plan.noise.words]
    off = plan.noise.mismatch_db
    return [*lines, f'spectra of real and simulated errors agree to {off:.2g} dB']


def _runs(plan: 'Plan', args: argparse.Namespace) -> 'list[Chance]':
    from motor_sysid.benchmark import workers
    from motor_sysid.cli.countdown import Countdown
    from motor_sysid.diagnosis.calibration.null import chance

    done: list[Chance] = []
    lost: list[str] = []
    with Countdown(args.runs, 'complete-model runs') as count:
        for _, answer in workers.each(
            range(args.runs),
            partial(chance, plan),
            workers=args.workers,
            limit=LIMIT,
            warm_up=partial(load_effect_files, args.effect_file),
        ):
            if isinstance(answer, workers.Lost):
                lost.append(answer.reason)
            else:
                done.append(answer)
            count(len(done) + len(lost))
    if len(lost) > MOST_LOST * args.runs:
        raise UserError(
            f'{len(lost)} of {args.runs} runs came to nothing ({lost[0]}); the model is not one '
            'that can be run like this recording'
        )
    if lost:
        print(f'note: {len(lost)} of {args.runs} runs came to nothing and do not count')
    return done


def summary(found: 'Calibration', alpha: float) -> list[str]:
    """Return what was found as lines of text."""
    one, rate = found.threshold(alpha), f'{100 * alpha:g} %'
    evidence = found.quantile(alpha).value
    low, high = one.limits
    lines = [
        '',
        f'Threshold for a false-alarm rate of {rate}: dBIC {one.delta_bic:.3g}',
        f'{one.runs} complete-model runs: something passes all gates at this threshold in '
        f'{100 * one.rate[0]:.2g} to {100 * one.rate[1]:.2g} % of recordings (95 %)',
        f'noise alone, gates aside, makes more than dBIC {evidence:.3g} [{low:.3g}, {high:.3g}] '
        f'in {rate} of recordings',
    ]
    if alpha * one.runs < 1.0:
        lines[-1] += f', extrapolated {1 / (alpha * one.runs):.2g} times beyond the runs'
    if one.extrapolated:
        lines.append(
            f'So few runs cannot show {rate} directly: the threshold is that of the evidence '
            f'alone, which is safe but asks too much. {math.ceil(3 / alpha)} runs could show it.'
        )
    return lines


def _document(found: 'Calibration', alpha: float) -> dict[str, object]:
    one = found.threshold(alpha)
    return {
        'schema': 'motor_sysid/calibration/1',
        'alpha': alpha,
        'threshold': one.delta_bic,
        'rate': list(one.rate),
        'quantile': found.quantile(alpha).value,
        'limits': list(one.limits),
        'runs': one.runs,
        'extrapolated': one.extrapolated,
        'evidence': found.evidence,
        'passing': found.passing,
        'provenance': dict(found.provenance),
    }

