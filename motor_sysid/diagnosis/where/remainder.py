"""Tell noise from missing physics in what is left when no candidate helps any more.

Sensor noise and random loads cannot be predicted from the input; missing physics can.  So a
general regression from the simulated motion to the residual is fitted on the training data and
judged on the held-out data: the share of the remaining error that it predicts there is structure.

What cannot be predicted is missing physics, too, if it swings at one frequency in training and
held-out data, if it drifts, if the model describes one record much worse than another, or if the
held-out data ask for other values of its parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.diagnosis.where.drift import DRIFT, drift_of
from motor_sysid.diagnosis.where.oscillation import Swing, swing_of
from motor_sysid.diagnosis.where.other_values import MOVED, OtherValues
from motor_sysid.diagnosis.where.predictable import (
    cross_validated,
    Orders,
    predictable,
    regressions,
    Samples,
)
from motor_sysid.diagnosis.where.spell import Spell, spell_of
from motor_sysid.diagnosis.where.uneven_records import but_for_few, UNEVEN, unevenness_of
from motor_sysid.estimation.batch import Chain
from motor_sysid.signals.metrics import sizes_of
from motor_sysid.signals.noise import noise_sigmas, rounding_sigmas

Array = NDArray[np.float64]
STRUCTURE = 0.1
"""Share of the remaining error that must be predictable before it is called missing physics."""

LED = 0.1
"""Share of the remaining error that waves in proportion to the current must predict, beside all
else, so that they are spoken of: of a jittered record some stand out that predict nothing."""

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
        twelfths of all data predict of the rest, whichever is larger; near 0 for noise, 1 where
        the data are too short to tell.
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
    short:
        Whether the data are too short to tell what of it is predictable.
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
    short: bool = False

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
    size = sizes_of(outputs, validation.measured)
    error, most = _rms(validation), but_for_few(np.concatenate(validation.residuals))
    noise = np.minimum(np.maximum(floor, rounding), error)
    data = regressions(training, held, chains, orders)
    told = predictable(*data) if data else 1.0
    without = regressions(training, held, chains, (orders[0], ())) if orders[1] and data else None
    seen_in_waves = without is not None and told - predictable(*without) > LED
    return Remainder(
        dict(zip(outputs, noise.tolist(), strict=True)),
        _percent(noise**2, size),
        validation.error_percent,
        float(np.max(most / np.maximum(noise, 1e-300))),
        told,
        swing_of(training, held, chains),
        unevenness_of(training, held, chains, noise, differenced),
        drift_of(training, held, chains, ABOVE_FLOOR * noise),
        _percent(error**2 - noise**2, size),
        _held_alone(_rms(training), _rms(held), noise, data, other),
        other,
        tuple(orders[1]) if seen_in_waves else (),
        training.error_percent,
        spell_of(((training, chains[0]), (held, chains[1])), ABOVE_FLOOR * noise),
        data is None,
    )


def _percent(squares: Array, size: Array) -> float:
    """Return the root of mean squares (n_y,) in percent of the outputs that are not nothing."""
    there = size > 0.0
    return float(100 * np.sqrt(np.mean(squares[there] / size[there] ** 2))) if any(there) else 0.0


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
    alone = ratio > ONLY_THERE and data is not None and cross_validated(*data[0]) < STRUCTURE
    return ratio if alone else 1.0
