"""The results file: a JSON line for each case, so that a stopped benchmark can go on."""

from collections.abc import Iterable
import hashlib
import json
from pathlib import Path
from types import TracebackType

from motor_sysid.benchmark.outcome import Result
from motor_sysid.errors import UserError

SCHEMA = 'motor_sysid/benchmark-results/1'

_ROOMS = ('signals', 'physics', 'estimation', 'diagnosis', 'benchmark')
_SHOWN = ('benchmark/page.py', 'benchmark/style.py', 'benchmark/tables.py', 'benchmark/targets.py')


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


class ResultsFile:
    """Results so far, and a place for more; a context manager.

    Attributes
    ----------
    results:
        Case name to result.

    Raises
    ------
    UserError
        On opening, if the file is no results file, or one of another seed or state of the program.
    """

    def __init__(self, path: Path, seed: int, *, fresh: bool = False) -> None:
        self.path = path
        self.results: dict[str, Result] = {}
        head = {'schema': SCHEMA, 'seed': seed, 'program': state_of_program()}
        try:
            if fresh or not path.exists() or not path.stat().st_size:
                path.write_text(json.dumps(head) + '\n', encoding='utf-8')
            else:
                found, self.results = read_results(path)
                _refuse_others(path, found, head)
                _cut_torn_line(path)
            self._stream = path.open('a', encoding='utf-8')
        except OSError as problem:
            raise UserError(f'cannot write results to {path}: {problem.strerror}') from problem

    def add(self, result: Result) -> None:
        """Append a result; it is on disk when this returns."""
        self._stream.write(json.dumps(result.as_dict()) + '\n')
        self._stream.flush()
        self.results[result.case] = result

    def __enter__(self) -> 'ResultsFile':
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


def read_results(path: Path) -> tuple[dict[str, object], dict[str, Result]]:
    """Read a results file; a last line that was cut off is left out.

    Returns
    -------
    What the first line says, and case name to result.

    Raises
    ------
    UserError
        If it cannot be read or is no results file.
    """
    try:
        lines = path.read_text(encoding='utf-8').splitlines(keepends=True)
        head = json.loads(lines[0])
        if not isinstance(head, dict) or head.get('schema') != SCHEMA:
            raise ValueError('its first line does not say so')
        whole = [line for line in lines[1:] if line.endswith('\n')]
        results = [Result.from_dict(json.loads(line)) for line in whole]
    except OSError as problem:
        raise UserError(f'cannot read {path}: {problem.strerror}') from problem
    except (ValueError, KeyError, TypeError, IndexError, AttributeError) as problem:
        raise UserError(f'{path} is no results file of this benchmark: {problem}') from problem
    return head, {one.case: one for one in results}


def merged(paths: Iterable[Path]) -> tuple[str, list[Result]]:
    """Read several results files, of other seeds say, for one report.

    Returns
    -------
    The program's state, or several joined by commas; and all results.
    """
    states: list[str] = []
    results: list[Result] = []
    for path in paths:
        head, found = read_results(path)
        states.append(str(head.get('program')))
        results.extend(found.values())
    return ', '.join(sorted(set(states))), results


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
