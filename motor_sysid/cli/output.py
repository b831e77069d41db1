"""What the verbs write: looked at before the work, and as much of it as can be written."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import json
import math
import os
from pathlib import Path
import sys
from typing import TextIO, TYPE_CHECKING

from motor_sysid.errors import UserError
from motor_sysid.whole_file import write_whole

if TYPE_CHECKING:
    from motor_sysid.physics.model import Model


def new_file(text: str) -> Path:
    """Return the path of a file to write; the type of an option.

    It is looked at before any work is done, which would be lost with it.

    Raises
    ------
    UserError
        If no such file can be written: it is a folder, or its folder is not there or not writable.
    """
    path = Path(text)
    if not path.parent.is_dir():
        raise UserError(f'cannot write {path}: there is no folder {path.parent}; make it first')
    return new_page(text)


def new_page(text: str) -> Path:
    """Return the path of a file whose folder is made with it; see `new_file`."""
    path = Path(text)
    if path.is_dir():
        raise UserError(f'cannot write {path}: it is a folder; name a file in it')
    above = path if path.exists() else next(p for p in path.absolute().parents if p.exists())
    if not (path.exists() or above.is_dir()):
        raise UserError(f'cannot write {path}: {above} is no folder; name another')
    if not os.access(above, os.W_OK):
        raise UserError(f'cannot write {path}: {above} is not writable for you; name another')
    return path


def new_record(text: str) -> Path:
    """Return the path of a table or of a bag folder to write; see `new_file`.

    Raises
    ------
    UserError
        If neither can be written there, or the name is that of a file of another kind.
    """
    from motor_sysid.recording.save import is_table

    path = Path(text)
    if is_table(path):
        return new_file(text)
    if path.exists():
        raise UserError(f'{path} exists already; choose another name for the bag')
    return new_page(text)


def json_target(text: str) -> Path | TextIO:
    """Return where JSON goes, the type of --json: a new file, or stdout for ``-``."""
    return sys.stdout if text == '-' else new_file(text)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Say in words that a file or folder cannot be written."""
    try:
        yield
    except OSError as problem:
        raise UserError(f'cannot write {path}: {problem.strerror}') from problem


def write_text(text: str, path: Path, what: str) -> None:
    """Write a file, and say `what` lies where.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    with writing(path):
        write_whole(path, text)
    print(f'{what}: {path}')


def write_json(document: object, target: Path | TextIO | None) -> None:
    """Write a result as JSON, if that was asked for; see `write_text`.

    JSON has no infinity and no NaN: numbers that are not finite become null.
    """
    if target is None:
        return
    text = json.dumps(_finite(document), indent=1, allow_nan=False) + '\n'
    if isinstance(target, Path):
        write_text(text, target, 'result')
    else:
        target.write(text)


def _finite(document: object) -> object:
    if isinstance(document, dict):
        return {name: _finite(value) for name, value in document.items()}
    if isinstance(document, list | tuple):
        return [_finite(value) for value in document]
    return None if isinstance(document, float) and not math.isfinite(document) else document


def write_each(*writes: Callable[[], None]) -> None:
    """Write one result after the other: one that cannot be written does not cost the others.

    Raises
    ------
    UserError
        At the end, with what could not be written.
    """
    problems = []
    for write in writes:
        try:
            write()
        except UserError as problem:
            problems.append(str(problem))
    if problems:
        raise UserError('; '.join(problems))


def write_model(model: 'Model | None', path: Path | None) -> None:
    """Write a model (YAML), if there is one and a file was asked for, and say where it lies."""
    from motor_sysid.physics.store import save_model

    if path is not None and model is not None:
        save_model(model, path)
        print(f'model: {path}')
