"""Every online estimator on the same perturbed records: how far off, how soon, at what cost.

All are fed side by side, a tenth of a second each in turn, so that a busy machine slows all alike;
costs are compared within each turn.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
import math
import time

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.perturbations import DT, Perturbation, perturbed_run, Run
from motor_sysid.estimation.online import Estimate, ESTIMATORS, OnlineIdentifier
from motor_sysid.physics.model import Model, SpeedSensor

Array = NDArray[np.float64]

MAIN = ('R', 'k_t', 'J')
LOAD = 'constant_load_torque.tau_l'
CLOSE = 0.05
"""Largest relative error of R, k_t and J that counts as converged."""

_TURN = 100
_SPREAD = 0.5
_CALIBRATED = 0.02
_LAST = 1.0


@dataclass(frozen=True)
class Score:
    """How one estimator did on one record.

    Attributes
    ----------
    estimator, perturbation, motor:
        Who, on what.
    error, load_error:
        Median over the last second of the largest relative error of R, k_t and J, and RMS of the
        load torque's over the rated torque; NaN where it estimates none.
    settled:
        Time in s after which the first stays below 5 %; infinite if it does not.
    surprise:
        RMS of error over sigma of R, k_t and J at the end.
    cost, relative_cost:
        Time per sample in s, and over that of `rls`.
    """

    estimator: str
    perturbation: str
    motor: int
    error: float
    load_error: float
    settled: float
    surprise: float
    cost: float
    relative_cost: float


Progress = Callable[[Perturbation, int], None]


def compare_estimators(
    perturbations: Sequence[Perturbation],
    motors: int,
    seconds: float,
    *,
    seed: int = 0,
    keys: Sequence[str] = tuple(ESTIMATORS),
    progress: Progress | None = None,
) -> list[Score]:
    """Run estimators over perturbed motors.

    Parameters
    ----------
    perturbations, motors, seconds:
        What is done to how many motors for how long.
    seed:
        Of the motors, their excitation, noise and start values.
    keys:
        The estimators; costs are relative to the first.
    progress:
        Is told of each record before it is run.
    """
    scores: list[Score] = []
    for perturbation in perturbations:
        for motor in range(motors):
            if progress:
                progress(perturbation, motor)
            one = perturbed_run(perturbation, motor, seconds, seed)
            scores += _on_one(one, perturbation.code, motor, keys, seed)
    return scores


def _on_one(run: Run, code: str, motor: int, keys: Sequence[str], seed: int) -> list[Score]:
    rng = np.random.default_rng([seed, motor, 1])
    start = _start(run, rng)
    outputs = ['current', 'speed']
    online = {
        key: OnlineIdentifier(_model(run, key, start), key, DT, ['voltage'], outputs)
        for key in keys
    }
    found: dict[str, list[Mapping[str, Estimate]]] = {key: [] for key in keys}
    costs = {key: list[float]() for key in keys}
    for rows in _turns(run.record.time.size):
        for key, one in online.items():
            costs[key].append(_feed(one, run, rows))
            found[key].append(one.estimate())
    base = np.array(costs[keys[0]])
    return [
        _score(run, code, motor, key, found[key], np.array(costs[key]), base) for key in keys
    ]


def _turns(count: int) -> Iterator[slice]:
    for first in range(0, count - _TURN + 1, _TURN):
        yield slice(first, first + _TURN)


def _feed(one: OnlineIdentifier, run: Run, rows: slice) -> float:
    """Give samples to an estimator; return the time per sample in s."""
    record = run.record
    outputs = np.column_stack([record[name][rows] for name in one.outputs])
    begun = time.perf_counter()
    one.update(record.time[rows], record['voltage'][rows, np.newaxis], outputs)
    return (time.perf_counter() - begun) / len(outputs)


def _start(run: Run, rng: np.random.Generator) -> dict[str, float]:
    """Return start values that are off by up to a factor of 1.65."""
    names = [name for name in run.true if name != LOAD]
    return {n: float(run.true[n][0] * np.exp(_SPREAD * rng.uniform(-1, 1))) for n in names}


def _model(run: Run, key: str, start: Mapping[str, float]) -> Model:
    """Return where an estimator starts; one of the load alone needs a motor that is known."""
    model = Model.base('brushed_dc', start, speed_sensor=SpeedSensor.DIFFERENCE)
    model = model.with_effect('coulomb_friction').with_effect('constant_load_torque')
    if key != 'sliding_mode':
        return model
    true = {name: float(run.true[name][0]) for name in start}
    true['coulomb_friction.tau_c'] = 0.03 * run.sheet.torque
    sigmas = {name: _CALIBRATED * value for name, value in true.items()}
    true['current_offset'], sigmas['current_offset'] = 0.0, 0.01 * run.sheet.current
    return model.with_estimates(true, sigmas)


def _score(
    run: Run,
    code: str,
    motor: int,
    key: str,
    found: Sequence[Mapping[str, Estimate]],
    cost: Array,
    base: Array,
) -> Score:
    at = _TURN * np.arange(1, len(found) + 1) - 1
    errors, scores = np.empty((len(found), len(MAIN))), np.empty(len(MAIN))
    for j, name in enumerate(MAIN):
        off = np.array([one[name].value for one in found]) - run.true[name][at]
        errors[:, j] = np.abs(off) / run.true[name][at]
        scores[j] = off[-1] / found[-1][name].sigma
    worst = errors.max(axis=1)
    last = at * DT > at[-1] * DT - _LAST
    load = np.array([one[LOAD].value for one in found]) - run.true[LOAD][at]
    known = key != 'sliding_mode'
    return Score(
        key,
        code,
        motor,
        float(np.median(worst[last])) if known else math.nan,
        float(np.sqrt(np.mean(load[last] ** 2))) / run.sheet.torque,
        _settling(worst, at) if known else math.nan,
        float(np.sqrt(np.mean(scores**2))) if known else math.nan,
        float(np.median(cost)),
        float(np.median(cost / base)),
    )


def _settling(worst: Array, at: NDArray[np.int64]) -> float:
    """Return the time from which on the error stays small, s."""
    outside = np.flatnonzero(worst > CLOSE)
    if outside.size == 0:
        return float(at[0] + 1) * DT
    if outside[-1] == worst.size - 1:
        return math.inf
    return float(at[outside[-1] + 1] + 1) * DT


def as_dict(scores: Sequence[Score]) -> dict[str, object]:
    """Return what the JSON file holds; numbers that are none are null."""
    rows = [
        {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}
        for row in map(asdict, scores)
    ]
    return {'schema': 'motor_sysid/benchmark_estimators/1', 'scores': rows}
