"""The results file of the diagnosis: a JSON line for each case."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from motor_sysid.benchmark.lines import LinesFile
from motor_sysid.benchmark.outcome import Result


class ResultsFile(LinesFile[Result]):
    """Cases of the diagnosis benchmark by name; see `LinesFile`."""

    schema = 'motor_sysid/benchmark-results/1'

    @staticmethod
    def name_of(entry: Result) -> str:
        """Return the name of the case."""
        return entry.case

    @staticmethod
    def encoded(entry: Result) -> dict[str, object]:
        """Return plain values for JSON."""
        return entry.as_dict()

    @staticmethod
    def decoded(document: Mapping[str, object]) -> Result:
        """Read what `encoded` gave."""
        return Result.from_dict(document)


def merged(paths: Iterable[Path]) -> tuple[str, list[Result]]:
    """Read several results files, of other seeds say, for one report.

    Returns
    -------
    The program's state, or several joined by commas; and all results.
    """
    states: list[str] = []
    results: list[Result] = []
    for path in paths:
        head, found = ResultsFile.read(path)
        states.append(str(head.get('program')))
        results.extend(found.values())
    return ', '.join(sorted(set(states))), results
