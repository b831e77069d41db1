"""What is drawn of a diagnosis: curves, errors by axis, maps."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
