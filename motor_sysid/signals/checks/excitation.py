"""Whether the record shows the motor enough of itself."""

from collections.abc import Iterator, Sequence

import numpy as np

from motor_sysid.signals.channels import DRIVING_CURRENTS
from motor_sysid.signals.checks.common import (
    Array,
    INPUTS,
    is_angular,
    main_current,
    main_input,
    OUTPUTS,
    smoothed,
    speed_of,
    SUPPLY,
)
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Record
from motor_sysid.signals.units import TURN

AT_REST, SLOWLY = 0.02, 0.1
"""Shares of the top speed below which the motor counts as resting, and as turning slowly."""
LEVELS = 10
"""Bins of the speed from rest to top; a bin counts as covered by 1 % of the samples."""
SPREAD, FROM_START = 0.05, 0.3
"""Spread of the speed, and difference of its first samples from its median, over its top speed,
either of which tells that a motor under a constant input starts or stops.  After a long time at
one speed only the second does."""
STEADY, SWINGS = 0.1, 3
"""Range of a voltage, as a share of it, that is hardly any; and how often a motor must reverse, or
go from slow to fast or back, to say that such a voltage does not drive it."""
ONE_WAY = 0.01
"""Least share of the motion that must go the other way."""


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look at which speeds, directions and inputs occur, over all records together."""
    yield from _present(records)
    yield from _constant_input(records)
    yield from _voltage_of_supply(records)
    pairs = [(record, speed) for record in records if (speed := speed_of(record)) is not None]
    if pairs:
        yield from _motion([record for record, _ in pairs], [speed for _, speed in pairs])


def _present(records: Sequence[Record]) -> Iterator[Finding]:
    """At least one input and one output."""
    names = {name for record in records for name in record}
    driver = main_input(records[0])
    if _is_duty_alone(records[0]):
        yield _without_supply(records[0])
    elif not driver:
        yield Finding(
            Severity.ERROR, 'no_input',
            f'no input among the signals ({", ".join(sorted(names))})',
            'nothing says what drove the motor, so nothing can be simulated',
            f'record one of {", ".join(INPUTS)}; a duty cycle times a supply voltage also serves; '
            'other topics and columns are named in a msg_config file',
        )  # fmt: skip
    elif driver in DRIVING_CURRENTS:
        yield Finding(
            Severity.WARNING, 'no_voltage',
            f'no voltage among the signals ({", ".join(sorted(names))}); {driver} is taken as '
            'what drives the motor',
            'only the mechanical side can be identified, per ampere',
            'record the voltage (or duty cycle and supply voltage) too',
        )  # fmt: skip
    outputs = [name for name in OUTPUTS if name in names and name != driver]
    if not outputs:
        yield Finding(
            Severity.ERROR, 'no_output',
            f'no measured output among the signals ({", ".join(sorted(names))})',
            'there is nothing to compare a model with',
            'record speed, position or current',
        )  # fmt: skip
    elif not names & {'speed', 'position', 'hall_sector'}:
        yield Finding(
            Severity.WARNING, 'no_motion_measured',
            f'neither speed nor position among the signals ({", ".join(sorted(names))})',
            'no model can be fitted to them, or compared with them',
            'record speed or position; of a rotor that was locked, write `speed: {constant: 0}` '
            'in a msg_config file',
        )  # fmt: skip


def _is_duty_alone(record: Record) -> bool:
    """Whether a duty cycle of an unknown voltage is the only input."""
    return [name for name in INPUTS if name in record] == ['duty']


def _without_supply(record: Record) -> Finding:
    """Say what comes of a duty cycle of an unknown voltage."""
    current = next((name for name in DRIVING_CURRENTS if name in record), '')
    if not current:
        return Finding(
            Severity.ERROR, 'no_input', 'a duty cycle alone is no input',
            'nothing says which voltage drove the motor, so nothing can be simulated',
            f'add {SUPPLY}',
        )  # fmt: skip
    return Finding(
        Severity.WARNING, 'no_voltage', 'a duty cycle alone tells no voltage',
        f'nothing is fitted, unless a mechanical axis is asked for, which {current} drives: then '
        'only the mechanical side, per ampere',
        f'add {SUPPLY}',
    )  # fmt: skip


def _changes(speed: Array) -> bool:
    """Whether a motor starts or stops in a record; no single stray sample tells so."""
    top = float(np.max(np.abs(speed), initial=0.0))
    if top == 0.0:
        return False
    apart = abs(np.median(speed[:3]) - np.median(speed))
    return bool(np.std(speed) > SPREAD * top or apart > FROM_START * top)


def _constant_input(records: Sequence[Record]) -> Iterator[Finding]:
    names = [name for name in INPUTS if any(name in record for record in records)]
    names = names or [main_input(records[0])]
    if not names[0]:
        return
    each = [[record[name] for record in records if name in record] for name in names]
    if any(np.ptp(np.concatenate(values)) > 0 for values in each):
        return
    name = names[0]
    speeds = [speed for record in records if (speed := speed_of(record)) is not None]
    turning = sum(_reversals(s, SLOWLY * np.max(np.abs(s), initial=0.0)) for s in speeds)
    starting = any(map(_changes, speeds)) and turning == 0
    value = f'{records[0][name][0]:.6g} {records[0].units[name]}'
    yield Finding(
        Severity.WARNING if starting else Severity.ERROR, 'constant_input',
        f'{name} is {value} all the time' + (', yet the motor reverses' if turning else ''),
        'this is not what drives the motor' if turning
        else 'only one state is seen: resistance, back-EMF and friction cannot be told apart',
        'vary the input: steps of random height, both directions, some seconds',
        {'value': float(records[0][name][0])},
    )  # fmt: skip


def _voltage_of_supply(records: Sequence[Record]) -> Iterator[Finding]:
    """Look for a voltage that hardly varies while the speed reverses, or goes up and down."""
    measured = [record for record in records if 'voltage' in record and 'duty' not in record]
    volts = [record['voltage'] for record in measured]
    every = np.concatenate(volts) if volts else np.zeros(1)
    low, high = float(np.min(every)), float(np.max(every))
    if not (0.0 < high - low < STEADY * min(abs(low), abs(high)) and low * high > 0.0):
        return
    speeds = [speed for record in measured if (speed := speed_of(record)) is not None]
    turning = sum(_reversals(s, SLOWLY * np.max(np.abs(s), initial=0.0)) for s in speeds)
    reverses = turning >= SWINGS
    if not reverses and sum(_swings(np.abs(s)) for s in speeds) < SWINGS:
        return
    does = 'reverses' if reverses else 'goes from slow to fast and back'
    other = any(name in record for name in ('torque', 'force') for record in measured)
    yield Finding(
        Severity.ERROR if reverses and not other else Severity.WARNING, 'voltage_of_supply',
        f'voltage is {low:.6g} to {high:.6g} V all the time, yet the motor {does}',
        'this seems to be the voltage of the supply, not that across the motor',
        'call it `supply_voltage` and record the duty cycle, too (a share of it, -1 to 1), or '
        'record the voltage across the motor',
        {'low': low, 'high': high},
    )  # fmt: skip


def _swings(size: Array) -> int:
    """Count how often a speed without sign goes from slow to fast or back."""
    top = float(np.quantile(size, 0.99))
    states = np.where(size > 0.7 * top, 1, np.where(size < 0.3 * top, -1, 0))
    return _reversals(states[states != 0].astype(np.float64), 0.0) if top > 0 else 0


def _motion(records: Sequence[Record], speeds: Sequence[Array]) -> Iterator[Finding]:
    """Speeds, reversals, accelerations and travel."""
    unit = 'rad/s' if is_angular(records[0]) else 'm/s'
    slow = [smoothed(s, max(1, min(9, s.size // 50))) for s in speeds]
    every = np.concatenate(slow)
    top = float(np.quantile(np.abs(every), 0.995))
    if top == 0:
        yield from _no_motion(records)
        return
    size = np.abs(every)
    resting = float(np.mean(size < AT_REST * top))
    slowly = float(np.mean((size >= AT_REST * top) & (size < SLOWLY * top)))
    moving = every[size >= AT_REST * top]
    backward = float(np.mean(moving < 0)) if moving.size else 0.0
    counts, _ = np.histogram(size / top, LEVELS, (0, 1.0001))
    levels = int(np.sum(counts > 0.01 * size.size))
    pairs = list(zip(records, slow, strict=True))
    accelerations = np.concatenate([np.gradient(s, r.time) for r, s in pairs])
    acceleration = float(np.quantile(np.abs(accelerations), 0.95))
    reversals = sum(_reversals(s, SLOWLY * top) for s in slow)
    travel = float(sum(np.sum(np.abs(s)) * r.dt for r, s in pairs))
    span = max(_span(r, s) for r, s in pairs)
    numbers = {
        'top_speed': top, 'reversals': reversals, 'share_at_rest': resting,
        'share_slow': slowly, 'share_backward': backward, 'speed_levels': levels,
        'acceleration_p95': acceleration, 'travel': travel, 'span': span,
    }  # fmt: skip
    turns = f', {travel / TURN:.3g} turns' if is_angular(records[0]) else f', {travel:.3g} m'
    yield Finding(
        Severity.INFO, 'excitation',
        f'speeds to {top:.4g} {unit}, {levels} of {LEVELS} levels covered, {reversals} reversals, '
        f'{resting:.0%} at rest, {slowly:.0%} slow, {backward:.0%} of the motion backward, '
        f'accelerations to {acceleration:.3g} {unit}^2{turns}',
        numbers=numbers,
    )  # fmt: skip
    yield from _lacking(numbers, is_angular(records[0]))


def _lacking(numbers: dict[str, float], angular: bool) -> Iterator[Finding]:
    """Say which effects this record cannot show."""
    if not ONE_WAY <= numbers['share_backward'] <= 1 - ONE_WAY:
        yield Finding(
            Severity.WARNING, 'one_direction', 'the motor turns in one direction only',
            'Coulomb friction, a constant load and an offset of the current sensor look the same',
            'record both directions', {'share_backward': numbers['share_backward']},
        )  # fmt: skip
    if numbers['speed_levels'] <= 2:
        yield Finding(
            Severity.WARNING, 'few_speeds',
            f'only {numbers["speed_levels"]:.0f} of {LEVELS} speed levels occur',
            'friction laws (Coulomb, viscous, quadratic) cannot be told apart',
            'record several speeds, or slow ramps', {'levels': numbers['speed_levels']},
        )  # fmt: skip
    if numbers['share_at_rest'] > 0.9:
        yield Finding(
            Severity.WARNING, 'mostly_at_rest',
            f'the motor rests for {numbers["share_at_rest"]:.0%} of the time',
            'few samples say anything about inertia and friction',
            'cut the pauses, or record more motion', {'share': numbers['share_at_rest']},
        )  # fmt: skip
    if angular and numbers['span'] < TURN:
        yield Finding(
            Severity.INFO, 'short_travel',
            f'the motor covers {numbers["span"] / TURN:.2g} turns',
            'cogging and ripple with few periods per turn cannot be recognised',
            'let it turn at least once if it can', {'turns': numbers['span'] / TURN},
        )  # fmt: skip


def _no_motion(records: Sequence[Record]) -> Iterator[Finding]:
    current = main_current(records[0])
    electrical = current and main_input(records[0]) not in {'', current}
    yield Finding(
        Severity.WARNING if electrical else Severity.ERROR, 'no_motion', 'the motor never moves',
        'only resistance and inductance can be seen' if electrical else 'nothing can be learnt',
        'raise the input until it turns, and release the brake',
    )  # fmt: skip


def _reversals(speed: Array, threshold: float) -> int:
    """Count changes of direction between speeds beyond `threshold`."""
    signs = np.sign(speed[np.abs(speed) > threshold])
    return int(np.sum(signs[1:] != signs[:-1]))


def _span(record: Record, speed: Array) -> float:
    """Range of the position, measured or integrated."""
    position = record['position'] if 'position' in record else np.cumsum(speed) * record.dt
    return float(np.ptp(position))
