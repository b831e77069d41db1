"""Run methods on studies: one task is one method on one study with many seeds."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.paper import truth
from motor_sysid.benchmark.paper.fitting import told_by
from motor_sysid.benchmark.paper.methods import Answer, METHODS, READ, RECORDED
from motor_sysid.benchmark.paper.plant import seen, TRUE, whole
from motor_sysid.benchmark.paper.studies import (
    NOISE,
    OPEN,
    READINGS,
    record,
    RECORDS,
    Study,
    unseen,
)
from motor_sysid.signals.metrics import itae, metrics

Array = NDArray[np.float64]

ANYWHERE = 'any'
"""Key of the study in which every seed has a plant of its own, without noise."""

QUICK = ('best', 'wide', 'pso', 'gwo', 'ba', 'ba_printed', 'ga', 'pso_gwo', 'ls', 'pso_polished')
"""Methods of a quick benchmark."""


@dataclass(frozen=True)
class Task:
    """A method on a study, for seeds from `first` on."""

    study: str
    method: str
    first: int
    count: int


@dataclass(frozen=True)
class Run:
    """One run.

    Attributes
    ----------
    study, method, seed:
        What ran.
    itae:
        Against the record, unit s².
    errors:
        (4,) relative errors of what is seen.
    scores:
        (4,) errors over Cramer-Rao bounds at the truth; empty without noise.
    covered:
        (4,) whether the stated 95 % intervals hold the truth; empty if there is none.
    unseen_itae, unseen_fit:
        On the validation record, and the fit there in percent.
    simulations, seconds:
        Effort; the seconds are those of the processor.
    on_bound:
        Whether the search ended on a wall.
    """

    study: str
    method: str
    seed: int
    itae: float
    errors: tuple[float, ...]
    scores: tuple[float, ...]
    covered: tuple[bool, ...]
    unseen_itae: float
    unseen_fit: float
    simulations: int
    seconds: float
    on_bound: bool

    @property
    def worst(self) -> float:
        """Largest relative error, in percent."""
        return 100 * max(abs(e) for e in self.errors)


def tasks(seeds: int, *, quick: bool = False) -> list[Task]:
    """Return what is to be run; a quick benchmark leaves most methods and records out."""
    methods = QUICK if quick else METHODS
    readings = [(r, m) for r in READINGS for m in (*READ, 'best') if m in methods]
    readings = [(r, m) for r, m in readings if m != 'cpm_gwo' or r == 'R1']
    ratios, records = ((None, 30), ('D1', 'D2')) if quick else ((None, *NOISE), tuple(RECORDS))
    noisy = [
        (study_key(d, db), m) for d in records for db in ratios for m in RECORDED if m in methods
    ]
    anywhere = [(ANYWHERE, m) for m in ('best', 'wide')]
    return [Task(study, method, 0, seeds) for study, method in (*anywhere, *noisy, *readings)]


def study_key(data: str, decibel: int | None) -> str:
    """Return the key of a record at a ratio of signal to noise."""
    return f'{data}@{decibel or "clean"}'


def one(task: Task) -> tuple[Run, ...]:
    """Run a task."""
    return tuple(_run(task, task.first + k) for k in range(task.count))


def warm_up() -> None:
    """Compile what every task needs, so that none is charged for it."""
    for study in ('R1', 'R2', 'D1@30'):
        for method in ('pso', 'best'):
            one(Task(study, method, 0, 1))


def _run(task: Task, seed: int) -> Run:
    judged, given = _studies(task, seed)
    position = list(METHODS).index(task.method)
    answer = METHODS[task.method].solve(given, np.random.default_rng([seed, position]))
    true, found = seen(judged.plant), seen(answer.candidate)
    fresh = unseen(judged.plant)
    check = metrics(fresh.measured, fresh.simulate(answer.candidate[np.newaxis, :])[0], fresh.time)
    errors = judged.errors(answer.candidate[np.newaxis, :])[0]
    return Run(
        task.study, task.method, seed,
        float(itae(errors, judged.time)),
        tuple((found / true - 1).tolist()),
        _scores(given, found - true),
        _covered(answer, found - true),
        check.itae, check.fit_percent, answer.simulations, answer.seconds, answer.on_bound,
    )  # fmt: skip


def _studies(task: Task, seed: int) -> tuple[Study, Study]:
    """Return the study by which an answer is judged, and the one that the method is given."""
    if task.study in READINGS:
        study = READINGS[task.study].study()
        if task.method != 'best' or not study.loop.closed:
            return study, study
        u, y = truth.run(study.plant, study.drive, study.loop)
        return study, Study(u, OPEN, y, study.plant)
    if task.study == ANYWHERE:
        study = record('D2', None, seed, somewhere(seed))
        return study, study
    data, ratio = task.study.split('@')
    study = record(data, None if ratio == 'clean' else int(ratio), seed)
    return study, study


def somewhere(seed: int) -> Array:
    """Return a plant: a0, a1 and b up to three times larger or smaller, tau from 0.2 to 3 s."""
    rng = np.random.default_rng([seed, 77])
    factors = 3.0 ** rng.uniform(-1, 1, 3)
    return whole(np.append(seen(TRUE)[:3] * factors, rng.uniform(0.2, 3.0)))


def _scores(study: Study, errors: Array) -> tuple[float, ...]:
    if study.sigma == 0.0:
        return ()
    bound = told_by(study, study.plant, study.sigma).bound
    return tuple((errors / bound).tolist())


def _covered(answer: Answer, errors: Array) -> tuple[bool, ...]:
    if answer.sigma.size == 0:
        return ()
    return tuple((np.abs(errors) <= 1.959964 * answer.sigma).tolist())


def grouped(runs: Iterator[Run] | list[Run]) -> Mapping[tuple[str, str], list[Run]]:
    """Return runs by study and method."""
    groups: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        groups.setdefault((run.study, run.method), []).append(run)
    return groups
