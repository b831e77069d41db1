"""How much of what a model leaves the motion predicts.

A general regression from the simulated motion to the residual: sensor noise and random loads
cannot be predicted from the input, missing physics can.  In a closed loop the controller answers
to random loads, too, so that the input predicts them: there the motion counts as far as the
reference leads it.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import accumulate, islice, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.estimation.batch import Chain
from motor_sysid.estimation.batch.chains import Stretch
from motor_sysid.estimation.batch.methods.reference import led_by_reference
from motor_sysid.signals.record import Record
from motor_sysid.threads import in_threads

Array = NDArray[np.float64]
Samples = tuple[Array, Array]
"""Features (K, f) and targets (K, n_y)."""

Orders = tuple[Sequence[int], Sequence[int]]
"""Waves per turn that stand out of the unexplained torque, and those that go with the current."""

_LAGS = (0, 1, 2, 3, 5, 8, 12, 18)
"""Delays of what is looked at, samples."""

_TAUS = (8.0, 30.0, 120.0, 400.0)
"""Time constants of lags behind what is looked at, samples."""

_HATS = 12
"""Pieces of a function of any shape over a signal's range."""

_TAPS, _TAP_WIDTH = 60, 4
"""Pieces of an impulse response from the input, and how many samples each is wide."""

_RIDGES, _STRONG_RIDGE = (1e-4, 1e-2), 0.1
"""Share of the features' variance that holds their weights down: across blocks, whichever predicts
more (weights that follow one record closely may run away on another), and where the prediction is
for data of another kind."""

_FOLDS = 12
_ROWS = 12_000
"""Blocks of cross-validation; rows that are looked at of long records."""

STILL = 1e-9
"""Spread of a feature over the training data, in units of the largest, below which it tells
nothing there."""


def regressions(
    training: Comparison,
    held: Comparison,
    chains: tuple[Sequence[Chain], Sequence[Chain]],
    orders: Orders,
) -> tuple[Samples, Samples] | None:
    """Return features and residuals of training and held-out data; None if too short to tell.

    What is beyond the noise is not to be called noise then.
    """
    stride = max(sum(len(r) for r in training.residuals) // _ROWS, 1)
    x, y = _regression(training, chains[0], orders, stride)
    xv, yv = _regression(held, chains[1], orders, stride)
    if len(x) < 4 * x.shape[1] or len(xv) < 20:
        return None
    middle, spread = x.mean(axis=0), x.std(axis=0)
    moves = spread > STILL * np.max(spread)
    middle, spread = middle[moves], spread[moves]
    x, xv = (x[:, moves] - middle) / spread, (xv[:, moves] - middle) / spread
    return (x, y), (xv, yv)


def predictable(training: Samples, held: Samples) -> float:
    """Return `Remainder.predictable` from features (N, k) and residuals (N, n_y) of both."""
    (x, y), (xv, yv) = training, held
    gram = x.T @ x + _STRONG_RIDGE * len(x) * np.eye(x.shape[1])
    offset = y.mean(axis=0)
    guess = offset + xv @ np.linalg.solve(gram, x.T @ (y - offset))
    along = np.maximum(np.sum(yv * guess, axis=0), 0.0) ** 2
    along /= np.maximum(np.sum(yv**2, axis=0) * np.sum(guess**2, axis=0), 1e-300)
    across = cross_validated(np.concatenate((x, xv)), np.concatenate((y, yv)))
    return max(0.0, float(np.max(along)), across)


def cross_validated(x: Array, y: Array) -> float:
    """Return the largest share of a column of y that regressions on other blocks predict."""
    edges = [-(-len(x) * k // _FOLDS) for k in range(_FOLDS + 1)]
    folds = [(x[a:b], y[a:b]) for a, b in pairwise(edges)]
    grams = [part.T @ part for part, _ in folds]
    sides = [part.T @ target for part, target in folds]
    gram, side = np.sum(grams, axis=0), np.sum(sides, axis=0)
    left = np.zeros((len(_RIDGES), y.shape[1]))
    for row, ridge in zip(left, _RIDGES, strict=True):
        damped = gram + ridge * len(x) * np.eye(x.shape[1])
        for own, other, (part, target) in zip(grams, sides, folds, strict=True):
            weights = np.linalg.solve(damped - own, side - other)
            row += np.sum((target - part @ weights) ** 2, axis=0)
    return float(np.max(1 - left / np.maximum(np.sum(y**2, axis=0), 1e-300)))


def _regression(
    comparison: Comparison, chains: Sequence[Chain], orders: Orders, stride: int
) -> Samples:
    """Return features of the simulated motion (K, f) and residuals (K, n_y).

    Of long records only every `stride`-th row is taken.
    """
    rows, targets = [], []
    scale = np.sqrt(np.mean(np.concatenate(comparison.measured) ** 2, axis=0)) + 1e-300
    for stretches, residual, measured in _pieces(comparison, chains):
        longest = _TAPS * _TAP_WIDTH
        if len(residual) <= 2 * longest:
            continue
        cuts = list(accumulate(len(s.record) for s in stretches[:-1]))
        simulated = _with_pace((measured - residual) / scale, cuts)
        drive = np.concatenate([s.drive.inputs[s.scored_from :] for s in stretches])
        drive = drive / (np.sqrt(np.mean(drive**2)) + 1e-300)
        motion = np.concatenate((drive, simulated), axis=1)
        channels = led_by_reference(_record_of(stretches), motion, stretches[0].scored_from)
        drive, moved = np.split(channels, [drive.shape[1]], axis=1)
        shaped = np.concatenate(
            (
                channels,
                np.tanh(20 * moved),
                moved * np.abs(moved),
                np.abs(moved) * np.tanh(20 * moved[:, ::-1]),
                _waves(stretches, moved, orders),
            ),
            axis=1,
        )
        lagged = [shaped[longest - lag : len(shaped) - lag : stride] for lag in _LAGS]
        bumps = np.concatenate([_bumps(column) for column in moved.T], axis=1)
        wide = np.concatenate((shaped, bumps), axis=1)
        lagged += [bumps[longest::stride]]
        slow = in_threads(partial(_slowed, np.ascontiguousarray(wide.T), cuts), _TAUS)
        lagged += [one[:, longest::stride].T for one in slow]
        area = np.concatenate((np.zeros((1, drive.shape[1])), np.cumsum(drive, axis=0)))
        mean = (area[_TAP_WIDTH:] - area[:-_TAP_WIDTH]) / _TAP_WIDTH
        ends = [longest - k * _TAP_WIDTH for k in range(_TAPS)]
        begins = [end - _TAP_WIDTH for end in ends]
        lagged += [mean[begin : begin + len(shaped) - longest : stride] for begin in begins]
        clock = np.linspace(-1, 1, len(shaped))[longest::stride, np.newaxis]
        rows.append(np.concatenate([clock * lagged[0], *lagged], axis=1))
        targets.append(residual[longest::stride])
    if not rows:
        return np.empty((0, 1)), np.empty((0, comparison.residuals[0].shape[1]))
    return np.concatenate(rows), np.concatenate(targets)


def _pieces(
    comparison: Comparison, chains: Sequence[Chain]
) -> Iterator[tuple[list[Stretch], Array, Array]]:
    """Yield stretches with their residuals and measured outputs (N, n_y): short looks as one."""
    rest = zip(comparison.residuals, comparison.measured, strict=True)
    for chain in chains:
        scored = [stretch for stretch in chain if stretch.scored]
        own = list(islice(rest, len(scored)))
        short = [s.scored_from == 0 and len(s.record) <= 2 * _TAPS * _TAP_WIDTH for s in scored]
        edges = [k for k in range(len(scored)) if not k or not (short[k] and short[k - 1])]
        for a, b in pairwise([*edges, len(scored)]):
            residuals, measured = zip(*own[a:b], strict=True)
            yield scored[a:b], np.concatenate(residuals), np.concatenate(measured)


def _record_of(stretches: Sequence[Stretch]) -> Record:
    """Return the record that stretches were cut from, as far as they reach."""
    first = stretches[0].record
    if len(stretches) == 1:
        return first
    time = np.concatenate([s.record.time for s in stretches])
    signals = {n: np.concatenate([s.record[n] for s in stretches]) for n in first}
    return Record(time, signals, first.units, first.provenance)


def _bumps(values: Array) -> Array:
    """Return (N, k) hats over the range of (N,) values: their sums are functions of any shape."""
    low, high = np.quantile(values, (0.005, 0.995))
    place = (values - low) / max(high - low, 1e-300) * (_HATS - 1)
    hats: Array = np.maximum(1.0 - np.abs(place[:, np.newaxis] - np.arange(_HATS)), 0.0)
    return hats


def _with_pace(simulated: Array, cuts: Sequence[int]) -> Array:
    """Return outputs of short looks with how fast they change: of a position alone, the speed."""
    if not cuts:
        return simulated
    pace = np.concatenate([np.gradient(part, axis=0) for part in np.split(simulated, cuts)])
    return np.concatenate((simulated, pace / (np.std(pace, axis=0) + 1e-300)), axis=1)


def _slowed(values: Array, cuts: Sequence[int], tau: float) -> Array:
    """Return (f, N) values behind a first-order lag of `tau` samples, as a rotor would be.

    Where runs begin anew at some columns, what a model lacks adds up from there, to a speed and to
    an angle: these are (2 f, N) values behind one lag and behind two, from nothing.
    """
    keep = np.exp(-1.0 / tau)
    one = partial(lfilter, [1 - keep], [1, -keep])
    if not cuts:
        slow: Array = one(values, zi=keep * values[:, :1])[0]
        return slow
    once = [one(part) for part in np.split(values, cuts, axis=1)]
    twice = [one(part) for part in once]
    return np.concatenate([np.concatenate(lags, axis=1) for lags in (once, twice)])


def _waves(stretches: Sequence[Stretch], moved: Array, orders: Orders) -> Array:
    """Return sines and cosines of multiples of the rotor angle, (N, f), beside (N, n_y) outputs.

    Those that go with the current are multiplied by each output.  None without an angle.
    """
    angle = np.concatenate([s.drive.position[s.scored_from :] for s in stretches])
    plain, led = orders
    if not angle.size or not (plain or led):
        return np.empty((len(moved), 0))
    pair = (np.sin, np.cos)
    columns = [f(n * angle) for n in (dict.fromkeys((1, *plain)) if plain else ()) for f in pair]
    columns += [f(n * angle) * y for n in led for f in pair for y in moved.T]
    return np.stack(columns, axis=1)
