"""One time of reception for all topics of a bag, also where the recorder's clock was set back.

A clock is set back by a time server, or with a simulation that starts anew while its time is
recorded (``--use-sim-time``).  Receive times then run through the same range twice, and sorting
by them would shuffle two stretches together.  Messages lie in a bag as they came, but for a few
that threads of the recorder swapped; so a clock was set back where a topic's receive times fall
and stay behind, and from there on the time of reception goes on from where it was.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from motor_sysid.recording.messages import Messages, Stamps
from motor_sysid.recording.rows import times
from motor_sysid.signals.finding import Finding, Severity

SWAPPED = 10
"""Fewer messages in a row that are behind were swapped by the recorder ..."""
LATE = 1_000_000_000
"""... unless they are behind by more than this, ns."""
LEAST, MOST, FURTHEST = -(2**62), 2**62, 2**61
"""Times, and the longest shift of them, ns: those of damaged messages may be anything."""


def in_one_time(read: Mapping[str, Messages]) -> tuple[dict[str, Messages], list[Finding]]:
    """Let the time of reception go on where the clock was set back, and sort by it.

    Parameters
    ----------
    read:
        Topic to its messages, in the order of storage.
    """
    cuts = _cuts(interval for one in read.values() for interval in _set_back(one))
    parts = {name: np.searchsorted(cuts, one.places, side='right') for name, one in read.items()}
    first, last = np.full(len(cuts) + 1, MOST), np.full(len(cuts) + 1, LEAST)
    for name, one in read.items():
        np.minimum.at(first, parts[name], one.received)
        np.maximum.at(last, parts[name], one.received)
    back = np.maximum(last[:-1] - first[1:] + 1, 0)
    shifts = np.minimum(np.concatenate(([0.0], np.cumsum(back, dtype=float))), FURTHEST)
    going_on = {
        name: replace(one, received=one.received + shifts.astype(np.int64)[parts[name]])
        for name, one in read.items()
    }
    findings = [_told(back)] if cuts else []
    return {name: one.sorted_by(one.received) for name, one in going_on.items()}, findings


def _set_back(one: Messages) -> Iterator[tuple[int, int]]:
    """Yield the places of the last message before and the first after the clock was set back."""
    received, top, begin = one.received, LEAST, 0
    for k in (np.flatnonzero(np.diff(received) < 0) + 1).tolist():
        top, begin = max(top, int(received[begin:k].max())), k
        ahead = received[k : k + SWAPPED]
        stays = ahead.size == SWAPPED and int(ahead.max()) < top
        if stays or top - int(received[k]) > LATE:
            yield int(one.places[k - 1]), int(one.places[k])
            top = LEAST


def _cuts(intervals: Iterable[tuple[int, int]]) -> list[int]:
    """Return the fewest places that lie in all intervals: several topics show the same."""
    cuts: list[int] = []
    for before, after in sorted(intervals, key=lambda interval: interval[1]):
        if not cuts or cuts[-1] <= before:
            cuts.append(after)
    return cuts


def _told(back: Stamps) -> Finding:
    most = float(back.max()) / 1e9
    return Finding(
        Severity.INFO, 'clock_set_back',
        f"the recorder's clock was set back {times(back.size)}, by up to {most:.6g} s; messages "
        'were taken in the order in which they were stored',
        'stamps that were set by the same clock jump back, too, and begin a new record there', '',
        {'times': back.size, 'by_s': most},
    )  # fmt: skip
