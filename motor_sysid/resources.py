"""Find the launch, config and msg_config files that ship with the package.

They lie beside the package in a source tree (also when installed editable or with colcon's
``--symlink-install``) and under ``share/motor_sysid`` of the prefix in every other installation:
a virtual environment, a colcon workspace, a ROS distribution.
"""

from pathlib import Path

from motor_sysid.errors import UserError

PACKAGE = Path(__file__).resolve().parent


def shipped_directory(name: str) -> Path:
    """Return the directory ``launch``, ``config`` or ``msg_config`` of this installation.

    Raises
    ------
    UserError
        If this installation has no such directory.
    """
    candidates = [
        PACKAGE.parent / name,
        *(parent / 'share' / 'motor_sysid' / name for parent in PACKAGE.parents),
    ]
    for candidate in candidates:
        if (candidate.parent / 'package.xml').is_file() and candidate.is_dir():
            return candidate
    raise UserError(
        f'this installation of motor_sysid has no {name} directory; looked in '
        f'{candidates[0]} and in share/motor_sysid above {PACKAGE}; install it again'
    )


def shipped_file(directory: str, name: str) -> Path:
    """Return a file of such a directory by its name, with or without ``.yaml``.

    Raises
    ------
    UserError
        If there is no such file; the message lists those that there are.
    """
    folder = shipped_directory(directory)
    for candidate in (folder / name, folder / f'{name}.yaml'):
        if candidate.is_file():
            return candidate
    known = sorted(p.relative_to(folder).as_posix() for p in folder.rglob('*') if p.is_file())
    raise UserError(
        f'{directory} has no `{name}`; it has {", ".join(known) or "no files"}; '
        'give one of these or the path of a file of your own'
    )
