"""What a diagnosis finds beside its verdict: unknowns, evidence, blind spots, differences."""

from collections.abc import Mapping
from dataclasses import dataclass

from motor_sysid.diagnosis.result.curves import Curve


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
class InRecord:
    """What has a value of its own in one record.

    Attributes
    ----------
    record:
        Source of the record, or ``record 2`` where sources do not tell.
    value, low, high:
        Its value there, with the ends of the 95 % interval against the first record that was
        compared; NaN where the record was not.
    searched:
        Whether the record was searched for effects in the end.
    """

    record: str
    value: float
    low: float
    high: float
    searched: bool


@dataclass(frozen=True)
class Difference:
    """What is not the same in all records.

    Attributes
    ----------
    name, description, unit:
        Parameter; or ``input``, for what all inputs are multiplied by, which is 1 in the first
        record that was compared.
    values:
        For every record, training records first.
    words:
        A sentence.
    """

    name: str
    description: str
    unit: str
    values: tuple[InRecord, ...]
    words: str
