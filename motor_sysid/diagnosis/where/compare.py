"""Compare a model with records: errors by channel, and where the model fails."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.curves import Where
from motor_sysid.diagnosis.where.axes import axes_of
from motor_sysid.diagnosis.where.unexplained import lack_of
from motor_sysid.diagnosis.where.where import errors_by
from motor_sysid.estimation.batch import Chain, Problem, white
from motor_sysid.estimation.batch.chains import Stretch
from motor_sysid.physics.effect import SPEED_SENSOR
from motor_sysid.physics.model import Model
from motor_sysid.signals.metrics import sizes_of
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

    Counts of a position tell the speed but roughly, and a filter what it is fed; where that is so,
    the most likely initial state is taken, unless that `as_measured` is asked for.  The former
    takes some of what the model lacks for noise of the start, of which many short runs average out
    in the latter.
    """
    problem = Problem(model, chains, outputs, substeps=substeps)
    z, stretches = problem.vector(), problem.stretches
    late = _late(model)
    if as_measured or not ('position' in outputs or late):
        runs = zip(stretches, problem.simulate(z[np.newaxis, :]), strict=True)
        return comparison_of([one.judged - run[:, :, 0] for one, run in runs], problem)
    near = problem.linearize(z, parameters=False)
    noise = white([one.residual for one in near])
    likely = [
        problem.settled(one, noise, _spread(stretch, model.kind.states, late))
        for one, stretch in zip(near, stretches, strict=True)
    ]
    return comparison_of(likely, problem)


def _late(model: Model) -> float:
    """Return by how much the speed is shown late, s: the time constant of its filter, or 0."""
    mine = (model.effect(key) for key in model.effects)
    filters = [one for one in mine if one.card.filter and SPEED_SENSOR in one.laws]
    return sum(model[f'{one.key}.{one.card.filter}'] for one in filters)


def _spread(stretch: Stretch, states: Sequence[str], late: float) -> Array:
    """Return (m,) standard deviations of the open initial states, in units of their sizes.

    These are the position, and the speed: a central difference of positions, or what is shown and
    as much more as that changes while it is `late` (s).
    """
    record, dt = stretch.record, stretch.drive.dt
    known = dict[str, float]()
    if 'position' in record:
        count = stretch.drive.count / np.sqrt(12.0)
        known['theta'] = max(noise_sigma(record['position']), count)
        known['omega'] = known['theta'] / (np.sqrt(2.0) * dt)
    if 'speed' in record:
        known['omega'] = noise_sigma(record['speed']) * max(late / dt, 1.0)
    return np.array([known[states[j]] / stretch.state_size[j] for j in stretch.open_states])


def comparison_of(found: Sequence[Array], problem: Problem) -> Comparison:
    """Return the comparison of a model whose residuals (N, n_y) over the data are known."""
    residuals, outputs = tuple(found), problem.outputs
    measured = tuple(stretch.judged for stretch in problem.stretches)
    channel = channel_errors(outputs, residuals, measured)
    moving = _moving(problem)
    channel[~moving] = np.nan
    predictions = tuple(
        {name: (m - r)[:, j] for j, name in enumerate(outputs)}
        for m, r in zip(measured, residuals, strict=True)
    )
    return Comparison(
        float(np.sqrt(np.mean(channel[moving] ** 2))),
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
    """Return which (n_y,) outputs are ever anything but zero in the whole records; all if none."""
    parts = [np.any(s.measured, axis=0) for chain in problem.chains for s in chain]
    moving: NDArray[np.bool_] = np.any(parts, axis=0)
    return moving if np.any(moving) else ~moving


def where_it_fails(
    model: Model, records: Sequence[Record], comparison: Comparison
) -> tuple[Where, ...]:
    """Say along which axes the squared error of a comparison over uniform records lies."""
    runs = list(zip(records, comparison.predictions, strict=True))
    axes = axes_of(model, records, [lack_of(model, r, p).states for r, p in runs])
    errors = [{name: r[name] - values for name, values in p.items()} for r, p in runs]
    return errors_by(axes, records, errors)
