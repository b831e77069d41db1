"""The whole benchmark, in parallel."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from motor_sysid.benchmark import workers
from motor_sysid.benchmark.page import section, whole
from motor_sysid.benchmark.paper import motor, runs
from motor_sysid.benchmark.paper.charts import charts, STYLE
from motor_sysid.benchmark.paper.motor import HiddenRun, MotorRun
from motor_sysid.benchmark.paper.report import Results, tables
from motor_sysid.benchmark.paper.runs import Run, Task
from motor_sysid.benchmark.paper.store import AnyRun, Done, PaperFile
from motor_sysid.benchmark.paper.studies import NOISE
from motor_sysid.errors import UserError

TITLE = 'The benchmark of Wee and Ahmad 2025, done again'
LIMIT = 900.0
"""Longest time for a task, s."""

TORQUE = 0.15
"""Hidden Coulomb torque, N m: a seventh of the viscous torque at the speeds of the record."""

_WITH, _WITHOUT = 5, 20


@dataclass(frozen=True)
class MotorTask:
    """Fits of the motor at one noise, for seeds from 0 on."""

    decibel: int
    count: int


@dataclass(frozen=True)
class HiddenTask:
    """A diagnosis of the motor with a Coulomb torque or none."""

    tau_c: float
    seed: int


AnyTask = Task | MotorTask | HiddenTask


def plan(seeds: int, *, quick: bool = False) -> list[AnyTask]:
    """Return every task, the longest ones first."""
    torques = [TORQUE] if quick else [TORQUE] * _WITH + [0.0] * _WITHOUT
    hidden = [HiddenTask(tau_c, seed) for seed, tau_c in enumerate(torques)]
    motors = [MotorTask(decibel, seeds) for decibel in ((30,) if quick else NOISE)]
    return [*hidden, *motors, *runs.tasks(seeds, quick=quick)]


def work(task: AnyTask) -> tuple[AnyRun, ...]:
    """Do one task."""
    if isinstance(task, Task):
        return runs.one(task)
    if isinstance(task, MotorTask):
        return tuple(motor.fitted(task.decibel, seed) for seed in range(task.count))
    return (motor.hidden(task.tau_c, task.seed),)


def describe(task: AnyTask) -> str:
    """Say what a task is."""
    if isinstance(task, Task):
        return f'{task.study}: {task.method}'
    if isinstance(task, MotorTask):
        return f'motor at {task.decibel} dB'
    return f'hidden torque {task.tau_c:g} N m'


def name_of(task: AnyTask) -> str:
    """Return what tells a task from all others."""
    if isinstance(task, Task):
        return f'{task.study}/{task.method}/{task.first}/{task.count}'
    if isinstance(task, MotorTask):
        return f'motor/{task.decibel}/{task.count}'
    return f'hidden/{task.tau_c:g}/{task.seed}'


def run(
    tasks: list[AnyTask],
    file: PaperFile,
    *,
    processes: int = 1,
    progress: Callable[[str, int, int], None] | None = None,
) -> Results:
    """Run tasks; those that the file holds already are not run again.

    Parameters
    ----------
    tasks:
        Of `plan`.
    file:
        Where the runs of each task are kept.
    processes:
        Worker processes; results but for the times do not depend on it.
    progress:
        Told what was done, how many tasks are done, and how many there are.

    Raises
    ------
    UserError
        At the end, if a task has no answer; the others are kept.
    """
    left = [task for task in tasks if name_of(task) not in file.results]
    kept, lost = len(tasks) - len(left), list[str]()
    answers = workers.each(left, work, workers=processes, limit=LIMIT, warm_up=runs.warm_up)
    for done, (task, answer) in enumerate(answers, kept + 1):
        if isinstance(answer, workers.Lost):
            lost.append(f'{describe(task)}: {answer.reason}')
        else:
            file.add(Done(name_of(task), answer))
        if progress:
            progress(describe(task), done, len(tasks))
    if lost:
        raise UserError(
            f'{len(lost)} of {len(tasks)} tasks have no answer ({"; ".join(lost)}); the others '
            'are kept with --results, and the same command tries these again'
        )
    return gathered([file.results[name_of(task)] for task in tasks])


def gathered(done: Iterable[Done]) -> Results:
    """Return what tasks gave, in an order that does not depend on theirs."""
    found = [run for one in done for run in one.runs]
    return Results(
        sorted((r for r in found if isinstance(r, Run)),
               key=lambda r: (r.study, r.method, r.seed)),
        sorted((r for r in found if isinstance(r, MotorRun)), key=lambda r: (r.decibel, r.seed)),
        sorted((r for r in found if isinstance(r, HiddenRun)), key=lambda r: r.seed),
    )  # fmt: skip


def page(results: Results) -> str:
    """Return the report as one self-contained page."""
    first, *rest = (section(table) for table in tables(results))
    return whole(TITLE, f'{first}{charts(results.runs)}{"".join(rest)}', STYLE)
