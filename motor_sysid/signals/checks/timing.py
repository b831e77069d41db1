"""Rate, jitter and missing samples."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

JITTER_INFO, JITTER_WARNING = 0.05, 0.3
"""Deviation of a step from the median step (99th percentile), relative."""
MISSING_WARNING = 0.005
"""Share of samples that may be missing."""
ON_GRID = 0.15
"""Distance of a long step from a multiple of the median step at which samples are missing."""
WINDOW, COARSE, SLOWER = 200, 1.0, 1.03
"""Samples in which stamps in units of the clock stay within so many of them on the way of a steady
loop that is slower than one; samples that are lost at random wander off."""
SHORTEST, LONGEST = 1e-9, 1e4
"""Time between two samples in s that a record of a motor can have."""
FEW = 200
"""Samples below which nothing much can be fitted."""


def absurd(records: Sequence[Record]) -> Iterator[Finding]:
    """Find steps that no recording has; what else could be said of such a record is nonsense."""
    for record in records:
        if not SHORTEST <= record.dt <= LONGEST:
            yield Finding(
                Severity.ERROR, 'absurd_step',
                f'samples {record.dt:.3g} s apart are outside {SHORTEST:g} to {LONGEST:g} s',
                'nothing can be simulated or fitted',
                'give the unit of the time: `time [ms]` as header, or `time: {column: COLUMN, '
                'unit: ms}` in a msg_config file; look for stamps that are damaged',
                {'dt_s': record.dt},
            )  # fmt: skip
            return


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look at the time stamps."""
    samples = sum(map(len, records))
    duration = sum(record.duration for record in records)
    longest = max(records, key=len)
    parts = f' in {len(records)} records' if len(records) > 1 else ''
    yield Finding(
        Severity.INFO, 'rate',
        f'{samples} samples{parts}, {duration:.4g} s at {1 / longest.dt:.4g} Hz',
        numbers={'samples': samples, 'duration_s': duration, 'rate_hz': 1 / longest.dt,
                 'dt_s': longest.dt, 'records': len(records)},
    )  # fmt: skip
    if samples < FEW:
        yield Finding(
            Severity.WARNING, 'few_samples', f'only {samples} samples',
            'parameters will be uncertain, and effects cannot be told apart',
            'record longer or faster: some seconds, at least 1000 samples',
            {'samples': samples},
        )  # fmt: skip
    yield from _jitter(longest)
    yield from _missing(records)


def _jitter(record: Record) -> Iterator[Finding]:
    steps = np.diff(record.time) / record.dt
    deviation = np.abs(steps - np.maximum(1, np.round(steps)))  # a missing sample is no jitter
    worst = float(np.quantile(deviation, 0.99))
    if worst < JITTER_INFO:
        return
    serious = worst > JITTER_WARNING
    yield Finding(
        Severity.WARNING if serious else Severity.INFO, 'jitter',
        f'1 % of the steps differ by more than {worst:.0%} from the median of '
        f'{record.dt * 1e3:.4g} ms',
        'the fast (electrical) dynamics are blurred, and values between samples are guessed',
        'stamp where the signal is sampled, not where it is logged; sample from a timer',
        {'p99_relative': worst, 'dt_s': record.dt},
    )  # fmt: skip


def _coarsely_stamped(time: Array, step: float) -> bool:
    """Whether steps of one and two units of the clock are those of a steady loop in between.

    Then every sample is within a unit of where it would be, for any number of samples.
    """
    count = time.size // WINDOW
    if count == 0:
        return False
    parts = time[: count * WINDOW].reshape(count, WINDOW) / step
    place = np.arange(WINDOW) - 0.5 * (WINDOW - 1)
    apart = parts - parts.mean(axis=1, keepdims=True)
    pace = apart @ place / (place @ place)
    off = np.max(np.abs(apart - pace[:, np.newaxis] * place), axis=1)
    return bool(np.median(off) < COARSE and np.median(pace) > SLOWER)


def _missing(records: Sequence[Record]) -> Iterator[Finding]:
    missing = total = 0.0
    longest = 0.0
    for record in records:
        steps = np.diff(record.time) / record.dt
        long = steps[steps > 1.5]
        if long.size and np.mean(np.abs(long - np.round(long)) < ON_GRID) < 0.8:
            continue  # irregular by nature: nothing is missing
        if _coarsely_stamped(record.time, record.dt):
            continue
        missing += float(np.sum(np.round(steps[steps > 1.5]) - 1))
        total += len(record)
        longest = max(longest, float(np.max(steps)) * record.dt)
    if missing == 0:
        return
    share = missing / (missing + total)
    yield Finding(
        Severity.WARNING if share > MISSING_WARNING else Severity.INFO, 'missing_samples',
        f'about {missing:.0f} samples ({share:.2%}) are missing; the longest hole is '
        f'{longest * 1e3:.4g} ms',
        'the input within a hole is unknown and taken as constant',
        'look for lost messages (queue depth, QoS) or a busy logger',
        {'missing': missing, 'share': share, 'longest_s': longest},
    )  # fmt: skip
