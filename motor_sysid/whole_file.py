"""A text file that is written whole or not at all."""

import os
from pathlib import Path
import shutil


def write_whole(path: Path, text: str) -> None:
    """Write a file; a reader sees what was there before or all of it.

    Where the path is a link, the file that it leads to is written; what is no file (a device, a
    pipe) is written to as it is, for it must stay that.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file():
        target.write_text(text, encoding='utf-8')
        return
    fresh = target.with_name(f'.{target.name}.{os.getpid()}.part')
    try:
        fresh.write_text(text, encoding='utf-8')
        if target.exists():
            shutil.copymode(target, fresh)
        fresh.replace(target)
    finally:
        fresh.unlink(missing_ok=True)
