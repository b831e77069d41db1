"""Speed that is the difference of encoder counts, and what the counts say about its unit."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from motor_sysid.signals.checks.common import Array, is_angular
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.lateness import speed_lateness
from motor_sysid.signals.lattice import lattice
from motor_sysid.signals.record import Record
from motor_sysid.signals.units import TURN

TURNS_PER_UNIT = {'rad/s': 1 / TURN, 'rpm': 1 / 60, 'deg/s': 1 / 360, 'turns/s': 1.0}
WHOLE = 0.02
"""Distance from a whole number of counts per turn that still counts as whole."""
LATE, EARLY, CERTAIN = 0.75, 0.25, 5.0
"""Samples by which a speed is behind the position, or ahead of it, that are told, beyond so many
standard errors: a mean over the last sample is half a sample behind."""
LARGEST = 50_000
"""Counts per turn above which a whole number proves nothing."""


@dataclass(frozen=True)
class Encoder:
    """How a speed was measured.

    Attributes
    ----------
    counts_per_turn:
        Of the encoder, NaN if unknown.
    differenced:
        Whether the speed is the difference of the position over the last sample.
    step:
        Smallest step of the speed in its unit, NaN if it has none.
    """

    counts_per_turn: float
    differenced: bool
    step: float


def encoder_of(record: Record) -> Encoder:
    """Find out how the speed of a record was measured."""
    step = np.nan
    differenced = False
    if 'speed' in record and (found := lattice(record['speed'])):
        step = _refined(record['speed'], found.step)
    if 'speed' in record and 'position' in record:
        slope = np.diff(record['position']) / np.diff(record.time)
        left = record['speed'][1:] - slope
        moved = np.sqrt(np.mean(slope**2))
        differenced = bool(moved > 0 and np.sqrt(np.mean(left**2)) < 2e-3 * moved)
    counts = TURN / (step * record.dt) if record.is_uniform else np.nan
    return Encoder(float(counts), differenced, float(step))


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look at how the speed was measured."""
    record = max(records, key=len)
    if 'speed' not in record or len(record) < 50:
        return
    encoder = encoder_of(record)
    if encoder.differenced:
        counts = f', {encoder.counts_per_turn:.6g} counts per turn' if is_angular(record) else ''
        known = np.isfinite(encoder.counts_per_turn)
        yield Finding(
            Severity.INFO, 'speed_is_difference',
            'speed is the difference of the position over the last sample'
            f'{counts if known else ""}',
            'it lags by half a sample and is in steps; the sensor model takes this into account',
            '',
            {'counts_per_turn': encoder.counts_per_turn, 'lag_s': record.dt / 2},
        )  # fmt: skip
    elif 'position' not in record:
        yield from _unit_by_counts(record, encoder)
    else:
        yield from _lateness(records, record.dt)


def _lateness(records: Sequence[Record], dt: float) -> Iterator[Finding]:
    """Tell a filter of the speed, or a position that is late, by what the speed adds up to."""
    found = speed_lateness(records)
    if found is None or not np.isfinite(dt):
        return
    late, sure = found.seconds, CERTAIN * found.sigma
    numbers = {'lag_s': late, 'sigma_s': found.sigma}
    span = f'{abs(late) * 1e3:.3g} ms'
    span += f' (standard error {found.sigma * 1e3:.1g} ms)' if sure > 0.02 * abs(late) else ''
    if late - sure > LATE * dt:
        yield Finding(
            Severity.INFO, 'speed_late',
            f'speed is {span} behind the motion of the position: a filter of the drive or sensor',
            'taken for the speed of the moment, it makes the motor look slower than it is',
            'fit with `--effect speed_sensor_lag`; a diagnosis tries it first', numbers,
        )  # fmt: skip
    elif late + sure < -EARLY * dt:
        yield Finding(
            Severity.WARNING, 'position_late',
            f'position is {span} behind what the speed adds up to',
            'effects that turn with the rotor are taken at a wrong angle',
            'record both at the same instant, or shift one (`shift` in a msg_config file)',
            numbers,
        )  # fmt: skip


def _unit_by_counts(record: Record, encoder: Encoder) -> Iterator[Finding]:
    """Find the unit of a speed from its steps: one count per sample must divide the turn.

    Steps of 0.01 may as well be those of printed numbers.
    """
    if not (np.isfinite(encoder.step) and record.is_uniform and is_angular(record)):
        return
    counts = {
        unit: 1 / (encoder.step * record.dt * turns) for unit, turns in TURNS_PER_UNIT.items()
    }
    whole = [unit for unit, count in counts.items() if _is_round(count)]
    if not whole or _is_whole(counts['rad/s']):
        return
    unit, rounded = whole[0], _is_rounding(encoder.step)
    yield Finding(
        Severity.WARNING if rounded else Severity.ERROR, 'speed_unit',
        f'speed {"may" if rounded else "seems to"} be in {unit}, not rad/s: its steps of '
        f'{encoder.step:.6g} at {1 / record.dt:.6g} Hz are one count of {counts[unit]:.0f} per '
        f'turn in {unit}, but of {counts["rad/s"]:.2f} in rad/s'
        + ('; unless its numbers are rounded to that place' if rounded else ''),
        'back-EMF constant, inertia and friction would come out wrong by that factor',
        f'write the header as `speed [{unit}]`, or `unit: {unit}` in a msg_config file, if it is',
        {'counts_per_turn': counts[unit], 'step': encoder.step},
    )  # fmt: skip


def _is_whole(count: float) -> bool:
    return 8 <= count <= LARGEST and abs(count - round(count)) < WHOLE


def _is_round(count: float) -> bool:
    """Tell whether encoders are made with that number: lines times four, or a power of two."""
    whole = round(count)
    return _is_whole(count) and whole % 4 == 0 and (whole % 20 == 0 or whole % 64 == 0)


def _is_rounding(step: float) -> bool:
    """Tell whether a step is that of a decimal place (0.01), as of numbers that are printed."""
    places = np.log10(step)
    return bool(abs(places - np.round(places)) < 1e-6)


def _refined(values: Array, step: float) -> float:
    """Sharpen a step with the largest multiples of it."""
    for reach in (10, 100, 1000):
        multiples = np.round(values / step)
        near = (np.abs(multiples) > 0) & (np.abs(multiples) <= reach)
        if np.any(near):
            step = float(np.sum(np.abs(values[near])) / np.sum(np.abs(multiples[near])))
    return step
