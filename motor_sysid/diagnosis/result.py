"""What a diagnosis says: verdict, evidence, ladder of models, and where each model fails."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.threshold import Threshold
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]


class Verdict(Enum):
    """The five things that a diagnosis can say."""

    COMPLETE = 'complete'
    EFFECT_MISSING = 'effect_missing'
    AMBIGUOUS = 'ambiguous'
    UNKNOWN_EFFECT = 'unknown_effect'
    INSUFFICIENT_DATA = 'insufficient_data'


@dataclass(frozen=True)
class Curve:
    """A residual averaged in bins, with the law that explains it.

    Attributes
    ----------
    axis, axis_unit:
        What it is plotted against: ``speed``, ``position``, ``current``, ``time``,
        ``direction`` or ``temperature``.
    quantity, unit:
        What is plotted, e.g. ``unexplained torque`` in ``N m``.
    x, mean, band:
        (K,) bin centres, mean in each bin, and half width of its 95 % band.
    law:
        (K,) value of the fitted law in each bin, or None.
    chance:
        Probability that noise alone carries some bin that far from zero; NaN if unknown.
    """

    axis: str
    axis_unit: str
    quantity: str
    unit: str
    x: Array
    mean: Array
    band: Array
    law: Array | None = None
    chance: float = float('nan')


@dataclass(frozen=True)
class ChannelError:
    """Error of one output along one axis.

    Attributes
    ----------
    unit:
        Unit of the output.
    overall:
        Its RMS error over everything: what every bin would have without structure.
    rms, low, high:
        (K,) RMS error in each bin, and the ends of its 95 % band; NaN where a bin holds too
        little.
    chance:
        Probability that noise alone carries some bin that far from `overall`.
    """

    unit: str
    overall: float
    rms: Array
    low: Array
    high: Array
    chance: float


@dataclass(frozen=True)
class Where:
    """Error of one model along one axis.

    Attributes
    ----------
    axis:
        ``speed``, ``current``, ``position``, ``direction``, ``time`` or ``temperature``.
    unit:
        Unit of the axis.
    bins:
        (K + 1,) edges.
    error_percent:
        (K,) RMS error in each bin in percent of the RMS of the measured signal; NaN where a bin
        holds too few samples.
    error_share, time_share:
        (K,) share of the squared error and of the time that falls into each bin, 0 to 1.
    channels:
        Output to its own error in each bin.
    """

    axis: str
    unit: str
    bins: Array
    error_percent: Array
    error_share: Array
    time_share: Array
    channels: Mapping[str, ChannelError] = field(default_factory=dict)


@dataclass(frozen=True)
class Map:
    """What a model leaves, over two axes.

    Attributes
    ----------
    x_axis, x_unit, y_axis, y_unit:
        What it is drawn over.
    quantity, unit:
        What is drawn: the RMS error of an output (``speed error``), or the mean of an unexplained
        torque or voltage.
    x_edges, y_edges:
        (nx + 1,) and (ny + 1,) edges.
    value, band:
        (ny, nx) value of each cell and half width of its 95 % band; NaN where a cell holds too
        few samples.
    """

    x_axis: str
    x_unit: str
    y_axis: str
    y_unit: str
    quantity: str
    unit: str
    x_edges: Array
    y_edges: Array
    value: Array
    band: Array


@dataclass(frozen=True)
class AxisShare:
    """How much of what an equation lacks is a function of one axis.

    Attributes
    ----------
    equation, quantity, unit:
        ``torque`` or ``voltage``; what people call its lack; its unit.
    axis:
        ``direction``, ``speed``, ``current``, ``input``, ``position``, ``time``, ``temperature``,
        ``recent input``, or ``speed and current``.
    share:
        Share of the mean square beyond sensor noise that a free function of the axis predicts in
        blocks of time that it was not fitted to, 0 to 1.
    certainty:
        Gain of that prediction over its standard error.
    best:
        Whether this is the axis on which the equation's lack lives.
    """

    equation: str
    quantity: str
    unit: str
    axis: str
    share: float
    certainty: float
    best: bool = False


@dataclass(frozen=True)
class Unknown:
    """What an equation lacks, as a function of the axis on which it lives.

    Attributes
    ----------
    equation, quantity, unit:
        ``torque`` or ``voltage``; what people call its lack; its unit.
    rms, noise:
        RMS of what is lacking beyond the base parameters, and of what sensor noise makes of it.
    axis:
        The axis, empty if none explains it.
    share:
        See `AxisShare`.
    shape, amplitude:
        Its shape in words, and its size; empty and NaN where no simple shape comes near.
    words:
        All of this as a sentence.
    axes:
        All axes that were tried, best first.
    curve:
        The lack along the axis with its band, and the shape as its law; None without an axis.
    """

    equation: str
    quantity: str
    unit: str
    rms: float
    noise: float
    axis: str
    share: float
    shape: str
    amplitude: float
    words: str
    axes: tuple[AxisShare, ...]
    curve: Curve | None = None


@dataclass(frozen=True)
class Candidate:
    """One effect, tried on top of one model.

    Attributes
    ----------
    effect, title, equation:
        Key, title and the place where it enters: mechanical, electrical, input or sensor.
    law:
        Its equation as text.
    delta_bic:
        Gain in BIC; positive speaks for the effect.
    train_error_percent, validation_error_percent:
        Errors after adding and refitting.
    parameters:
        Its parameters after the refit: name to (value, unit, sigma).
    confusable_with:
        Effects that these data cannot tell from it.
    passes:
        Whether it passed every gate.
    note:
        Why it did not, or what to know, in plain words (``unphysical sign``, ``not excited by
        this record``, ...); empty if nothing is to be said.
    curve:
        Its evidence, if it has an axis.
    model, predictions:
        The refitted model, and what it gives on each record; None and empty where not kept.
    """

    effect: str
    title: str
    equation: str
    law: str
    delta_bic: float
    train_error_percent: float
    validation_error_percent: float
    parameters: Mapping[str, tuple[float, str, float]]
    confusable_with: tuple[str, ...] = ()
    passes: bool = False
    note: str = ''
    curve: Curve | None = None
    model: Model | None = None
    predictions: tuple[Mapping[str, Array], ...] = ()


@dataclass(frozen=True)
class Step:
    """One rung of the ladder: a fitted model, its errors, and what was tried on top of it.

    Attributes
    ----------
    model:
        The fitted model with estimates and sigmas.
    train_error_percent, validation_error_percent:
        Combined errors.
    channel_errors:
        Output signal to its validation error in percent.
    predictions:
        One mapping for each record of `Diagnosis.records`: output signal to (N,) simulated values.
    where:
        Where this model fails.
    curves:
        Unexplained torque or voltage against speed, position, current and time.
    candidates:
        What was tried next, best first.
    maps:
        Errors and unexplained torque and voltage over speed and current.
    """

    model: Model
    train_error_percent: float
    validation_error_percent: float
    channel_errors: Mapping[str, float]
    predictions: tuple[Mapping[str, Array], ...]
    where: tuple[Where, ...] = ()
    curves: tuple[Curve, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    maps: tuple[Map, ...] = ()


@dataclass(frozen=True)
class Evidence:
    """What speaks for an effect that was added.

    Attributes
    ----------
    effect, title:
        Key and name.
    delta_bic:
        Gain in BIC when it was added.
    error_share_percent:
        Share of the squared held-out error beyond sensor noise that it took away.
    gain_percent:
        Decrease of the held-out error.
    parameters:
        Final parameters: name to (value, unit, sigma, low, high), the last two the ends of the
        95 % interval.
    plausible:
        Whether sign and size are what physics allows.
    plausibility:
        Why, in words; may be empty.
    words:
        All of this in sentences.
    """

    effect: str
    title: str
    delta_bic: float
    error_share_percent: float
    gain_percent: float
    parameters: Mapping[str, tuple[float, str, float, float, float]]
    plausible: bool
    plausibility: str
    words: str


@dataclass(frozen=True)
class WrongParameter:
    """A base parameter that was wrong because of what was missing.

    Attributes
    ----------
    name, description, unit:
        What it is.
    before, after, sigma_before, sigma_after:
        Its value in the base model and in the last one, and their standard deviations.
    factor:
        Value before over value after; NaN where that means nothing.
    words:
        A sentence.
    """

    name: str
    description: str
    unit: str
    before: float
    after: float
    sigma_before: float
    sigma_after: float
    factor: float
    words: str


@dataclass(frozen=True)
class BlindSpot:
    """Something that the excitation does not show.

    Attributes
    ----------
    code:
        Stable name: ``one_direction``, ``never_slow``, ...
    parameters, effects:
        Base parameters that are undetermined for it, and effects that cannot be seen or told apart
        for it.
    words, remedy:
        What is missing, and what to record, in words.
    """

    code: str
    parameters: tuple[str, ...]
    effects: tuple[str, ...]
    words: str
    remedy: str


@dataclass(frozen=True)
class Rivalry:
    """Two effects that the data cannot tell apart.

    Attributes
    ----------
    effect, rival:
        Keys.
    overlap:
        Share of what the effect changes in the simulated outputs that the rival changes, too, 0 to
        1; NaN where the rival was not refitted beside it.
    regime:
        Where the two models would differ most, in words; empty if nowhere much more than here.
    words:
        A sentence.
    """

    effect: str
    rival: str
    overlap: float
    regime: str
    words: str


@dataclass(frozen=True)
class Diagnosis:
    """The whole answer.

    Attributes
    ----------
    verdict:
        One of five.
    effects:
        Keys of what it would add, in order; empty when nothing is to be added.
    steps:
        The ladder: first the base model, then one effect more in each row.
    noise_floor_percent:
        Error that sensor noise alone leaves on the validation data.
    noise_sigma:
        Output signal to the standard deviation of its sensor noise, in the signal's unit.
    reasons:
        The verdict in plain words, most important first.
    records, roles:
        What was looked at, each ``train`` or ``validate``.
    experiment:
        What to record next, if that would help.
    seconds:
        Time taken.
    warnings:
        What the fit has to say.
    unknown:
        For each equation, what it lacks and on which axis, where something unknown remains.
    evidence, wrong_parameters:
        For each effect that was added, what speaks for it; and the base parameters that were wrong
        without them.
    blind_spots:
        What the excitation does not show.
    rivalries:
        Effects that the data cannot tell apart.
    calibration:
        What was asked of evidence, and where that figure comes from; None if nobody asked.
    """

    verdict: Verdict
    effects: tuple[str, ...]
    steps: tuple[Step, ...]
    noise_floor_percent: float
    noise_sigma: Mapping[str, float]
    reasons: tuple[str, ...]
    records: tuple[Record, ...]
    roles: tuple[str, ...]
    experiment: Mapping[str, str] | None = None
    seconds: float = 0.0
    warnings: tuple[str, ...] = field(default_factory=tuple)
    unknown: tuple[Unknown, ...] = ()
    evidence: tuple[Evidence, ...] = ()
    wrong_parameters: tuple[WrongParameter, ...] = ()
    blind_spots: tuple[BlindSpot, ...] = ()
    rivalries: tuple[Rivalry, ...] = ()
    calibration: Threshold | None = None

    @property
    def model(self) -> Model:
        """The last model of the ladder."""
        return self.steps[-1].model
