"""Tables in which signals have rows of their own: loggers that write what they just got.

A signal that has a value in some rows only, one after the other at even times, was sampled that
often.  To drop the rows that lack one would leave the slowest, or none.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.recording.align import align, choose_base, is_regular, Series
from motor_sysid.recording.rows import in_order, monotonic, Rows
from motor_sysid.signals.channels import Role, role_of
from motor_sysid.signals.finding import Finding
from motor_sysid.signals.record import Samples

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SPARSE = 0.7
"""Share of the rows with a value up to which a signal may have rows of its own."""
FEWEST = 10
"""Values that it must have."""
LONGEST = 1e9
"""Time (s) that no recording lasts."""


def joined(rows: Rows, base_clock: str) -> tuple[list[Rows], list[Finding]]:
    """Bring signals that have rows of their own onto one time axis; see `align`.

    Rows of which none has are returned as they are.  Those that overtook each other are sorted,
    and each time that the clock starts anew is joined by itself.
    """
    findings: list[Finding] = []
    pieces = list(monotonic(in_order(rows.take(np.isfinite(rows.time)), findings), findings))
    found = [_series(piece) for piece in pieces]
    if not any(found):
        return [rows], []
    parts: list[Rows] = []
    for piece, series in zip(pieces, found, strict=True):
        if not series:
            parts.append(piece)
            continue
        joint, told = align(series, choose_base(series, base_clock), rows.units)
        start = float(piece.time[0])
        parts += [_from(part, start, rows.label) for part in joint if part.time.size]
        findings += told
    return parts, findings


def _series(rows: Rows) -> list[Series]:
    """Return the signals by the rows in which they have values; nothing if all have the same."""
    time, values = rows.time, rows.signals
    if time.size < FEWEST:
        return []
    alike: dict[bytes, list[str]] = defaultdict(list)
    for name, column in values.items():
        if np.any(np.isfinite(column)):
            alike[np.isfinite(column).tobytes()].append(name)
    masks = {key: np.isfinite(values[names[0]]) for key, names in alike.items()}
    if time[-1] - time[0] > LONGEST:
        return []
    stamps = np.round((time - time[0]) * 1e9).astype(np.int64)
    if not any(_is_sparse(mask, stamps, alike[key]) for key, mask in masks.items()):
        return []
    return [
        Series(
            ', '.join(alike[key]), stamps[mask], stamps[mask],
            {name: values[name][mask] for name in alike[key]},
        )
        for key, mask in masks.items()
    ]  # fmt: skip


def _is_sparse(mask: Mask, stamps: NDArray[np.int64], names: Sequence[str]) -> bool:
    """Tell whether signals have a value in some rows only because they were sampled there."""
    if np.mean(mask) > SPARSE or np.sum(mask) < FEWEST:
        return False
    held = all(role_of(name) is not Role.MEASURED for name in names)
    return held or is_regular(stamps[mask])


def _from(rows: Rows, start: float, label: str) -> Rows:
    """Return rows whose time counts from `start` on the clock that it was."""
    samples = {
        name: Samples(own.time + start, own.values) for name, own in rows.samples.items()
    }
    return replace(rows, time=rows.time + start, label=label, samples=samples)
