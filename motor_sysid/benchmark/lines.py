"""A file with a JSON line for each thing that is done, so that what was stopped can go on."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from fcntl import flock, LOCK_EX, LOCK_NB
import hashlib
import json
from pathlib import Path
from types import TracebackType
from typing import ClassVar, Generic, Self, TextIO, TypeVar

from motor_sysid.errors import UserError

Entry = TypeVar('Entry')

_ROOMS = ('signals', 'physics', 'estimation', 'diagnosis', 'benchmark')
_SHOWN = (
    'benchmark/page.py', 'benchmark/style.py', 'benchmark/tables.py', 'benchmark/targets.py',
    'benchmark/paper/report.py', 'benchmark/paper/charts.py', 'benchmark/paper/gates.py',
)  # fmt: skip


def state_of_program() -> str:
    """Return a digest of every source file that the results depend on."""
    root = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for room in _ROOMS:
        for path in sorted((root / room).rglob('*.py')):
            name = path.relative_to(root).as_posix()
            if name not in _SHOWN:
                digest.update(name.encode() + b'\0' + path.read_bytes() + b'\0')
    return digest.hexdigest()[:16]


class LinesFile(ABC, Generic[Entry]):
    """Entries so far, and a place for more; a context manager.

    Attributes
    ----------
    schema:
        What the first line of such a file says.
    results:
        Name to entry.

    Raises
    ------
    UserError
        On opening, if the file is none of this kind, one of another seed or state of the program,
        or one that another process writes to.
    """

    schema: ClassVar[str]

    def __init__(self, path: Path, seed: int = 0, *, fresh: bool = False) -> None:
        self.path = path
        self.results: dict[str, Entry] = {}
        head = {'schema': self.schema, 'seed': seed, 'program': state_of_program()}
        try:
            self._stream = path.open('a', encoding='utf-8')
        except OSError as problem:
            raise UserError(f'cannot write results to {path}: {problem.strerror}') from problem
        try:
            _keep_to_oneself(self._stream, path)
            if fresh or not path.stat().st_size:
                path.write_text(json.dumps(head) + '\n', encoding='utf-8')
            else:
                found, self.results = self.read(path)
                _refuse_others(path, found, head)
                _cut_torn_line(path)
        except BaseException:
            self._stream.close()
            raise

    @staticmethod
    @abstractmethod
    def name_of(entry: Entry) -> str:
        """Return what tells it from others."""

    @staticmethod
    @abstractmethod
    def encoded(entry: Entry) -> dict[str, object]:
        """Return plain values for JSON."""

    @staticmethod
    @abstractmethod
    def decoded(document: Mapping[str, object]) -> Entry:
        """Read what `encoded` gave; `KeyError`, `TypeError` or `ValueError` if it is not that."""

    def add(self, entry: Entry) -> None:
        """Append an entry; it is on disk when this returns."""
        self._stream.write(json.dumps(self.encoded(entry)) + '\n')
        self._stream.flush()
        self.results[self.name_of(entry)] = entry

    @classmethod
    def read(cls, path: Path) -> tuple[dict[str, object], dict[str, Entry]]:
        """Read a file; a last line that was cut off is left out.

        Returns
        -------
        What the first line says, and name to entry.

        Raises
        ------
        UserError
            If it cannot be read or is no file of this kind.
        """
        try:
            lines = path.read_text(encoding='utf-8').splitlines(keepends=True)
            head = json.loads(lines[0])
            if not isinstance(head, dict) or head.get('schema') != cls.schema:
                raise ValueError('its first line does not say so')
            whole = [line for line in lines[1:] if line.endswith('\n')]
            entries = [cls.decoded(json.loads(line)) for line in whole]
        except OSError as problem:
            raise UserError(f'cannot read {path}: {problem.strerror}') from problem
        except (ValueError, KeyError, TypeError, IndexError, AttributeError) as problem:
            raise UserError(
                f'{path} is no results file of this benchmark: {problem}'
            ) from problem
        return head, {cls.name_of(one): one for one in entries}

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the file."""
        self._stream.close()


def _keep_to_oneself(stream: TextIO, path: Path) -> None:
    """Lock a file until it is closed; two writers would do every case twice."""
    try:
        flock(stream, LOCK_EX | LOCK_NB)
    except BlockingIOError as problem:
        raise UserError(
            f'another benchmark writes to {path}; wait until it is done, end it, or name another '
            'file with --results'
        ) from problem


def _refuse_others(path: Path, found: dict[str, object], wanted: dict[str, object]) -> None:
    if found != wanted:
        differ = [name for name in wanted if found.get(name) != wanted[name]]
        raise UserError(
            f'{path} holds results of another {" and ".join(differ)} (there '
            f'{", ".join(str(found.get(n)) for n in differ)}, here '
            f'{", ".join(str(wanted[n]) for n in differ)}); name another file with --results, or '
            'start it anew with --fresh'
        )


def _cut_torn_line(path: Path) -> None:
    content = path.read_bytes()
    if not content.endswith(b'\n'):
        path.write_bytes(content[: content.rfind(b'\n') + 1])
