"""Machine code that numba makes, kept on disk for as long as it is that of this package.

What numba keeps beside a file holds for that file alone: the functions of other files that were
compiled into it, and the constants that it took from them, may be of an earlier version.  So the
code of each version has a folder of its own.
"""

from collections.abc import Callable
from functools import cache
import hashlib
import os
from pathlib import Path
from typing import Any

import numba

from motor_sysid.user_folders import user_folder

config: Any = numba.config
njit: Any = numba.njit

_PACKAGE = Path(__file__).resolve().parent


def kept(**options: object) -> Callable[[Any], Any]:
    """Compile a function of this package with numba's options, and keep what comes of it.

    ``NUMBA_CACHE_DIR`` says where, by default the folder `numba` in `cache_directory`.
    """

    def compiled(function: Callable[..., object]) -> object:
        folder = Path(function.__code__.co_filename).resolve().parent
        before = config.CACHE_DIR
        parent = Path(before) if before else cache_directory() / 'numba'
        config.CACHE_DIR = str(parent / _version(folder))
        try:
            return njit(cache=True, **options)(function)
        finally:
            config.CACHE_DIR = before

    return compiled


def cache_directory() -> Path:
    """Return the folder of what is compiled, made by who writes to it.

    ``MOTOR_SYSID_CACHE`` overrides ``~/.cache/motor_sysid``.  Code is loaded from there, so it is
    never a place where others can write.
    """
    given = os.environ.get('MOTOR_SYSID_CACHE')
    return Path(given) if given else user_folder('XDG_CACHE_HOME', '.cache')


@cache
def _version(folder: Path) -> str:
    """Return a name for the text of all that functions of a folder may call.

    That is what lies in it, in the folders around it, and in `motor_sysid.physics`.
    """
    around = [above for above in folder.parents if above.is_relative_to(_PACKAGE)]
    files = {*folder.rglob('*.py'), *(file for above in around for file in above.glob('*.py'))}
    files |= {*(_PACKAGE / 'physics').glob('*.py')}
    text = hashlib.sha256()
    for file in sorted(files):
        text.update(file.read_bytes())
    return text.hexdigest()[:16]
