"""The whole benchmark, in parallel."""

from collections.abc import Callable
from dataclasses import dataclass

from motor_sysid.benchmark import workers
from motor_sysid.benchmark.page import section, whole
from motor_sysid.benchmark.paper import motor, runs
from motor_sysid.benchmark.paper.charts import charts, STYLE
from motor_sysid.benchmark.paper.motor import HiddenRun, MotorRun
from motor_sysid.benchmark.paper.report import Results, tables
from motor_sysid.benchmark.paper.runs import Run, Task
from motor_sysid.benchmark.paper.studies import NOISE

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
AnyRun = Run | MotorRun | HiddenRun


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


def run(
    tasks: list[AnyTask],
    *,
    processes: int = 1,
    progress: Callable[[str, int, int], None] | None = None,
) -> Results:
    """Run tasks.

    Parameters
    ----------
    tasks:
        Of `plan`.
    processes:
        Worker processes; results but for the times do not depend on it.
    progress:
        Told what was done, how many tasks are done, and how many there are.

    Raises
    ------
    RuntimeError
        If a task has no answer.
    """
    found: list[AnyRun] = []
    done = workers.each(tasks, work, workers=processes, limit=LIMIT, warm_up=runs.warm_up)
    for number, (task, answer) in enumerate(done, 1):
        if isinstance(answer, workers.Lost):
            raise RuntimeError(f'{describe(task)}: {answer.reason}')
        found += answer
        if progress:
            progress(describe(task), number, len(tasks))
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
