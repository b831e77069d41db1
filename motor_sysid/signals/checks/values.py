"""Values that cannot be right: not finite, stuck, saturated, or in coarse steps."""

from collections.abc import Iterator, Sequence

import numpy as np

from motor_sysid.signals.channels import Role, role_of, SLOW
from motor_sysid.signals.checks.common import Array, main_input
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.flat_tops import limits_of
from motor_sysid.signals.held import runs
from motor_sysid.signals.lattice import lattice
from motor_sysid.signals.record import Record
from motor_sysid.signals.strays import without_strays

ABSURD = 1e30
"""No signal of a motor is larger in SI."""
COARSE = 0.1
"""A step of more than this many RMS is coarse."""
AT_REST = 0.01
"""Share of the top speed below which a motor rests, filters of its speed and all."""
SELDOM = 0.05
"""Share of samples that repeat the one before, below which a signal moves by noise alone."""


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look at the values of each signal."""
    for name in dict.fromkeys(name for record in records for name in record):
        having = [record for record in records if name in record]
        values = np.concatenate([record[name] for record in having])
        if not np.all(np.abs(values) < ABSURD):
            yield _not_finite(name, values)
        elif role_of(name) is Role.MEASURED and name not in SLOW:
            longest = max(having, key=len)
            yield from _stuck(name, values, records)
            for record in having:
                yield from _frozen(name, record)
            if name.startswith('current'):
                yield from _saturated(name, longest)
            yield from _coarse(name, values, longest)
        elif name == main_input(records[0]):
            yield from _clipped_input(name, values, longest=max(having, key=len))


def _not_finite(name: str, values: Array) -> Finding:
    count = int(np.sum(~(np.abs(values) < ABSURD)))
    return Finding(
        Severity.ERROR, 'non_finite',
        f'{name} has {count} values that are not finite or beyond {ABSURD:g}',
        'nothing can be simulated or fitted', 'drop or mend these samples',
        {'count': count},
    )  # fmt: skip


def _stuck(name: str, values: Array, records: Sequence[Record]) -> Iterator[Finding]:
    """One value all the time, though something else shows that it should move."""
    if np.ptp(values) > 0:
        return
    partner = {'speed': 'position', 'position': 'speed'}.get(name, main_input(records[0]))
    moving = partner and any(np.ptp(r[partner]) > 0 for r in records if partner in r)
    if not moving or (name == 'speed' and 'position' not in records[0]):
        return
    unit = next(record.units[name] for record in records if name in record)
    yield Finding(
        Severity.ERROR, 'stuck_channel',
        f'{name} is {values[0]:.6g} {unit} all the time while {partner} changes',
        'the model would be fitted to a dead sensor',
        'check wiring, topic and field; leave the signal out if it is not measured',
        {'value': float(values[0])},
    )  # fmt: skip


def _frozen(name: str, record: Record) -> Iterator[Finding]:
    """Find a long stretch of one value in a signal that otherwise always changes."""
    values = record[name]
    starts, lengths = runs(values)
    repeats = 1 - (lengths.size - 1) / max(values.size - 1, 1)
    if repeats > 0.5 or values.size < 200:
        return
    expected = np.log(values.size) / -np.log(max(repeats, 1e-3))
    k = int(np.argmax(lengths))
    start, length = int(starts[k]), int(lengths[k])
    driver = main_input(record)
    inside = record[driver][start : start + length] if driver else values[:1]
    silent = repeats > SELDOM and np.ptp(inside) == 0
    if length < 20 * expected or silent or _resting(name, record, start, length):
        return
    yield Finding(
        Severity.WARNING, 'frozen_stretch',
        f'{name} does not change at all for {length * record.dt:.3g} s from '
        f'{record.time[start]:.4g} s, {length} samples in a row',
        'the sensor or driver was silent; the model is fitted to old values there',
        'leave that stretch out, and look for a stalled driver',
        {'start_s': float(record.time[start]), 'duration_s': length * record.dt},
    )  # fmt: skip


def _resting(name: str, record: Record, start: int, length: int) -> bool:
    """Tell whether it is natural that a signal does not change: a motor at rest."""
    value = abs(record[name][start])
    if name == 'position':
        speed = np.abs(record['speed']) if 'speed' in record else np.zeros(len(record))
        return bool(np.median(speed[start : start + length]) <= AT_REST * np.max(speed))
    found = lattice(record[name])
    return bool(value == 0 or (found is not None and value < 3 * found.step))


def _saturated(name: str, record: Record) -> Iterator[Finding]:
    """Flat tops: what lies beyond the range of the sensor is cut off."""
    values = without_strays(record)[name]
    for end, limit in zip(('smallest', 'largest'), limits_of(values), strict=True):
        if not np.isfinite(limit):
            continue
        there = values == limit
        share = float(np.mean(there))
        yield Finding(
            Severity.WARNING, 'saturation',
            f'{name} is cut off at its {end} value {limit:.5g} {record.units[name]}, in '
            f'{np.sum(there)} of {there.size} samples',
            'what lies beyond is cut off: fits that predict this current cut that off, too, and '
            'see nothing of the largest ones; in others gains come out too small',
            'use a larger range of the sensor, or smaller inputs',
            {'limit': limit, 'share': share},
        )  # fmt: skip


def _clipped_input(name: str, values: Array, longest: Record) -> Iterator[Finding]:
    """Note a closed loop that often asks for more than the supply gives."""
    levels, counts = np.unique(longest[name], return_counts=True)
    if levels.size < 50:
        return
    ends = counts[[0, -1]]
    share = float(np.sum(ends[ends > 20 * np.median(counts)])) / len(longest)
    if share < 0.02:
        return
    yield Finding(
        Severity.INFO, 'input_at_limit',
        f'{name} is at a limit ({np.min(values):.4g} or {np.max(values):.4g} '
        f'{longest.units[name]}) for {share:.0%} of the time',
        'none if this is what the motor gets; a command would have been clipped on the way',
        'record what is applied, not what is asked for', {'share': share},
    )  # fmt: skip


def _coarse(name: str, values: Array, record: Record) -> Iterator[Finding]:
    """Report the step of a quantized signal."""
    found = lattice(values)
    rms = float(np.sqrt(np.mean((values - np.mean(values)) ** 2)))
    if found is None or rms == 0 or name == 'position':
        return
    ratio = found.step / rms
    coarse = ratio > COARSE and not (name == 'speed' and 'position' in record)
    unit = record.units[name]
    yield Finding(
        Severity.WARNING if coarse else Severity.INFO, 'quantization',
        f'{name} comes in steps of {found.step:.4g} {unit} ({ratio:.1%} of its RMS)',
        'small effects (friction, cogging) drown in the steps' if coarse else '',
        'record the position too, take a finer sensor, or larger motion' if coarse
        else '',
        {'step': found.step, 'relative': ratio},
    )  # fmt: skip
