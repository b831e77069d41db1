"""Where a user's caches and settings lie."""

import os
from pathlib import Path
import stat
import tempfile

NAME = 'motor_sysid'


def user_folder(variable: str, usual: str) -> Path:
    """Return our folder below the one that an XDG variable names, by default `usual` at home.

    Who has no home gets a folder of his own for temporary files, in which nobody else can write:
    code and settings are read from there.
    """
    given = os.environ.get(variable)
    if given:
        return Path(given) / NAME
    try:
        return Path.home() / usual / NAME
    except RuntimeError:
        return _temporary() / usual / NAME


def _temporary() -> Path:
    """Return a folder for temporary files that is this user's, and his alone."""
    own = Path(tempfile.gettempdir()) / f'{NAME}-{os.getuid()}'
    try:
        own.mkdir(mode=0o700, exist_ok=True)
        found = own.lstat()
    except OSError:
        return Path(tempfile.mkdtemp(prefix=NAME))
    mine = found.st_uid == os.getuid() and stat.S_ISDIR(found.st_mode)
    closed = not found.st_mode & (stat.S_IRWXG | stat.S_IRWXO)
    return own if mine and closed else Path(tempfile.mkdtemp(prefix=NAME))
