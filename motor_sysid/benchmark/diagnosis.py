"""Run the diagnosis over many cases, in parallel, and collect what it says."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
import time

from motor_sysid.benchmark import workers
from motor_sysid.benchmark.cases import Case, draw
from motor_sysid.benchmark.judge import drawn, judged
from motor_sysid.benchmark.outcome import Named, Result
from motor_sysid.benchmark.peers import PEERS
from motor_sysid.benchmark.reference import with_reference
from motor_sysid.benchmark.scenarios import case_name, named_case, Scenario, schedule
from motor_sysid.benchmark.store import ResultsFile
from motor_sysid.benchmark.suites import suite_of, SUITES
from motor_sysid.diagnosis.diagnose import diagnose
from motor_sysid.diagnosis.result.result import Diagnosis
from motor_sysid.physics.effects import catalogue

Progress = Callable[[Result, int, int], None]

TIME_LIMIT = 300.0
"""Longest time for a case, s: drawing, diagnosis, reference and peers."""


@dataclass(frozen=True)
class Task:
    """A case to be run: its name, the seed, and the peers that run on it, too."""

    case: str
    seed: int
    peers: tuple[str, ...] = ()


def run(
    count: int,
    file: ResultsFile,
    *,
    seed: int = 0,
    peers: tuple[str, ...] = (),
    suite: str = '',
    processes: int = 1,
    limit: float = TIME_LIMIT,
    progress: Progress | None = None,
) -> list[Result]:
    """Draw, diagnose and judge cases; those that the file holds already are not run again.

    Parameters
    ----------
    count:
        Number of cases, from the start of `scenarios.schedule`.
    file:
        Where results are kept.
    seed:
        Seed of all cases.
    peers:
        Names of `peers.PEERS` to compare with.
    suite:
        One of `SUITES` for cases of other motors, without peers.
    processes, limit:
        Worker processes, and longest time for a case, s; the results do not depend on the first.
    progress:
        Told each new result, how many are done, and how many there are.
    """
    names = (
        SUITES[suite].schedule(count) if suite
        else [case_name(*one) for one in schedule(count)]
    )  # fmt: skip
    tasks = [Task(name, seed, peers) for name in names if name not in file.results]
    done = len(names) - len(tasks)
    for task, answer in workers.each(
        tasks, one, workers=processes, limit=limit, warm_up=warm_up
    ):
        result = _lost(task, answer) if isinstance(answer, workers.Lost) else answer
        file.add(result)
        done += 1
        if progress:
            progress(result, done, len(names))
    return [file.results[name] for name in names]


def one(task: Task) -> Result:
    """Draw, diagnose and judge one case; a diagnosis that raises is a result, too."""
    if suite := suite_of(task.case):
        return suite.one_case(task.case, task.seed)
    scenario, number = named_case(task.case)
    case = draw(scenario, task.seed, number)
    begun = time.perf_counter()
    try:
        found = diagnose(
            case.train, case.valid, motor='brushed_dc', effects=offered(scenario)
        )
    except Exception as error:  # noqa: BLE001 - whatever it raises is what the benchmark reports
        seconds = time.perf_counter() - begun
        return replace(drawn(case), seconds=seconds, error=f'{type(error).__name__}: {error}')
    result = judged(case, found, time.perf_counter() - begun)
    return replace(_compared(result, case, found), peers=asked(task.peers, case))


def warm_up() -> None:
    """Compile and load what every case needs, so that no case is charged for it."""
    one(Task('complete/0', 0))


def offered(scenario: Scenario) -> list[str]:
    """Return the candidates that the diagnosis is given.

    What is withheld goes, and with it whatever generalises it: that would be the truth, too.
    """
    hidden = set(scenario.effects) if scenario.withheld else set()
    return [
        key
        for key, effect in catalogue().items()
        if key not in hidden and not hidden & set(effect.card.generalises)
    ]


def _compared(result: Result, case: Case, found: Diagnosis) -> Result:
    """Return the result with the reference; if that cannot be fitted, it says so."""
    try:
        return with_reference(result, case, found)
    except Exception as error:  # noqa: BLE001 - the verdict stands whatever the reference does
        return replace(result, error=f'reference: {type(error).__name__}: {error}')


def asked(peers: tuple[str, ...], case: Case) -> Mapping[str, Named]:
    """Return what each peer names; one that raises names nothing and says why."""
    answers = {}
    for name in peers:
        begun = time.perf_counter()
        try:
            named = PEERS[name].name(case.train, offered(case.scenario))
            why = ''
        except Exception as error:  # noqa: BLE001 - a peer that fails has found nothing
            named, why = (), f'{type(error).__name__}: {error}'
        answers[name] = Named(named, time.perf_counter() - begun, why)
    return answers


def _lost(task: Task, answer: workers.Lost) -> Result:
    """Return the result of a case whose worker gave none."""
    if suite := suite_of(task.case):
        return replace(suite.described(task.case), seconds=answer.seconds, error=answer.reason)
    scenario, _ = named_case(task.case)
    known = not scenario.withheld and all(key in catalogue() for key in scenario.effects)
    return Result(
        task.case, scenario.category.value, scenario.effects, scenario.size, known,
        seconds=answer.seconds, error=answer.reason,
    )  # fmt: skip
