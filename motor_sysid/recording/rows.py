"""Rows of signals as they were read, and the way from there to clean records."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motor_sysid.recording.lost_steps import after_lost_steps, lost_steps
from motor_sysid.signals.channels import CHANNELS
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Provenance, Record, Samples

Array = NDArray[np.float64]

GAP_STEPS = 10
"""A step longer than this many median steps is a gap and ends a record, if such are rare."""
USUAL_STEPS = 3
"""... longer than this many times what 99 % of the usual steps stay below."""
COMMON, RARE = 0.05, 0.01
"""Share of long steps above which they are part of the sampling, and up to which they are not."""
MOSTLY = 0.8
"""Share of the time that they hold above which they are part of it in between (bursts)."""
SHORTEST = 10
"""Pieces of fewer samples are left out where longer ones exist."""
ORDER = {channel.name: i for i, channel in enumerate(CHANNELS)}
MOST_LATE = 0.2
LATEST = 1.0
"""Rows count as overtaken, not as a new start, up to this share and delay (s)."""
NEAR = 10
"""Any share of them does, where none is more rows away from its place: no test is that short."""
ROOM = 1.5
"""Median steps between the two neighbours of a late row, where a place was left free for it."""
EPOCH = 1e7
"""A time above this (s) is a date; the record then starts at 0."""


@dataclass(frozen=True)
class Rows:
    """Signals on one time axis that may still have gaps, holes and repeated stamps.

    Attributes
    ----------
    time:
        (N,) s.
    signals, units:
        As in `Record`.
    label:
        What this stretch is called, e.g. the name of a test; empty if it has none.
    samples:
        As in `Record`; they may reach beyond the rows.
    """

    time: Array
    signals: Mapping[str, Array]
    units: Mapping[str, str]
    label: str = ''
    samples: Mapping[str, Samples] = field(default_factory=dict)

    def take(self, which: 'slice | NDArray[np.bool_] | NDArray[np.intp]') -> 'Rows':
        """Return some of the rows."""
        signals = {name: values[which] for name, values in self.signals.items()}
        return replace(self, time=self.time[which], signals=signals)


def records_from(
    rows: Rows, provenance: Provenance, max_gap: float | None
) -> tuple[list[Record], list[Finding]]:
    """Clean rows into records: holes and repeated stamps dropped, split at jumps and gaps.

    No records are returned if nothing is left.
    """
    findings: list[Finding] = []
    rows = _without_empty(rows, findings)
    rows = _without_holes(rows, findings)
    rows = in_order(rows, findings)
    pieces = [_without_repeats(piece, findings) for piece in monotonic(rows, findings)]
    pieces = [part for piece in pieces for part in _contiguous(piece, max_gap, findings)]
    pieces = [part for piece in pieces for part in _without_lost_steps(piece, findings)]
    pieces = _without_stubs(pieces, findings)
    return [_record(piece, provenance) for piece in pieces], _merged(findings)


def _without_empty(rows: Rows, findings: list[Finding]) -> Rows:
    """Leave out signals that have no value at all."""
    empty = [name for name, values in rows.signals.items() if not np.any(np.isfinite(values))]
    if not empty:
        return rows
    findings.append(empty_signals(empty))
    kept = {name: values for name, values in rows.signals.items() if name not in empty}
    return replace(rows, signals=kept)


def empty_signals(names: Sequence[str], severity: Severity = Severity.WARNING) -> Finding:
    """Return the finding for signals that are there but have no value."""
    return Finding(
        severity, 'empty_signal', f'no value at all in {", ".join(names)}; left out',
        'the model is fitted without it', 'check the sensor, column or field',
    )  # fmt: skip


def _without_holes(rows: Rows, findings: list[Finding]) -> Rows:
    """Drop rows with a value that is missing or not finite."""
    good = np.isfinite(rows.time)
    counts: dict[str, float] = {}
    for name, values in rows.signals.items():
        finite = np.isfinite(values)
        if not np.all(finite):
            counts[name] = float(np.sum(~finite))
            good &= finite
    lost = int(np.sum(~good))
    if lost == 0:
        return rows
    share = lost / len(good)
    where = ', '.join(f'{name} {count:.0f}' for name, count in counts.items()) or 'time'
    first = int(np.argmin(good))
    findings.append(
        Finding(
            Severity.WARNING, 'missing_values',
            f'{lost} of {len(good)} rows ({share:.1%}) have no finite value ({where}; first at '
            f'row {first + 1}); left out',
            'the record has holes there' if share < 0.2 else 'most of the timing may be lost',
            'look for the cause in the sensor or the logger',
            {'rows': lost, **{f'rows_{name}': count for name, count in counts.items()}},
        )
    )  # fmt: skip
    return rows.take(good)


def true_order(time: Array) -> NDArray[np.intp] | None:
    """Return the order in which rows were measured where some of them arrived late.

    A row is late if its time lies before that of a row above it.  Few such rows, or many that are
    some rows from their places, that fall into places left free for them were overtaken on the way
    (random transport delays); a clock that was set back leaves no such places, whatever the phase
    in which it goes on, and None is returned.

    Parameters
    ----------
    time:
        (N,) s.
    """
    depth = np.maximum.accumulate(time) - time
    late = depth > 0
    order = np.argsort(time, kind='stable')
    away = np.max(np.abs(order - np.arange(order.size)))
    if np.max(depth) > LATEST or (np.mean(late) > MOST_LATE and away > NEAR):
        return None
    steps = np.diff(time[order])
    room = np.concatenate((steps, [np.inf])) + np.concatenate(([np.inf], steps))
    crowded = room[late[order]] < ROOM * np.median(steps)
    return order if np.mean(crowded) < 0.5 else None


def in_order(rows: Rows, findings: list[Finding]) -> Rows:
    """Put rows that arrived late where they belong."""
    if rows.time.size < 3 or np.all(np.diff(rows.time) >= 0):
        return rows
    order = true_order(rows.time)
    if order is None:
        return rows
    findings.append(out_of_order('rows', int(np.sum(np.diff(rows.time) < 0))))
    return rows.take(order)


def out_of_order(what: str, count: int) -> Finding:
    """Return the finding for rows or messages that were put back in order."""
    return Finding(
        Severity.INFO, 'out_of_order',
        f'{what} overtook each other {times(count)}; sorted by their stamps',
        '', '', {'times': count},
    )  # fmt: skip


def times(count: int) -> str:
    """Return ``once`` or ``3 times``."""
    return 'once' if count == 1 else f'{count} times'


def monotonic(rows: Rows, findings: list[Finding]) -> Iterator[Rows]:
    """Split where time jumps backward."""
    back = np.flatnonzero(np.diff(rows.time) < 0) + 1
    if back.size:
        first = int(back[0])
        findings.append(
            Finding(
                Severity.WARNING, 'time_jumps_back',
                f'time jumps back {times(back.size)}, first from {rows.time[first - 1]:.6g} s to '
                f'{rows.time[first]:.6g} s at row {first + 1}; split into separate records there',
                'each record is simulated from its own start',
                'if these are several tests in one file, name their column as `segment_by` in a '
                'msg_config file; else look for a clock that was set',
                {'jumps': back.size, 'from_s': rows.time[first - 1], 'to_s': rows.time[first]},
            )
        )  # fmt: skip
    for start, stop in pairwise([0, *back.tolist(), len(rows.time)]):
        yield rows.take(slice(start, stop))


def _without_repeats(rows: Rows, findings: list[Finding]) -> Rows:
    """Keep the first of rows with the same stamp."""
    fresh = np.diff(rows.time, prepend=-np.inf) > 0
    lost = int(np.sum(~fresh))
    if lost:
        coarse = lost > 0.1 * len(fresh)
        findings.append(
            Finding(
                Severity.WARNING, 'repeated_stamps',
                f'{lost} of {len(fresh)} rows repeat the time of the row before; left out',
                'the stamps are coarser than the sampling, so samples are lost and the rest is '
                'jittery' if coarse else 'none, if they were sent twice',
                'write more decimals of the time' if coarse else '',
                {'rows': lost},
            )
        )  # fmt: skip
    return rows.take(fresh)


def gap_limit(time: Array) -> float:
    """Return the step in s above which a gap ends a record.

    Ten median steps, or three times what 99 % of the usual steps stay below: where the steps are
    spread, as of what is sampled on events, long ones are usual.
    """
    steps = np.diff(time)
    if steps.size == 0:
        return np.inf
    long = _long_steps(steps)
    usual = steps if _are_common(steps, long) else steps[~long]
    spread = USUAL_STEPS * float(np.quantile(usual, 0.99)) if steps.size > 100 else 0.0
    return max(GAP_STEPS * float(np.median(steps)), spread)


def _long_steps(steps: Array) -> NDArray[np.bool_]:
    """Tell which steps are as long as gaps."""
    return np.asarray(steps > GAP_STEPS * float(np.median(steps)))


def _are_common(steps: Array, long: NDArray[np.bool_]) -> bool:
    """Tell whether long steps are how it was sampled, on events or in bursts, and no gaps.

    To split at so many would leave pieces of fewer than 20 rows, or hardly any of the time.
    """
    share = float(np.mean(long))
    held = float(np.sum(steps[long]))
    return share > COMMON or (share > RARE and held > MOSTLY * float(np.sum(steps)))


def _contiguous(rows: Rows, max_gap: float | None, findings: list[Finding]) -> list[Rows]:
    """Split at gaps."""
    limit = max_gap or gap_limit(rows.time)
    steps = np.diff(rows.time)
    cuts = np.flatnonzero(steps > limit) + 1
    if cuts.size:
        longest = int(np.argmax(steps))
        findings.append(
            Finding(
                Severity.WARNING, 'gap',
                f'{cuts.size} gap{"s" * (cuts.size > 1)} of more than {limit:.3g} s, the longest '
                f'{steps[longest]:.3g} s after {rows.time[longest]:.6g} s; split into separate '
                'records there',
                'each record is simulated from its own start',
                'if the signals are slow by nature, allow it with `max_gap` in a msg_config file',
                {'gaps': cuts.size, 'longest_s': steps[longest], 'limit_s': limit},
            )
        )  # fmt: skip
    if max_gap is None and steps.size:
        findings += _long_steps_kept(steps, limit)
    return _cut(rows, cuts)


def _cut(rows: Rows, cuts: NDArray[np.intp]) -> list[Rows]:
    """Return the rows in pieces that begin at these places."""
    edges = [0, *cuts.tolist(), len(rows.time)]
    return [rows.take(slice(start, stop)) for start, stop in pairwise(edges)]


def _without_lost_steps(rows: Rows, findings: list[Finding]) -> list[Rows]:
    """Split where samples are missing in which an input stepped, but into no stubs."""
    found = after_lost_steps(rows.time, rows.signals)
    first, kept = 0, []
    for cut in found.tolist():
        if cut - first >= SHORTEST <= len(rows.time) - cut:
            kept.append(cut)
            first = cut
    cuts = np.array(kept, dtype=np.intp)
    if cuts.size:
        findings.append(lost_steps(rows.time, cuts))
    return _cut(rows, cuts)


def _long_steps_kept(steps: Array, limit: float) -> list[Finding]:
    """Say where steps like gaps were left within a record because there are so many."""
    long = _long_steps(steps) & (steps <= limit)
    if not _are_common(steps, long):
        return []
    least, count = GAP_STEPS * float(np.median(steps)), int(np.sum(long))
    return [
        Finding(
            Severity.WARNING, 'long_steps',
            f'{count} of {steps.size} steps ({count / steps.size:.1%}) are longer than {least:.3g}'
            ' s, ten median steps; taken as how it was sampled, and not split there',
            'what the signals did meanwhile is unknown, and the input is taken as held',
            f'if these are holes, split there with `max_gap: {least:.2g}` in a msg_config file; a '
            f'`max_gap` above {np.max(steps[long]):.3g} says that they belong there',
            {'steps': count, 'limit_s': least, 'longest_s': float(np.max(steps[long]))},
        )
    ]  # fmt: skip


def _without_stubs(pieces: list[Rows], findings: list[Finding]) -> list[Rows]:
    """Leave out pieces that are too short to be of use."""
    longest = max((piece.time.size for piece in pieces), default=0)
    shortest = SHORTEST if longest >= SHORTEST else 2
    kept = [piece for piece in pieces if piece.time.size >= shortest]
    lost = sum(piece.time.size for piece in pieces if piece.time.size < shortest)
    if lost:
        findings.append(
            Finding(
                Severity.INFO, 'stubs',
                f'{lost} samples in pieces of fewer than {shortest} were left out',
                '', '', {'samples': lost},
            )
        )  # fmt: skip
    return kept


def _record(rows: Rows, provenance: Provenance) -> Record:
    time, start = rows.time, 0.0
    if rows.label:
        provenance = provenance.noting(f'part `{rows.label}`')
    if time[0] > EPOCH:
        provenance = provenance.noting(f'time counts from {time[0]:.9f} s')
        start = time[0]
    names = sorted(rows.signals, key=lambda name: (ORDER.get(name, len(ORDER)), name))
    signals = {name: rows.signals[name] for name in names}
    samples = {
        name: Samples(near.time - start, near.values)
        for name, own in rows.samples.items()
        if name in signals
        for near in [own.around(time[0], time[-1])]
    }
    units = {name: rows.units[name] for name in names}
    return Record(time - start, signals, units, provenance, samples=samples)


def _merged(findings: list[Finding]) -> list[Finding]:
    """Keep one finding of each code, the one that concerns most, and say how often it came."""
    kept: dict[str, Finding] = {}
    times: dict[str, int] = {}
    for finding in findings:
        times[finding.code] = times.get(finding.code, 0) + 1
        old = kept.get(finding.code)
        if old is None or max(finding.numbers.values()) > max(old.numbers.values()):
            kept[finding.code] = finding
    return [
        replace(finding, message=f'{finding.message} (and in {times[code] - 1} other stretches)')
        if times[code] > 1
        else finding
        for code, finding in kept.items()
    ]
