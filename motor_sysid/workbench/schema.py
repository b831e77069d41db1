"""The view: everything that the page shows, as JSON.

Arrays are base64 text of little-endian float32 unless said otherwise; NaN stands for nothing.
All signals share the points of `View.time`.  Errors are measured minus model.
"""

from typing import TypedDict

SCHEMA = 'motor_sysid/view/1'


class Named(TypedDict):
    """A key for programs and a title for people."""

    key: str
    title: str


class VerdictView(TypedDict):
    """What the diagnosis says."""

    key: str
    title: str
    effects: list[Named]
    reasons: list[str]
    warnings: list[str]
    experiment: dict[str, str] | None
    seconds: float | None
    unknown: list['UnknownView']
    blind_spots: list['BlindSpotView']
    differences: list['DifferenceView']


class StretchView(TypedDict):
    """One record on the common time axis.

    `clock` is subtracted to get the time since the start of the recording that it is part of.  A
    pair of points stands for `bucket` samples: the smallest and the largest; 1: every sample has
    a point of its own.
    """

    label: str
    source: str
    role: str
    start: float
    end: float
    clock: float
    samples: int
    bucket: int
    rate_hz: float | None


class ChannelView(TypedDict):
    """One recorded signal; `kind` is output, input or reference; `sigma` is its sensor noise."""

    key: str
    label: str
    unit: str
    kind: str
    values: str
    sigma: float | None


class PanelView(TypedDict):
    """Channels drawn in one panel."""

    key: str
    title: str
    unit: str
    channels: list[str]
    shown: bool
    stepped: bool


class RegimesView(TypedDict):
    """Regime of each point, uint8 (255: none), as an index into `names`."""

    names: list[str]
    ids: str


class MapView(TypedDict):
    """Cells of the map; `ids` holds the cell of each point as uint16 (65535: none).

    Values of a cell are RMS errors divided by `scale` (noise sigma, or 1 where unknown).
    """

    x: str
    y: str
    x_unit: str
    y_unit: str
    x_edges: list[float]
    y_edges: list[float]
    ids: str
    counts: str
    scale: float
    in_sigma: bool


class RegimeShare(TypedDict):
    """How much of the squared error and of the time falls into a regime, 0 to 1.

    All outputs count alike in the error, as in `StepView.validation_error_percent`.
    """

    name: str
    error_share: float | None
    time_share: float | None
    error_percent: float | None


class CurveView(TypedDict):
    """A `motor_sysid.diagnosis.result.curves.Curve`."""

    axis: str
    axis_unit: str
    quantity: str
    unit: str
    x: str
    mean: str
    band: str
    law: str | None
    chance: float | None


class MapLayer(TypedDict):
    """A `motor_sysid.diagnosis.result.curves.Map`.

    `value` and `band` are given row by row, NaN for no cell.
    """

    quantity: str
    unit: str
    x: str
    x_unit: str
    y: str
    y_unit: str
    x_edges: list[float | None]
    y_edges: list[float | None]
    value: str
    band: str


class ChannelErrorView(TypedDict):
    """A `motor_sysid.diagnosis.result.curves.ChannelError`."""

    unit: str
    overall: float | None
    rms: list[float | None]
    low: list[float | None]
    high: list[float | None]
    chance: float | None


class AxisShareView(TypedDict):
    """How much of what an equation lacks is a function of one axis, 0 to 1."""

    axis: str
    share: float | None
    best: bool


class UnknownView(TypedDict):
    """A `motor_sysid.diagnosis.result.findings.Unknown`."""

    quantity: str
    axis: str
    shape: str
    words: str
    axes: list[AxisShareView]
    curve: CurveView | None


class BlindSpotView(TypedDict):
    """A `motor_sysid.diagnosis.result.findings.BlindSpot`."""

    words: str
    remedy: str


class InRecordView(TypedDict):
    """A `motor_sysid.diagnosis.result.findings.InRecord`; plain numbers."""

    record: str
    value: float | None
    low: float | None
    high: float | None
    searched: bool


class DifferenceView(TypedDict):
    """A `motor_sysid.diagnosis.result.findings.Difference`."""

    name: str
    description: str
    unit: str
    values: list[InRecordView]


class WhereView(TypedDict):
    """A `motor_sysid.diagnosis.result.curves.Where`."""

    axis: str
    unit: str
    bins: list[float | None]
    error_percent: list[float | None]
    error_share: list[float | None]
    time_share: list[float | None]
    channels: dict[str, ChannelErrorView]


class ParameterView(TypedDict):
    """One parameter; `base` is its value in M0; `sigma` is None if not estimated.

    `known` is False where the data hold no information on it (infinite sigma).
    """

    name: str
    effect: str
    description: str
    value: float | None
    sigma: float | None
    known: bool
    unit: str
    free: bool
    on_bound: bool
    base: float | None


class CandidateParameter(TypedDict):
    """A parameter of a candidate after its refit."""

    name: str
    value: float | None
    unit: str
    sigma: float | None


class CandidateView(TypedDict):
    """A `motor_sysid.diagnosis.result.result.Candidate`.

    One that was not refitted has no parameters and no errors.  `added` names the model that took
    it, `by_hand` tells whether that was the user rather than the diagnosis.
    """

    effect: str
    title: str
    equation: str
    law: str
    delta_bic: float | None
    train_error_percent: float | None
    validation_error_percent: float | None
    parameters: list[CandidateParameter]
    confusable_with: list[Named]
    passes: bool
    note: str
    curve: CurveView | None
    added: str
    by_hand: bool


class StepView(TypedDict):
    """One model of the ladder, and all that is shown of it.

    `parent` is the index of the model that it was made from, None for the first; `addable` are the
    keys of those of `View.effects` that it has room for.
    """

    name: str
    parent: int | None
    effects: list[Named]
    added: list[Named]
    train_error_percent: float | None
    validation_error_percent: float | None
    times_floor: float | None
    channel_errors: dict[str, float | None]
    model: dict[str, str]
    error: dict[str, str]
    map: str | None
    regimes: list[RegimeShare]
    where: list[WhereView]
    curves: list[CurveView]
    maps: list[MapLayer]
    candidates: list[CandidateView]
    parameters: list[ParameterView]
    addable: list[str]


class View(TypedDict):
    """The whole page.

    `time` holds float64 s on the common axis; `focus` is the stretch in s and `first` the model
    that the page opens with; `last` the model that the verdict is about.  With `actions` the page
    may ask to add `effects`.
    """

    schema: str
    actions: bool
    source: str
    motor: Named
    held_out: str
    verdict: VerdictView
    noise_floor_percent: float | None
    records: list[StretchView]
    time: str
    channels: list[ChannelView]
    panels: list[PanelView]
    primary: str
    focus: list[float]
    first: int
    last: int
    effects: list[Named]
    regimes: RegimesView | None
    map: MapView | None
    steps: list[StepView]
