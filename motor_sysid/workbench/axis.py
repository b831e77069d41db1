"""One time axis for all records of a page, and few enough points on it to draw.

Every stretch is cut into buckets of equally many samples.  A bucket becomes two points: the
smallest and the largest value in it, in the order in which they occurred, so that no spike is
lost.  The held-out stretches get half of the points, because they are looked at most closely.
"""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

CONTIGUOUS = 3.0
"""Records closer than this many sample times are drawn as one."""

GAP = 0.02
"""Room between two others, as a share of the shorter one: little of any view, however many."""


@dataclass(frozen=True)
class Stretch:
    """Where one record lies on the common axis.

    Attributes
    ----------
    start, end:
        s on the common axis.
    clock:
        s that a tick on the common axis has to be reduced by to give the time since the start of
        the recording that the record is part of.
    size:
        Samples in a bucket; 1 draws every sample.
    picks:
        (P,) indices of the samples that give the points their time.
    """

    start: float
    end: float
    clock: float
    size: int
    picks: Indices


def lay_out(records: Sequence[Record], roles: Sequence[str], points: int) -> tuple[Stretch, ...]:
    """Put records one after the other, `points` drawn points in all."""
    shares = _shares(records, roles)
    stretches: list[Stretch] = []
    for k, (record, share, own) in enumerate(
        zip(records, shares, _own_starts(records), strict=True)
    ):
        size = bucket_size(len(record), share * points)
        clock = 0.0 - own
        if k and _continues(records[k - 1], record):
            clock = stretches[-1].clock
        elif k:
            gap = GAP * min(records[k - 1].duration, record.duration)
            clock = stretches[-1].end + gap - own
        start = clock + own
        picks = bucket_points(len(record), size)
        stretches.append(Stretch(start, start + record.duration, clock, size, picks))
    return tuple(stretches)


def bucket_size(samples: int, points: float) -> int:
    """Return how many samples share a bucket so that about `points` points remain."""
    if samples <= max(points, 1.0):
        return 1
    size = max(2, int(np.ceil(2 * samples / max(points, 2))))
    while samples % size == 1:  # the last bucket needs two samples for its two points
        size += 1
    return size


def bucket_points(samples: int, size: int) -> Indices:
    """Return the samples whose time the points bear: start and middle of each bucket."""
    if size == 1:
        return np.arange(samples)
    starts = np.arange(0, samples, size)
    middles = np.minimum(starts + size // 2, samples - 1)
    return np.column_stack((starts, middles)).ravel()


def decimate(values: Array, size: int) -> Array:
    """Return smallest and largest value of each bucket, in the order of their occurrence.

    Parameters
    ----------
    values:
        (N,) samples; non-finite ones are passed over unless a bucket has no other.
    size:
        Samples in a bucket; 1 returns the samples.
    """
    finite = np.where(np.isfinite(values), values, np.nan)
    if size == 1:
        return finite
    padded = np.concatenate((finite, np.full(-len(values) % size, np.nan))).reshape(-1, size)
    low = np.argmin(np.where(np.isnan(padded), np.inf, padded), axis=1)
    high = np.argmax(np.where(np.isnan(padded), -np.inf, padded), axis=1)
    rows = np.arange(len(padded))
    return np.column_stack(
        (padded[rows, np.minimum(low, high)], padded[rows, np.maximum(low, high)])
    ).ravel()


def join(parts: Sequence[NDArray[np.generic]], gap: float) -> Array:
    """Concatenate the points of all stretches with one point `gap` between neighbours."""
    joined: list[ArrayLike] = [parts[0]]
    for part in parts[1:]:
        joined += [[gap], part]
    return np.concatenate(joined).astype(np.float64)


def axis_times(stretches: Sequence[Stretch], records: Sequence[Record]) -> Array:
    """Return the time of each point on the common axis in s, a point in each joint included."""
    times: list[Array] = []
    for stretch, record in zip(stretches, records, strict=True):
        own = stretch.start + record.time[stretch.picks] - record.time[0]
        if times:
            times.append(np.array([(times[-1][-1] + own[0]) / 2]))
        times.append(own)
    return np.concatenate(times)


def pack(values: ArrayLike, kind: str = '<f4') -> str:
    """Return an array as base64 text, by default of little-endian float32."""
    wide = np.asarray(values)
    if kind == '<f4':
        limit = float(np.finfo(np.float32).max)
        wide = np.where(np.abs(wide) <= limit, wide, np.nan)
    return b64encode(np.ascontiguousarray(wide, dtype=kind).tobytes()).decode('ascii')


def _shares(records: Sequence[Record], roles: Sequence[str]) -> list[float]:
    """Return each record's part of the points: held-out ones share one half by duration."""
    held = [role == 'validate' for role in roles]
    spans = dict.fromkeys(held, 0.0)
    for record, kind in zip(records, held, strict=True):
        spans[kind] += record.duration
    return [
        record.duration / spans[kind] / len(spans)
        for record, kind in zip(records, held, strict=True)
    ]


def _own_starts(records: Sequence[Record]) -> list[float]:
    """Return when each record starts, in s since the start of its recording."""
    begins: dict[str, float] = {}
    for record in records:
        source = record.provenance.source
        begins[source] = min(begins.get(source, np.inf), float(record.time[0]))
    return [float(r.time[0]) - begins[r.provenance.source] for r in records]


def _continues(before: Record, after: Record) -> bool:
    gap = float(after.time[0] - before.time[-1])
    same = before.provenance.source == after.provenance.source
    return same and 0 < gap <= CONTIGUOUS * max(before.dt, after.dt)
