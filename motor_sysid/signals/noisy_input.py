"""Noise on a measured voltage that the motor never saw.

A model takes the voltage of a record for the one that acts.  Noise of its sensor then drives the
model alone, and what that leaves goes with the input as missing physics would.  It is told from a
voltage that is restless (a controller answers to the noise of its own sensors) by the current:
that answers to what acts, at once, as it does to the steps of the same voltage.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.noise import noise_sigma
from motor_sysid.signals.record import Record
from motor_sysid.signals.slow_updates import periods_of

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

INPUT, ANSWER = 'voltage', 'current'

EDGE = 6.0
"""Change from sample to sample, in units of the noise, that is a step of the voltage."""

DEGREE, WINDOWS = 2, (9, 15, 25, 41, 65, 105)
"""Polynomial that is fitted around each sample, and samples that it is fitted to: the most of
which the voltage between its steps is one to within the noise."""

GROWS = 1.03
"""Noise over that of the shortest window from which on a longer one takes more than noise."""

LAGS = 4
"""Samples in which a current answers."""

ACTS, KNOWN = 0.1, 0.03
"""Answer to the noise, in units of that to steps, below which it is the sensor's, and the standard
error up to which it is told.  Seen: 0.02 at most with noise of a sensor; what a controller makes
of that of its own sensors came to 0.2 to 1 in 51 records."""

FEWEST, STEPS = 500, 20
"""Samples between steps, and steps, that it takes."""


@dataclass(frozen=True)
class NoisyInput:
    """A record whose voltage has noise that does not act.

    Attributes
    ----------
    record:
        The record, uniform.
    sigma:
        Standard deviation of the noise, V.
    smooth:
        (N,) the voltage without most of it, V.
    """

    record: Record
    sigma: float
    smooth: Array

    def __str__(self) -> str:
        return (
            f'{INPUT} has noise of {self.sigma:.3g} {self.record.units[INPUT]} (RMS) that the '
            f'{ANSWER} does not answer to: that of its sensor'
        )


@dataclass(frozen=True)
class _Restless:
    """What is fast in a voltage, and in the current, between steps of the voltage.

    Attributes
    ----------
    record:
        The record.
    sigma:
        Standard deviation of what is fast in the voltage, V.
    smooth:
        (N,) the voltage without it.
    noise:
        (R, LAGS) what is fast in the voltage before each of R samples, and (R,) in their current.
    steps:
        The same for samples behind steps, as they change.
    """

    record: Record
    sigma: float
    smooth: Array
    noise: tuple[Array, Array]
    steps: tuple[Array, Array]


def noisy_inputs_of(records: Sequence[Record]) -> Iterator[NoisyInput]:
    """Yield the uniform records of one motor whose voltage has noise that does not act.

    It acts in none of them, or in all: they have one sensor.  Of a voltage without steps, or
    beside a current that is held between updates, or noisier than what steps make of it, nothing
    is told.
    """
    if ANSWER in periods_of(records) or any(ANSWER in record.samples for record in records):
        return
    found = [one for record in records if (one := _restless(record))]
    if sum(len(one.steps[1]) for one in found) < STEPS * LAGS:
        return
    answer, _ = _regressed(*_pooled([one.steps for one in found]))
    size = float(np.linalg.norm(answer))
    for one in found:
        own, covariance = _regressed(*one.noise)
        error = float(np.sqrt(np.trace(covariance)))
        if np.linalg.norm(own) > ACTS * size or error > KNOWN * size:
            return
    yield from (NoisyInput(one.record, one.sigma, one.smooth) for one in found)


def with_quiet_inputs(records: Sequence[Record]) -> list[Record]:
    """Return the uniform records, their voltage without noise that does not act."""
    noisy = {id(one.record): one for one in noisy_inputs_of(records)}
    return [_quiet(noisy[id(r)]) if id(r) in noisy else r for r in records]


def _quiet(one: NoisyInput) -> Record:
    unit = one.record.units[INPUT]
    record = one.record.with_signal(INPUT, one.smooth, unit)
    return replace(record, provenance=record.provenance.noting(f'{one}; smoothed between steps'))


def _restless(record: Record) -> _Restless | None:
    """Look what is fast in a record's voltage; None if nothing is."""
    if INPUT not in record or ANSWER not in record or len(record) < FEWEST:
        return None
    volts, current = record[INPUT], record[ANSWER]
    sigma = noise_sigma(volts)
    if not sigma > record.step_of(INPUT) or not np.all(np.isfinite(volts + current)):
        return None
    ends = np.flatnonzero(np.abs(np.diff(volts)) > EDGE * sigma) + 1
    pieces = np.split(np.arange(volts.size), ends)
    inside = _well_inside(pieces)
    smooth = _smoothed(volts, pieces, inside)
    fast, left = volts - smooth, current - _smoothed(current, pieces, inside)
    rows = np.flatnonzero(inside)
    rows = rows[rows >= LAGS]
    if rows.size < FEWEST:
        return None
    behind = np.unique(ends[:, np.newaxis] + np.arange(1, LAGS + 1))
    behind = behind[(behind > LAGS) & (behind < volts.size)]
    change, rise = np.diff(volts, prepend=volts[0]), np.diff(current, prepend=current[0])
    return _Restless(
        record, float(np.std(fast[inside])), smooth,
        (_before(fast, rows), left[rows]), (_before(change, behind), rise[behind]),
    )  # fmt: skip


def _before(values: Array, rows: Rows) -> Array:
    """Return (R, LAGS) of (N,) values those before each row, the last one first."""
    return np.stack([values[rows - lag] for lag in range(1, LAGS + 1)], axis=1)


def _well_inside(pieces: Sequence[Rows]) -> NDArray[np.bool_]:
    """Return (N,) whether samples are not near the ends of pieces that are long enough."""
    inside = np.zeros(sum(map(len, pieces)), dtype=np.bool_)
    for piece in pieces:
        inside[piece[LAGS:-LAGS]] = piece.size > 2 * WINDOWS[0]
    return inside


def _smoothed(values: Array, pieces: Sequence[Rows], inside: NDArray[np.bool_]) -> Array:
    """Return (N,) values smoothed within each piece, in the longest window that takes noise only.

    That is judged by what is `inside` of the pieces.
    """
    best = values
    for window in WINDOWS:
        smooth = _in_windows(values, pieces, window)
        noise = _noise(values - smooth, window, inside)
        if window == WINDOWS[0]:
            least = noise
        elif noise > GROWS * least:
            break
        best = smooth
    return best


def _in_windows(values: Array, pieces: Sequence[Rows], window: int) -> Array:
    """Return (N,) values smoothed in windows within pieces, shorter ones in what there is of them.

    As `scipy.signal.savgol_filter` of each piece, but all those of one width at once.
    """
    sizes = np.array([piece.size for piece in pieces])
    begins = np.cumsum(sizes) - sizes
    widths = np.minimum(window, sizes - 1 + sizes % 2)
    smooth, width_at = values.copy(), np.repeat(widths, sizes)
    for width in np.unique(widths[widths > DEGREE + 1]):
        fitted, half = _fitted(int(width)), width // 2
        middle = width_at == width
        smooth[middle] = np.convolve(values, fitted[half], 'same')[middle]
        first, last = begins[widths == width], (begins + sizes - width)[widths == width]
        for begin, side in ((first, slice(half)), (last, slice(half + 1, None))):
            rows = begin[:, np.newaxis] + np.arange(width)
            smooth[rows[:, side]] = values[rows] @ fitted[side].T
    return smooth


@cache
def _fitted(width: int) -> Array:
    """Return (width, width) what a window's polynomial is at each sample, of each value."""
    basis = np.vander(np.arange(width) - width // 2, DEGREE + 1).astype(np.float64)
    orthogonal, _ = np.linalg.qr(basis)
    fitted: Array = orthogonal @ orthogonal.T
    return fitted


def _noise(left: Array, window: int, inside: NDArray[np.bool_]) -> float:
    """Return the noise that leaves so much of itself outside a window."""
    taken = 1.0 - float(_fitted(window)[window // 2, window // 2])
    return float(np.std(left[inside]) / np.sqrt(taken)) if np.any(inside) else 0.0


def _pooled(parts: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    return np.concatenate([x for x, _ in parts]), np.concatenate([y for _, y in parts])


def _regressed(x: Array, y: Array) -> tuple[Array, Array]:
    """Return the coefficients (k,) of (R,) values on (R, k) others, and their covariance."""
    gram = x.T @ x + 1e-12 * np.trace(x.T @ x) * np.eye(x.shape[1])
    found = np.linalg.solve(gram, x.T @ y)
    variance = float(np.mean((y - x @ found) ** 2))
    return found, variance * np.linalg.inv(gram)


def told_noisy_inputs(records: Sequence[Record]) -> tuple[str, ...]:
    """Say which voltages of uniform records `with_quiet_inputs` smooths."""
    return tuple(
        f'{one.record.provenance.source or "a record"}: {one}, which a fit smooths between steps'
        for one in noisy_inputs_of(records)
    )
