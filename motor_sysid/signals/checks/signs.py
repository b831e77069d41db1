"""Signals that were recorded without their sign, though the motor went either way."""

from collections.abc import Iterator, Sequence

import numpy as np

from motor_sysid.signals.checks.common import Array
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Record

ONE_SIGN, BOTH_WAYS = 0.02, 0.1
"""Largest value of the other sign, as a share of the largest one, of what has one sign; and share
of the time that the others are on either side of zero."""

SMALL = 0.2
"""Share of the largest current below which the voltage is that of the speed."""

WITH, WITHOUT = 0.75, 0.6
"""Share of the voltage that its balance must explain with the sign that the others tell, and may
explain at most as it was recorded."""


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look for a current or a speed without its sign; the voltage's is looked for elsewhere."""
    for record in records:
        if not {'voltage', 'speed', 'current'} <= set(record):
            continue
        volts, speed, current = (record[name] for name in ('voltage', 'speed', 'current'))
        if not _goes_both_ways(volts):
            continue
        if _has_one_sign(current) and _goes_both_ways(speed):
            few = np.abs(current) < SMALL * np.max(np.abs(current))
            back_emf = np.linalg.lstsq(speed[few, np.newaxis], volts[few])[0]
            left = volts - back_emf * speed
            signed, unsigned = ([x] for x in (current * np.sign(left), current))
            if _share(signed, left) > WITH and _share(unsigned, left) < WITHOUT:
                yield _unsigned('current', record)
        elif _has_one_sign(speed) and not _has_one_sign(current):
            signed, unsigned = ([x, current] for x in (speed * np.sign(volts), speed))
            if _share(signed, volts) > WITH and _share(unsigned, volts) < WITHOUT:
                yield _unsigned('speed', record)


def _has_one_sign(values: Array) -> bool:
    low, high = float(np.min(values)), float(np.max(values))
    return min(-low, high) <= ONE_SIGN * max(-low, high)


def _goes_both_ways(values: Array) -> bool:
    least = 0.1 * float(np.max(np.abs(values)))
    return bool(min(np.mean(values > least), np.mean(values < -least)) > BOTH_WAYS)


def _share(columns: Sequence[Array], values: Array) -> float:
    """Return the share of (N,) values that a combination of columns explains."""
    x = np.stack(columns, axis=1)
    left = values - x @ np.linalg.lstsq(x, values)[0]
    return 1.0 - float(np.mean(left**2)) / max(float(np.mean(values**2)), 1e-300)


def _unsigned(name: str, record: Record) -> Finding:
    low, high = float(np.min(record[name])), float(np.max(record[name]))
    unit = record.units[name]
    return Finding(
        Severity.ERROR, f'unsigned_{name}',
        f'{name} is between {low:.4g} and {high:.4g} {unit} all the time, and '
        'voltage, speed and current only go together if it has both signs: its direction was not '
        'recorded',
        'no model can follow it: resistance and motor constant come out as nonsense',
        f'record the direction of the {name} as well and multiply by it (`product` of two signals '
        f'in a msg_config file), or leave the {name} out',
        {f'lowest_{unit}': low, f'highest_{unit}': high},
    )  # fmt: skip
