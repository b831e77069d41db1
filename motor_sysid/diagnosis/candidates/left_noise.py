"""The noise that the whole dictionary of effects leaves of the residual of a model."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.problem import Linearization, Problem
from motor_sysid.estimation.batch.weighting import coloured, Weighting
from motor_sysid.signals.noise import rounding_sigmas

Array = NDArray[np.float64]

PASSES = 3
AR_ORDER = 12
NOISE_ROWS, NOISE_WINDOWS = 12_000, 12
"""Rows of long records that the noise model is fitted to, and the windows that they are in."""

LEAST_WINDOW = 8 * (AR_ORDER + 1)
"""Rows of a window below which it would tell little of the noise: whole stretches are taken."""

ROWS_A_COLUMN = 5
"""Rows for each column of the dictionary from which on it is fitted to find out the noise."""

ROUNDED = 0.5
"""Least innovation of a noise model in units of the error of rounding: that of differenced counts
is one of them."""

GROWN = 1.5
"""How much larger than the residual what the dictionary leaves may be, at its root mean square."""


def left_noise(
    problem: Problem, raw: Sequence[Array], starts: Sequence[Array], plain: Weighting
) -> Weighting:
    """Return the noise model of what base parameters and the whole dictionary leave.

    Where there are few rows for the dictionary it would leave less than noise; then base
    parameters alone are taken, and what an effect does counts as noise, too.  What an output shows
    for several rows is one error, and weighs as one.

    Parameters
    ----------
    problem:
        The fitted model's.
    raw:
        For each stretch (N, n_y, 1 + d + K): residual, slopes by the d parameters, and what a
        touch of each effect does.
    starts:
        For each stretch (N, n_y, m) what its initial state does.
    plain:
        Size of the residual.
    """
    columns = raw[0].shape[2]
    if sum(map(len, raw)) * plain.sigma.size < ROWS_A_COLUMN * columns:
        raw = [part[:, :, : 1 + problem.dimension] for part in raw]
    some, some_starts, least, weighting = _windows(raw), _windows(starts), _least(problem), plain
    for _ in range(PASSES):
        weighting = _whitened(some, some_starts, weighting, plain.sigma, least)
    return replace(weighting, sigma=weighting.sigma / np.sqrt(problem.fresh))


def _least(problem: Problem) -> Array:
    """Return the (n_y,) noise below which no noise model goes, from the steps of the signals."""
    records = [one.record for chain in problem.chains for one in chain]
    return np.asarray(ROUNDED * rounding_sigmas(records, problem.outputs))


def _windows(parts: Sequence[Array]) -> list[Array]:
    """Return windows, evenly spread, of about `NOISE_ROWS` rows of all stretches (N, ...).

    Of stretches that are too short for one, some are taken whole, evenly spread.
    """
    total = sum(len(part) for part in parts)
    if total <= 2 * NOISE_ROWS:
        return list(parts)
    share, found, owed = NOISE_ROWS / total, [], 0.0
    for part in parts:
        count = max(round(NOISE_WINDOWS * len(part) / total), 1)
        width = int(len(part) / count * share)
        if width >= LEAST_WINDOW:
            edges = np.linspace(0, len(part), count + 1).astype(int)
            found += [part[a : a + width] for a in edges[:-1]]
            continue
        owed += len(part) * share
        if owed >= len(part):
            owed -= len(part)
            found.append(part)
    return found


def _whitened(
    raw: Sequence[Array],
    starts: Sequence[Array],
    weighting: Weighting,
    most: Array,
    least: Array,
) -> Weighting:
    """Fit the noise model once more, to what all columns leave under the one before.

    The first column of each `raw` (N, n_y, 1 + K) is the residual, of (n_y,) size `most`; where a
    stretch started is at its best, too.  A noise model to which a drift is nothing lets the
    dictionary, and the starts, leave drifts of any size: where more is left than there was, the
    noise model stays as it is.  What rounding makes of a signal that moves by less than its step
    for long stays the same from sample to sample: to a noise model next to nothing, so that what
    it lets through is at least (n_y,) `least`.
    """
    gram = weighting.gram(raw, starts)
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0))
    scale[scale == 0] = 1.0
    scaled = gram / np.outer(scale, scale)
    coefficients = np.linalg.lstsq(scaled[1:, 1:], scaled[1:, 0], rcond=1e-8)[0]
    coefficients = coefficients * scale[0] / scale[1:]
    rest = [part[:, :, 0] - part[:, :, 1:] @ coefficients for part in raw]
    left = [
        Linearization(error, part[:, :, :0], start, np.empty(0))
        for error, part, start in zip(rest, raw, starts, strict=True)
    ]
    settled = [Problem.settled(one, weighting) for one in left]
    size = np.sqrt(np.mean(np.concatenate(settled) ** 2, axis=0))
    return weighting if np.any(size > GROWN * most) else coloured(settled, AR_ORDER, least)
