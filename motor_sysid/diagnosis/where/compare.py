"""Compare a model with records: errors by channel, and where the model fails."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.curves import Where
from motor_sysid.diagnosis.where.axes import axes_of
from motor_sysid.diagnosis.where.unexplained import lack_of
from motor_sysid.diagnosis.where.where import errors_by
from motor_sysid.estimation.batch import Chain, Linearization, Problem, white
from motor_sysid.estimation.batch.chains import Stretch
from motor_sysid.estimation.batch.starts import told_at_start
from motor_sysid.physics.model import Model
from motor_sysid.signals.metrics import moving, sizes_of
from motor_sysid.signals.noise import noise_sigma
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

@dataclass(frozen=True)
class Comparison:
    """Measured against simulated, free-running from the recorded input.

    Attributes
    ----------
    error_percent:
        RMS over channels of the channel errors that are known.
    channel_percent:
        Output to RMS error in percent of the size of the measured signal (see `sizes_of`); NaN of
        one that stands still all the time while another one moves.
    predictions:
        For each scored stretch, output to (N,) simulated values.
    residuals:
        For each scored stretch (N, n_y) measured minus simulated.
    measured:
        For each scored stretch (N, n_y).
    """

    error_percent: float
    channel_percent: Mapping[str, float]
    predictions: tuple[Mapping[str, Array], ...]
    residuals: tuple[Array, ...]
    measured: tuple[Array, ...]


@np.errstate(over='ignore', invalid='ignore')  # parameters on the way may be no motor
def compare(
    model: Model,
    chains: Sequence[Chain],
    outputs: Sequence[str],
    *,
    substeps: int = 1,
    as_measured: bool = False,
) -> Comparison:
    """Run a model over chains from the measured initial state and take the errors.

    Counts of a position tell the speed but roughly, a filter what it is fed, and a record what a
    delay still holds; where that is so, the most likely start is taken, unless that `as_measured`
    is asked for.  The former takes some of what the model lacks for noise of the start, of which
    many short runs average out in the latter.
    """
    problem = Problem(model, chains, outputs, substeps=substeps)
    z = problem.vector()
    if as_measured or not starts_matter(problem):
        runs = zip(problem.stretches, problem.simulate(z[np.newaxis, :]), strict=True)
        return comparison_of([one.judged - run[:, :, 0] for one, run in runs], problem)
    return comparison_of(likely(problem.linearize(z, parameters=False), problem), problem)


def starts_matter(problem: Problem) -> bool:
    """Whether what is measured tells but roughly how a run of the model begins."""
    doubts = any(problem.model.effect(key).doubts for key in problem.model.effects)
    return 'position' in problem.outputs or _late(problem.model) > 0.0 or doubts


def likely(near: Sequence[Linearization], problem: Problem) -> list[Array]:
    """Return residuals (N, n_y) of each scored stretch from the most likely start."""
    if not starts_matter(problem):
        return [one.residual for one in near]
    noise, late = white([one.residual for one in near]), _late(problem.model)
    return [
        problem.settled(one, noise, _spread(stretch, problem.model, late, one))
        for one, stretch in zip(near, problem.stretches, strict=True)
    ]


def _late(model: Model) -> float:
    """Return how long it takes, s, until an input is seen: by delays and filters of the speed."""
    mine = list(map(model.effect, model.effects))
    times = [f'{one.key}.{one.card.delay}' for one in mine if one.card.delay]
    times += [f'{one.key}.{one.card.filter}' for one in mine if one.filters_speed]
    return sum(map(model.__getitem__, times))


def _spread(
    stretch: Stretch, model: Model, late: float, near: Linearization
) -> Array:
    """Return (m,) standard deviations of the open initial states, in units of their sizes.

    These are the position, and the speed: a central difference of positions, or what is shown and
    as much as that changes while an input is `late` (s); and what an effect has doubts of.  What
    an input lacked before the record is all of it, or nothing.
    """
    record, dt, states = stretch.record, stretch.drive.dt, model.kind.states
    known = dict[str, float]()
    if 'position' in record:
        rounding = stretch.drive.count / np.sqrt(12.0)
        known['theta'] = max(noise_sigma(record['position']), rounding)
        known['omega'] = known['theta'] / (np.sqrt(2.0) * dt)
    if 'speed' in record and 'omega' in states:
        changes = abs(float(stretch.rate[states.index('omega')])) * late
        known['omega'] = noise_sigma(record['speed']) * max(late / dt, 1.0) + changes
    values = {name: np.array(v) for name, v in model.parameters.values().items()}
    for key in model.effects:
        for state, law in model.effect(key).doubts.items():
            doubt = float(told_at_start(law, key, model.kind, stretch, values))
            known[state] = known.get(state, 0.0) + doubt
    spread = np.ones(near.start.shape[2])
    for k, j in enumerate(stretch.open_states):
        spread[k] = known[states[j]] / stretch.state_size[j]
    return spread


def comparison_of(found: Sequence[Array], problem: Problem) -> Comparison:
    """Return the comparison of a model whose residuals (N, n_y) over the data are known."""
    residuals, outputs = tuple(found), problem.outputs
    measured = tuple(stretch.judged for stretch in problem.stretches)
    channel = channel_errors(outputs, residuals, measured)
    seen = _moving(problem)
    channel[~seen] = np.nan
    predictions = tuple(
        {name: (m - r)[:, j] for j, name in enumerate(outputs)}
        for m, r in zip(measured, residuals, strict=True)
    )
    return Comparison(
        float(np.sqrt(np.mean(channel[seen] ** 2))),
        dict(zip(outputs, channel.tolist(), strict=True)),
        predictions,
        residuals,
        measured,
    )


@np.errstate(over='ignore', invalid='ignore')  # parameters on the way may be no motor
def channel_errors(
    outputs: Sequence[str], residuals: Sequence[Array], measured: Sequence[Array]
) -> Array:
    """Return (n_y,) RMS errors in percent of the sizes of the measured signals."""
    error = np.sqrt(np.mean(np.concatenate(residuals) ** 2, axis=0))
    percent: Array = 100 * error / np.maximum(sizes_of(outputs, measured), 1e-300)
    return percent


def _moving(problem: Problem) -> NDArray[np.bool_]:
    """Return which (n_y,) outputs move in the whole records; all if none."""
    parts = [s.measured for chain in problem.chains for s in chain]
    found = moving(problem.outputs, parts)
    return found if np.any(found) else ~found


def where_it_fails(
    model: Model, records: Sequence[Record], comparison: Comparison
) -> tuple[Where, ...]:
    """Say along which axes the squared error of a comparison over uniform records lies."""
    runs = list(zip(records, comparison.predictions, strict=True))
    axes = axes_of(model, records, [lack_of(model, r, p).states for r, p in runs])
    errors = [{name: r[name] - values for name, values in p.items()} for r, p in runs]
    return errors_by(axes, records, errors)
