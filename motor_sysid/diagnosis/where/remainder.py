"""Tell noise from missing physics in what is left when no candidate helps any more.

Sensor noise and random loads cannot be predicted from the input; missing physics can.  So a
general regression from the simulated motion to the residual is fitted on the training data and
judged on the held-out data: the share of the remaining error that it predicts there is structure.

In a closed loop the controller answers to random loads, too, so that the input predicts them:
there the motion counts as far as the reference leads it.

What cannot be predicted is missing physics, too, if it swings at one frequency in training and
held-out data, if it drifts, if the model describes one record much worse than another, or if the
held-out data ask for other values of its parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.diagnosis.where.drift import DRIFT, drift_of
from motor_sysid.diagnosis.where.oscillation import Swing, swing_of
from motor_sysid.diagnosis.where.other_values import MOVED, OtherValues
from motor_sysid.diagnosis.where.spell import Spell, spell_of
from motor_sysid.diagnosis.where.uneven_records import but_for_few, UNEVEN, unevenness_of
from motor_sysid.estimation.batch import Chain
from motor_sysid.estimation.batch.chains import Stretch
from motor_sysid.estimation.batch.methods.reference import led_by_reference
from motor_sysid.signals.noise import noise_sigmas, rounding_sigmas
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

STRUCTURE = 0.1
"""Share of the remaining error that must be predictable before it is called missing physics."""

ABOVE_FLOOR = 1.3
"""Remaining error over sensor noise below which nothing more is looked for."""

LARGE, LARGE_PERCENT = 4.0, 10.0
"""Remaining error over sensor noise, and in percent of the signal, above which something is
missing even if nothing predicts it: what disturbs a motor that much is part of its model."""

ONLY_THERE = 1.3
"""Error of an output over the held-out data, in units of that over the training data, from which
on what is missing shows in the former, if the motion predicts none of the latter."""

TRIFLE_PERCENT = 1.0
"""Size of what is predictable, in percent of the signal, below which a model is good enough."""


@dataclass(frozen=True)
class Remainder:
    """What remains of the error.

    Attributes
    ----------
    floor:
        Output to standard deviation of its sensor noise, in the unit of the signal.
    floor_percent:
        The error that this noise alone makes, combined over outputs.
    error_percent:
        The error that remains on held-out data, free-running.
    over_floor:
        Largest ratio of an output's error, but for a few samples, to its noise.
    predictable:
        Share of the squared error of an output that the simulated motion predicts: the squared
        correlation with a cautious prediction on the held-out data, or what regressions on eleven
        twelfths of all data predict of the rest, whichever is larger; near 0 for noise.
    swing:
        One frequency at which it swings in training and held-out data, if there is one.
    unevenness:
        How many times larger it is in one record than in another.
    drift:
        Share of the squared error of a record that is slower than half of it.
    beyond_percent:
        The error that remains when the noise of each sensor is taken out of its own output,
        combined over outputs: one output may have all of the noise, another all of the physics.
    held_alone:
        How many times larger an output's error is over held-out data than over training data
        (where it counts as sensor noise at least), or the error there than with other values of
        the parameters if it asks for these, if the motion predicts none of the training error:
        then these data do not show what is missing.  Else 1.
    other:
        What other values of the model's own parameters take away over the held-out data.
    waves:
        Waves per turn of a torque in proportion to the current that stand out, strongest first.
    training_percent:
        The error on the data that were fitted: what swings in both may be large there alone.
    spell:
        A short time that makes nearly all of a record's error, if there is one.
    """

    floor: dict[str, float]
    floor_percent: float
    error_percent: float
    over_floor: float
    predictable: float
    swing: Swing | None = None
    unevenness: float = 1.0
    drift: float = 0.0
    beyond_percent: float = np.inf
    held_alone: float = 1.0
    other: OtherValues | None = None
    waves: tuple[int, ...] = ()
    training_percent: float = 0.0
    spell: Spell | None = None

    @property
    def swings(self) -> bool:
        """Whether more of it swings at one frequency than the motion predicts."""
        return self.swing is not None and self.swing.share > max(self.predictable, STRUCTURE)

    @property
    def uneven(self) -> bool:
        """Whether one record has more of it than sensors and random loads make."""
        return self.unevenness > UNEVEN

    @property
    def drifts(self) -> bool:
        """Whether it is slower in one record than what sensors and random loads make."""
        return self.drift > DRIFT

    @property
    def moves(self) -> bool:
        """Whether held-out data ask for other values of parameters than random loads do."""
        return self.other is not None and self.other.told > MOVED

    @property
    def share(self) -> float:
        """Share of its square that is missing physics."""
        share = max(self.predictable, self.swing.share if self.swing else 0.0)
        share = max(share, 1.0 - self.unevenness**-2) if self.uneven else share
        share = max(share, self.drift) if self.drifts else share
        return max(share, self.other.told) if self.other and self.moves else share

    @property
    def structured(self) -> bool:
        """Whether something remains that is missing physics and no trifle."""
        size = min(self.error_percent * np.sqrt(self.share), self.beyond_percent)
        if self.swing:
            size = max(size, self.training_percent * np.sqrt(self.swing.share))
        told = self.above_floor and self.share > STRUCTURE and size > TRIFLE_PERCENT
        return bool(told or self.large)

    @property
    def large(self) -> bool:
        """Whether so much remains that a model without it is not complete, whatever it is."""
        beyond = self.error_percent > LARGE * self.floor_percent
        return beyond and self.error_percent > LARGE_PERCENT

    @property
    def above_floor(self) -> bool:
        """Whether more remains than the sensors make, in the held-out data or in some record."""
        return self.over_floor > ABOVE_FLOOR or self.uneven

    @property
    def in_few(self) -> bool:
        """Whether more remains than the sensors make, but for a few samples."""
        return not self.above_floor and self.error_percent > ABOVE_FLOOR * self.floor_percent


def examine_remainder(
    outputs: Sequence[str],
    training: Comparison,
    validation: Comparison,
    held: Comparison,
    chains: tuple[Sequence[Chain], Sequence[Chain]],
    differenced: Sequence[bool],
    orders: Orders,
    other: OtherValues | None = None,
) -> Remainder:
    """Examine the residual of a fitted model.

    Parameters
    ----------
    outputs:
        Names of the outputs.
    training, held:
        Comparisons over the chains that the fit and the gates looked at.
    validation:
        Free-running comparison on the held-out data.
    chains:
        Chains of `training` and of `held`.
    differenced:
        For each output, whether its noise is that of differenced counts.
    orders:
        See `Orders`.
    other:
        As in `Remainder`.
    """
    seen = validation.measured, validation.residuals, training.residuals
    floor = np.min([noise_sigmas(parts, differenced) for parts in seen], axis=0)
    rounding = rounding_sigmas([s.record for c in (*chains[0], *chains[1]) for s in c], outputs)
    size = np.sqrt(np.mean(np.concatenate(validation.measured) ** 2, axis=0))
    error, most = _rms(validation), but_for_few(np.concatenate(validation.residuals))
    noise = np.minimum(np.maximum(floor, rounding), error)
    data = _regressions(training, held, chains, orders)
    return Remainder(
        dict(zip(outputs, noise.tolist(), strict=True)),
        float(100 * np.sqrt(np.mean((noise / size) ** 2))),
        validation.error_percent,
        float(np.max(most / np.maximum(noise, 1e-300))),
        _predictable(*data) if data else 1.0,
        swing_of(training, held, chains),
        unevenness_of(training, held, chains, noise, differenced),
        drift_of(training, held, chains, ABOVE_FLOOR * noise),
        float(100 * np.sqrt(np.mean((error**2 - noise**2) / size**2))),
        _held_alone(_rms(training), _rms(held), noise, data, other),
        other,
        tuple(orders[1]),
        training.error_percent,
        spell_of(((training, chains[0]), (held, chains[1])), ABOVE_FLOOR * noise),
    )


def _rms(comparison: Comparison) -> Array:
    """Return (n_y,) root mean squares of the residuals."""
    rms: Array = np.sqrt(np.mean(np.concatenate(comparison.residuals) ** 2, axis=0))
    return rms


def _held_alone(
    training: Array,
    held: Array,
    noise: Array,
    data: tuple[Samples, Samples] | None,
    other: OtherValues | None,
) -> float:
    """Return `Remainder.held_alone` from the (n_y,) errors and the noise."""
    ratio = float(np.max(held / np.maximum(np.maximum(training, noise), 1e-300)))
    if other and other.told > MOVED:
        ratio = max(ratio, other.times)
    alone = ratio > ONLY_THERE and data is not None and _cross_validated(*data[0]) < STRUCTURE
    return ratio if alone else 1.0


def _regressions(
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


def _predictable(training: Samples, held: Samples) -> float:
    """Return `Remainder.predictable` from features (N, k) and residuals (N, n_y) of both."""
    (x, y), (xv, yv) = training, held
    gram = x.T @ x + _STRONG_RIDGE * len(x) * np.eye(x.shape[1])
    offset = y.mean(axis=0)
    guess = offset + xv @ np.linalg.solve(gram, x.T @ (y - offset))
    along = np.maximum(np.sum(yv * guess, axis=0), 0.0) ** 2
    along /= np.maximum(np.sum(yv**2, axis=0) * np.sum(guess**2, axis=0), 1e-300)
    across = _cross_validated(np.concatenate((x, xv)), np.concatenate((y, yv)))
    return max(0.0, float(np.max(along)), across)


def _cross_validated(x: Array, y: Array) -> float:
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
    stretches = [s for chain in chains for s in chain if s.scored]
    rows, targets = [], []
    scale = np.sqrt(np.mean(np.concatenate(comparison.measured) ** 2, axis=0)) + 1e-300
    for stretch, residual, measured in zip(
        stretches, comparison.residuals, comparison.measured, strict=True
    ):
        longest = _TAPS * _TAP_WIDTH
        if len(residual) <= 2 * longest:
            continue
        simulated = (measured - residual) / scale
        drive = stretch.drive.inputs[stretch.scored_from :]
        drive = drive / (np.sqrt(np.mean(drive**2)) + 1e-300)
        motion = np.concatenate((drive, simulated), axis=1)
        channels = led_by_reference(stretch.record, motion, stretch.scored_from)
        drive, moved = np.split(channels, [drive.shape[1]], axis=1)
        shaped = np.concatenate(
            (
                channels,
                np.tanh(20 * moved),
                moved * np.abs(moved),
                np.abs(moved) * np.tanh(20 * moved[:, ::-1]),
                _waves(stretch, moved, orders),
            ),
            axis=1,
        )
        lagged = [shaped[longest - lag : len(shaped) - lag : stride] for lag in _LAGS]
        bumps = np.concatenate([_bumps(column) for column in moved.T], axis=1)
        wide = np.concatenate((shaped, bumps), axis=1)
        lagged += [bumps[longest::stride]]
        slow = in_threads(partial(_slowed, np.ascontiguousarray(wide.T)), _TAUS)
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


def _bumps(values: Array) -> Array:
    """Return (N, k) hats over the range of (N,) values: their sums are functions of any shape."""
    low, high = np.quantile(values, (0.005, 0.995))
    place = (values - low) / max(high - low, 1e-300) * (_HATS - 1)
    hats: Array = np.maximum(1.0 - np.abs(place[:, np.newaxis] - np.arange(_HATS)), 0.0)
    return hats


def _slowed(values: Array, tau: float) -> Array:
    """Return (f, N) values behind a first-order lag of `tau` samples, as a rotor would be."""
    keep = np.exp(-1.0 / tau)
    slow: Array = lfilter([1 - keep], [1, -keep], values, zi=keep * values[:, :1])[0]
    return slow


def _waves(stretch: Stretch, moved: Array, orders: Orders) -> Array:
    """Return sines and cosines of multiples of the rotor angle, (N, f), beside (N, n_y) outputs.

    Those that go with the current are multiplied by each output.  None without an angle.
    """
    angle = stretch.drive.position[stretch.scored_from :]
    plain, led = orders
    if not angle.size or not (plain or led):
        return np.empty((len(moved), 0))
    pair = (np.sin, np.cos)
    columns = [f(n * angle) for n in (dict.fromkeys((1, *plain)) if plain else ()) for f in pair]
    columns += [f(n * angle) * y for n in led for f in pair for y in moved.T]
    return np.stack(columns, axis=1)
