"""What the diagnosis says of real records: one line for each, with its ladder of errors.

    .venv/bin/python bench/real_records.py FOLDER --markdown docs/real_records.md

FOLDER holds one folder for each data set; docs/real_records.md says where they come from.  Records
that are not there are left out, and said to be.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
import json
from multiprocessing import get_context
from pathlib import Path
import sys
import time

from pages import filled, markdown

from motor_sysid.signals.record import Record

HEAD = ('record', 'known to be missing', 'verdict', 'named, in order', 'held-out error, %')
CONFIGS = Path(__file__).with_suffix('')


@dataclass(frozen=True)
class Case:
    """One diagnosis.

    Attributes
    ----------
    name:
        Short name of the record.
    train, valid:
        Files; without `valid` the last fifth of each record is held back.
    config:
        Name of a shipped msg_config, or a file beside this program.
    motor:
        Motor kind.
    expected:
        What is known to be there, in the words of the source.
    returns:
        Whether each file holds a way there and the way back, which count as two records.
    """

    name: str
    train: tuple[str, ...]
    valid: tuple[str, ...]
    config: str
    motor: str
    expected: str
    returns: bool = False


CASES = (
    Case('emps', ('emps/emps_train.csv.gz',), (), 'emps', 'mechanical_axis',
         'Coulomb friction, offset, friction that depends on direction'),
    Case('bam_xl330', tuple(f'bam_xl330/kp{kp}_{name}.csv.gz' for kp in (100, 200)
                            for name in ('sin_sin', 'sin_time_square', 'up_and_down')),
         tuple(f'bam_xl330/kp800_{name}.csv.gz' for name in ('sin_sin', 'sin_time_square')),
         'bam_xl330', 'brushed_dc_reduced', 'gravity, friction that grows with the load'),
    Case('laas map', ('laas_cogging/standstill_map.csv.gz',), (), 'laas_map.yaml', 'inverse_axis',
         'cogging of 72 waves per turn, and of 18, 12 and more; stiction', returns=True),
    Case('laas accel', ('laas_cogging/accel_sine_2Hz.csv.gz',), (), 'laas_q_axis.yaml',
         'pmsm', 'Coulomb friction, inverter dead time, drag'),
    Case('laas rolling', ('laas_cogging/rolling_uq1V_a.csv.gz',), (), 'laas_q_axis.yaml',
         'pmsm', 'cogging (one speed, one direction)'),
    Case('frc drivetrain', ('frc_sysid/team5409_2022_drivetrain.csv.gz',), (),
         'wpilib_sysid_drivetrain', 'brushed_dc_reduced', 'static friction, dead time of 88 ms'),
    Case('frc roller', ('frc_sysid/team581_2022_intake_roller.csv.gz',), (), 'wpilib_sysid',
         'brushed_dc_reduced', 'nothing'),
    Case('odrive_maxon chirps', ('odrive_maxon/chirp1.csv.gz', 'odrive_maxon/chirp2.csv.gz'),
         ('odrive_maxon/chirp3.csv.gz',), 'odrive_csv.yaml', 'brushed_dc_reduced',
         'dead time of the speed estimate; no friction'),
    Case('odrive_maxon steps', ('odrive_maxon/step1.csv.gz', 'odrive_maxon/step2.csv.gz'),
         ('odrive_maxon/step3.csv.gz',), 'odrive_csv.yaml', 'brushed_dc_reduced',
         'dead time of the speed estimate; no friction'),
    Case('bldc_axis_deadtime', ('bldc_axis_deadtime/bldc_axis_train.csv.gz',), (),
         'bldc_axis.yaml', 'brushed_dc_reduced', 'dead time, drive and coast, Coulomb drag'),
    Case('ced low', ('ced/ced_uniform_train.csv.gz',), (), 'ced_low.yaml', 'brushed_dc_reduced',
         'sensor blind to the sign, belt resonance'),
    Case('ced high', ('ced/ced_uniform_train.csv.gz',), (), 'ced_high.yaml',
         'brushed_dc_reduced', 'sensor blind to the sign, belt resonance'),
    Case('dc_motor_generator', ('dc_motor_generator/motor_generator_train.csv.gz',), (),
         'motor_generator.yaml', 'brushed_dc_reduced',
         'drive and coast obey different equations, Coulomb friction, a second lag'),
)  # fmt: skip


def main() -> None:
    """Diagnose all and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('folder', type=Path)
    parser.add_argument('--only', nargs='*', default=None, help='names of records')
    parser.add_argument('--workers', type=int, default=1)
    parser.add_argument('--json', type=Path)
    parser.add_argument('--markdown', type=Path)
    args = parser.parse_args()
    chosen = [c for c in CASES if args.only is None or c.name in args.only]
    with ProcessPoolExecutor(args.workers, get_context('spawn')) as pool:
        jobs = [pool.submit(look, case, args.folder) for case in chosen]
        rows = []
        for case, job in zip(chosen, jobs, strict=True):
            rows.append({'record': case.name, 'expected': case.expected, **job.result()})
            print(*cells(rows[-1]), sep=' | ', flush=True)  # noqa: T201
    if args.json:
        args.json.write_text(json.dumps(rows, indent=1) + '\n')
    if args.markdown:
        args.markdown.write_text(filled(args.markdown, 'table', markdown(HEAD, map(cells, rows))))


def look(case: Case, folder: Path) -> dict[str, object]:
    """Diagnose one record; an error is a result, too."""
    from motor_sysid.diagnosis import diagnose
    from motor_sysid.errors import UserError
    from motor_sysid.recording import load

    begun = time.perf_counter()
    config = CONFIGS / case.config if case.config.endswith('.yaml') else case.config
    try:
        train, valid = (
            [r for name in names for r in load(folder / name, config).records]
            for names in (case.train, case.valid)
        )
        if case.returns:
            train = [half for record in train for half in there_and_back(record)]
        found = diagnose(train, valid, motor=case.motor)
    except UserError as error:
        return {'verdict': 'refused', 'effects': [], 'ladder': [], 'reasons': [str(error)]}
    return {
        'verdict': found.verdict.value,
        'effects': list(found.effects),
        'ladder': [round(step.validation_error_percent, 3) for step in found.steps],
        'train': [round(step.train_error_percent, 3) for step in found.steps],
        'floor': round(found.noise_floor_percent, 3),
        'rivals': {
            c.effect: list(c.confusable_with)
            for step in found.steps
            for c in step.candidates
            if c.confusable_with
        },
        'reasons': list(found.reasons),
        'seconds': round(time.perf_counter() - begun, 1),
    }


def there_and_back(record: Record) -> tuple[Record, Record]:
    """Cut a record where its position turns back."""
    turn = int(record['position'].argmax())
    return record.slice(0, turn), record.slice(turn, len(record))


def cells(row: dict[str, object]) -> tuple[str, ...]:
    """Return one row of the table."""
    ladder = ' → '.join(f'{value:.3g}' for value in _list(row['ladder']))
    effects = ', '.join(f'`{key}`' for key in _list(row['effects'])) or '–'
    return str(row['record']), str(row['expected']), str(row['verdict']), effects, ladder


def _list(value: object) -> Sequence[object]:
    assert isinstance(value, list)
    return value


if __name__ == '__main__':
    sys.exit(main())
