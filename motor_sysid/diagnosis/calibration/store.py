"""Calibrations as YAML files in the user's configuration folder, one for each motor and class."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
import hashlib
import os
from pathlib import Path

import yaml

from motor_sysid import __version__
from motor_sysid.diagnosis.calibration.calibration import Calibration
from motor_sysid.diagnosis.calibration.situation import Situation
from motor_sysid.errors import UserError
from motor_sysid.user_folders import user_folder
from motor_sysid.whole_file import write_whole

SCHEMA = 'motor_sysid/calibration/1'


def calibration_folder() -> Path:
    """Return where calibrations are kept.

    ``MOTOR_SYSID_CALIBRATION`` overrides ``~/.config/motor_sysid/calibration``.
    """
    given = os.environ.get('MOTOR_SYSID_CALIBRATION')
    return Path(given) if given else user_folder('XDG_CONFIG_HOME', '.config') / 'calibration'


def save_calibration(calibration: Calibration, path: Path | None = None) -> Path:
    """Write a calibration; the file appears whole or not at all.

    Parameters
    ----------
    path:
        The file; by default one in the user's folder that is named after motor and class.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    target = path or calibration_folder() / file_name(calibration)
    if target.is_dir():
        raise UserError(f'cannot write calibration {target}: it is a folder; name a file in it')
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        write_whole(target, dump_calibration(calibration))
    except OSError as problem:
        raise UserError(f'cannot write calibration {target}: {problem.strerror}') from problem
    return target


def load_calibration(path: Path) -> Calibration:
    """Read a calibration.

    Raises
    ------
    UserError
        If the file cannot be read or is no calibration.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as problem:
        reason = ' '.join(str(problem).split())
        raise UserError(f'cannot read calibration {path}: {reason}') from problem
    try:
        return parse_calibration(content)
    except (KeyError, TypeError, ValueError) as problem:
        raise UserError(
            f'{path} is no calibration ({problem}); make one with `motor-sysid calibrate`'
        ) from problem


def load_calibrations(
    folder: Path | None = None, *, complain: Callable[[str], None]
) -> list[Calibration]:
    """Read every calibration of a folder, by default the user's; none if there is no folder.

    Parameters
    ----------
    complain:
        Told of each file that cannot be read; it is passed over.
    """
    found = []
    for path in sorted((folder or calibration_folder()).glob('*.yaml')):
        try:
            found.append(load_calibration(path))
        except UserError as problem:
            complain(str(problem))
    return found


def file_name(calibration: Calibration) -> str:
    """Return the file name for a motor and class: made again, it takes the old one's place."""
    s = calibration.situation
    rounded = {name: f'{value:.1g}' for name, value in sorted(calibration.parameters.items())}
    text = repr((asdict(s), rounded, calibration.effects))
    return f'{s.motor}-{s.loop}-{s.shape}-{hashlib.sha256(text.encode()).hexdigest()[:8]}.yaml'


def dump_calibration(calibration: Calibration) -> str:
    """Return the YAML text of a calibration."""
    situation = asdict(calibration.situation)
    content = {
        'schema': SCHEMA,
        'written_by': f'motor_sysid {__version__}',
        'situation': {**situation, 'outputs': list(situation['outputs'])},
        'parameters': dict(calibration.parameters),
        'effects': list(calibration.effects),
        'runs': len(calibration.evidence),
        'evidence': list(calibration.evidence),
        'passing': list(calibration.passing),
        'catalogue': dict(calibration.catalogue),
        'provenance': dict(calibration.provenance),
    }
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=99)


def parse_calibration(content: object) -> Calibration:
    """Return the calibration that a YAML tree describes.

    Raises
    ------
    KeyError, TypeError, ValueError
        If it describes none.
    """
    if not isinstance(content, dict) or content.get('schema') != SCHEMA:
        raise ValueError(f'its schema is not {SCHEMA}')
    given = content['situation']
    if not isinstance(given, dict):
        raise ValueError('its situation is no mapping')
    values = {f.name: given[f.name] for f in fields(Situation)}
    values['outputs'] = tuple(values['outputs'])
    return Calibration(
        Situation(**values),
        {str(k): float(str(v)) for k, v in _mapping(content, 'parameters').items()},
        tuple(str(key) for key in content['effects']),
        tuple(float(v) for v in content['evidence']),
        tuple(float(v) for v in content['passing']),
        {str(k): str(v) for k, v in _mapping(content, 'catalogue').items()},
        {str(k): str(v) for k, v in _mapping(content, 'provenance').items()},
    )


def _mapping(content: Mapping[str, object], name: str) -> Mapping[str, object]:
    found = content[name]
    if not isinstance(found, dict):
        raise ValueError(f'its {name} is no mapping')
    return found
