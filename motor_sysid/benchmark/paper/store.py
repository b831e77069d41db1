"""The results file of the paper's benchmark: a JSON line for each task."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields

from motor_sysid.benchmark.lines import LinesFile
from motor_sysid.benchmark.paper.motor import HiddenRun, MotorRun
from motor_sysid.benchmark.paper.runs import Run

AnyRun = Run | MotorRun | HiddenRun

_KINDS: Mapping[str, type[AnyRun]] = {'run': Run, 'motor': MotorRun, 'hidden': HiddenRun}


@dataclass(frozen=True)
class Done:
    """What a task gave.

    Attributes
    ----------
    task:
        Its name.
    runs:
        Its runs, all of one kind.
    """

    task: str
    runs: tuple[AnyRun, ...]


class PaperFile(LinesFile[Done]):
    """Tasks of the paper's benchmark by name; see `LinesFile`."""

    schema = 'motor_sysid/paper-benchmark-results/1'

    @staticmethod
    def name_of(entry: Done) -> str:
        """Return the name of the task."""
        return entry.task

    @staticmethod
    def encoded(entry: Done) -> dict[str, object]:
        """Return plain values for JSON."""
        kind = next(k for k, made in _KINDS.items() if isinstance(entry.runs[0], made))
        return {'task': entry.task, 'kind': kind, 'runs': [asdict(run) for run in entry.runs]}

    @staticmethod
    def decoded(document: Mapping[str, object]) -> Done:
        """Read what `encoded` gave."""
        made, runs = _KINDS[str(document['kind'])], document['runs']
        if not isinstance(runs, list):
            raise ValueError('`runs` is no list')
        return Done(str(document['task']), tuple(_decoded(made, run) for run in runs))


def _decoded(made: type[AnyRun], document: Mapping[str, object]) -> AnyRun:
    if set(document) != {f.name for f in fields(made)}:
        raise ValueError(f'fields of {made.__name__} differ')
    return made(**{k: tuple(v) if isinstance(v, list) else v for k, v in document.items()})  # type: ignore[arg-type]
