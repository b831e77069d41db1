"""Run the diagnosis over many cases, in parallel, and collect what it says."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import as_completed, ProcessPoolExecutor
from multiprocessing import get_context
import os
import time

from motor_sysid.benchmark.cases import draw, Scenario
from motor_sysid.benchmark.outcome import failed, judged, Result
from motor_sysid.diagnosis.diagnose import diagnose
from motor_sysid.physics.effects import catalogue

Progress = Callable[[Result, int, int], None]

_THREADS = ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS')


def run(
    scenarios: Sequence[Scenario],
    *,
    seed: int = 0,
    first: int = 0,
    workers: int = 1,
    progress: Progress | None = None,
) -> list[Result]:
    """Draw, diagnose and judge one case for each scenario.

    Parameters
    ----------
    scenarios:
        What is to be drawn.
    seed, first:
        Seed of all cases, and number of the first one.
    workers:
        Processes; the results do not depend on it.
    progress:
        Told each result, how many are done, and how many there are.
    """
    tasks = [(scenario, seed, first + k) for k, scenario in enumerate(scenarios)]
    results = []
    for result in _each(tasks, workers):
        results.append(result)
        if progress:
            progress(result, len(results), len(tasks))
    return sorted(results, key=lambda r: r.index)


def one(scenario: Scenario, seed: int, index: int) -> Result:
    """Draw, diagnose and judge one case; a diagnosis that raises is a result, too."""
    case = draw(scenario, seed, index)
    effects = offered(scenario)
    begun = time.perf_counter()
    try:
        found = diagnose(case.train, case.valid, motor='brushed_dc', effects=effects)
    except Exception as error:  # noqa: BLE001 - whatever it raises is what the benchmark reports
        return failed(case, f'{type(error).__name__}: {error}', time.perf_counter() - begun)
    return judged(case, found, time.perf_counter() - begun)


def offered(scenario: Scenario) -> list[str]:
    """Return the candidates that the diagnosis is given.

    What is withheld goes, and with it whatever generalises it: that would be the truth, too.
    """
    hidden = set(scenario.effects) if scenario.withheld else set()
    return [
        key
        for key, one in catalogue().items()
        if key not in hidden and not hidden & set(one.card.generalises)
    ]


def _each(tasks: Sequence[tuple[Scenario, int, int]], workers: int) -> Iterable[Result]:
    if workers <= 1:
        yield from (one(*task) for task in tasks)
        return
    for name in _THREADS:  # read by the libraries of the processes that are started below
        os.environ.setdefault(name, '1')
    with ProcessPoolExecutor(workers, get_context('spawn')) as pool:
        for done in as_completed([pool.submit(one, *task) for task in tasks]):
            yield done.result()
