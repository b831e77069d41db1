"""Units, signs and gears: whether the signals of one motor fit together."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from motor_sysid.signals.checks.common import (
    Array,
    is_angular,
    main_current,
    main_input,
    smoothed,
    speed_of,
)
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Record
from motor_sysid.signals.units import TURN

DEG = 360 / TURN
RPM = TURN / 60
RATIOS = {
    RPM: ('speed', 'rpm'), 1 / DEG: ('speed', 'deg/s'), TURN: ('speed', 'turns/s'),
    DEG: ('position', 'deg'), 1 / TURN: ('position', 'turns'),
    6.0: ('position and speed', 'deg and rpm'), 1 / 60: ('position and speed', 'turns and rpm'),
    1000.0: ('position', 'mm'), 1e-3: ('speed', 'mm/s'),
}  # fmt: skip
"""Slope of the position over the speed, if one of them is in another unit."""
CLOSE = 0.022
"""Relative distance at which a ratio is taken as one of these."""
SAME = 0.1
"""Relative distance from 1 that a position and its speed may have."""
LEAST = 5e-4
"""Ratio below which no unit or gear explains why the position hardly moves."""
TINY = 1e-30
"""A signal that varies less than this does not vary."""
SPREAD = 0.15
"""Spread of the ratio over the record at which it still counts as one number."""
FASTEST = 2500.0
"""rad/s; few motors turn faster (23 900 rpm)."""
WEAKEST = 1e-4
"""V s/rad; hardly any motor has a smaller back-EMF constant."""
BALANCED = 0.9
"""Share of the voltage that its balance must explain to say that a motor was braked."""
OPPOSED = -0.3
"""Correlation from which two signals that should agree in sign do not."""
NO_SIGN, TURNING, BOTH_WAYS, MOSTLY_ON = 0.02, 0.2, 0.1, 0.5
"""Shares: of an input that may go the other way and still be of one sign; of the top speed from
which on a motor turns, and of the largest input from which on that is on; of the time in either
direction; and of that in which the input is on."""
ON, STILL, ALIKE, AT_LEAST, LASTING = 0.3, 0.01, 0.15, 0.5, 0.03
"""Share of the largest input from which on it should turn a motor; of the top speed below which
that rests; by which inputs of one level differ; seconds, and the share of the record, that it must
rest."""
MOMENT = 0.1
"""A record of less than this share of the longest shows a moment: the motor may brake in all of
it, between two gaps, and then its speed runs against the voltage."""


@dataclass(frozen=True)
class Slope:
    """Change of position over integral of speed: its median, and its spread relative to it."""

    ratio: float
    spread: float


def slope_of(record: Record) -> Slope | None:
    """Compare position and speed of a record; None if it does not move enough to tell."""
    count = len(record)
    if count < 40:
        return None
    steps = np.diff(record.time)
    middle = (record['speed'][1:] + record['speed'][:-1]) / 2
    path = np.concatenate(([0.0], np.cumsum(middle * steps)))
    width = max(4, count // 500)
    move = record['position'][width::width] - record['position'][:-width:width]
    by_speed = path[width::width] - path[:-width:width]
    moving = np.abs(by_speed) > 0.2 * np.max(np.abs(by_speed), initial=0.0)
    if np.sum(moving) < 5:
        return None
    ratios = move[moving] / by_speed[moving]
    low, ratio, high = np.quantile(ratios, [0.25, 0.5, 0.75])
    return Slope(float(ratio), float((high - low) / (abs(ratio) + 1e-300)))


def check(records: Sequence[Record], k_e: float | None = None) -> Iterator[Finding]:
    """Look at how the signals fit together.

    Parameters
    ----------
    records:
        Records of one motor.
    k_e:
        Back-EMF constant from the data sheet in V s/rad, if known.
    """
    seen: set[str] = set()
    longest = max(map(len, records), default=0)
    for record in sorted(records, key=len, reverse=True):
        if len(record) < MOMENT * longest:
            return
        for finding in _check_one(record, k_e):
            if finding.code not in seen:
                seen.add(finding.code)
                yield finding


def _check_one(record: Record, k_e: float | None) -> Iterator[Finding]:
    trusted = True
    if 'speed' in record and 'position' in record:
        found = list(_position_against_speed(record))
        trusted = not found
        yield from found
    yield from _signs(record)
    if trusted:
        yield from _magnitude(record, k_e)


def _position_against_speed(record: Record) -> Iterator[Finding]:
    slope = slope_of(record)
    if slope is None or not np.isfinite(slope.ratio):
        return
    numbers = {'ratio': slope.ratio, 'spread': slope.spread}
    size = abs(slope.ratio)
    if slope.spread > SPREAD or size < LEAST:
        if abs(size - 1) > 0.5:
            yield Finding(
                Severity.WARNING, 'position_speed_disagree',
                f'position and speed do not belong together: the slope of the position is '
                f'{slope.ratio:.3g} times the speed, varying by {slope.spread:.0%}',
                'one of them is wrong, filtered, or of another joint',
                'check topic, joint and field; leave the wrong one out', numbers,
            )  # fmt: skip
        return
    if slope.ratio < 0:
        yield Finding(
            Severity.ERROR, 'position_sign',
            f'position falls while speed is positive (slope {slope.ratio:.3g} times the speed)',
            'every effect that depends on position or direction would be wrong',
            'write `sign: -1` for one of them in a msg_config file', numbers,
        )  # fmt: skip
    if abs(size - 1) <= SAME:
        return
    match = next((known for known in RATIOS if abs(size / known - 1) < CLOSE), None)
    if match is None:
        yield _gear(size, numbers)
        return
    signal, unit = RATIOS[match]
    yield Finding(
        Severity.ERROR, 'position_unit' if signal == 'position' else 'speed_unit',
        f'{signal} seems to be in {unit}: the slope of the position is {slope.ratio:.4g} times '
        f'the speed, which is what {unit} taken as SI gives',
        'inertia, friction and back-EMF constant would come out wrong by that factor',
        f'write the header with the unit that it is in, e.g. `{signal.split()[0]} '
        f'[{unit.split()[0]}]`, or `unit:` in a msg_config file', numbers,
    )  # fmt: skip


def _gear(size: float, numbers: dict[str, float]) -> Finding:
    side = 'position is before the gear and speed behind it' if size > 1 else (
        'speed is before the gear and position behind it'
    )
    return Finding(
        Severity.ERROR, 'gear_ratio',
        f'the slope of the position is {size:.4g} times the speed, all the time: perhaps {side} '
        f'(1:{max(size, 1 / size):.4g}), or one of them, or the time, is in an unknown unit',
        'inertia and friction would mix two shafts',
        f'if it is a gear, write `gear_ratio: {max(size, 1 / size):.4g}` for the faster one in '
        'a msg_config file; else put units and time stamps right', numbers,
    )  # fmt: skip


def _signs(record: Record) -> Iterator[Finding]:
    """Compare the signs of input, current and speed."""
    driver, current, speed = main_input(record), main_current(record), speed_of(record)
    if not driver or driver == 'voltage_a':
        return
    balance = voltage_balance(record)
    if current and current != driver:
        if balance is not None and balance.by_current > 0.3:
            if balance.resistance < 0:
                yield _opposed(current, driver, Severity.ERROR, {'ohm': balance.resistance})
        elif (agreement := _agreement(record[driver], record[current])) < OPPOSED:
            yield _opposed(current, driver, Severity.WARNING, {'correlation': agreement})
    braked = (
        current and balance is not None and balance.explained > BALANCED and balance.back_emf > 0
    )
    if speed is not None:
        yield from _driven_at_rest(record, driver, speed)
    if speed is not None and _is_unsigned(record[driver], speed):
        yield _unsigned(driver)
    elif speed is not None and driver != current and not braked:
        agreement = _agreement(record[driver], speed)
        if agreement < OPPOSED:
            severity = Severity.ERROR if agreement < 2 * OPPOSED else Severity.WARNING
            name = 'speed' if 'speed' in record else 'position'
            yield _opposed(name, driver, severity, {'correlation': agreement})


def _is_unsigned(drive: Array, speed: Array) -> bool:
    """Whether an input of one sign is on while a motor turns either way."""
    size, top = float(np.max(np.abs(drive))), float(np.quantile(np.abs(speed), 0.99))
    one_sign = min(-float(np.min(drive)), float(np.max(drive))) <= NO_SIGN * size
    there, back = speed > TURNING * top, speed < -TURNING * top
    if not one_sign or min(np.mean(there), np.mean(back)) < BOTH_WAYS:
        return False
    on = np.abs(drive) > TURNING * size
    return bool(min(np.mean(on[there]), np.mean(on[back])) > MOSTLY_ON)


def _driven_at_rest(record: Record, driver: str, speed: Array) -> Iterator[Finding]:
    """Find the longest time that a motor rests under an input that turns it elsewhere."""
    drive, top = np.abs(record[driver]), float(np.quantile(np.abs(speed), 0.99))
    idle = (drive > ON * np.max(drive)) & (np.abs(speed) < STILL * top)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], idle, [False])).astype(np.int8)))
    begins, ends = edges[::2], edges[1::2]
    if not top or not begins.size:
        return
    longest = int(np.argmax(ends - begins))
    first, end = int(begins[longest]), int(ends[longest])
    level = float(np.median(drive[first:end]))
    alike = np.abs(drive - level) < ALIKE * level
    alike[first:end] = False
    turns = np.mean(np.abs(speed[alike]) > TURNING * top) if np.any(alike) else 0.0
    lasts = (end - first) * record.dt
    if lasts < max(AT_LEAST, LASTING * record.duration) or turns < MOSTLY_ON:
        return
    begin = float(record.time[first] - record.time[0])
    yield Finding(
        Severity.WARNING, 'driven_at_rest',
        f'the motor rests for {lasts:.3g} s from {begin:.3g} s on under {level:.3g} '
        f'{record.units[driver]} of {driver}, which turns it elsewhere',
        'that it was held, or that its drive was switched off, looks like friction or a load',
        'cut that time out; record whether the drive is enabled',
        {'begin_s': begin, 'lasts_s': lasts, 'level': level},
    )  # fmt: skip


def _unsigned(driver: str) -> Finding:
    return Finding(
        Severity.WARNING, 'unsigned_input',
        f'{driver} has one sign all the time, and is on while the motor turns either way',
        'what drives the motor backward is not in the record: no model can follow it',
        'record the direction as well and multiply by it (`product` of two signals in a '
        'msg_config file), unless the motor was driven by its load', {},
    )  # fmt: skip


def _opposed(name: str, driver: str, severity: Severity, numbers: dict[str, float]) -> Finding:
    (what, value), *_ = numbers.items()
    label = 'apparent resistance' if what == 'ohm' else 'correlation'
    return Finding(
        severity, f'{name}_sign', f'{name} runs against {driver} ({label} {value:.2g})',
        'resistance or back-EMF constant would come out negative',
        'swap the sign of one of them (`sign: -1` in a msg_config file), unless the motor was '
        'driven by its load', numbers,
    )  # fmt: skip


def _agreement(first: Array, second: Array) -> float:
    """Mean product over the product of the RMS values, of slow parts, between -1 and 1."""
    width = max(1, first.size // 200)
    a, b = smoothed(first, width), smoothed(second, width)
    scale = float(np.sqrt(np.mean(a**2) * np.mean(b**2)))
    return float(np.mean(a * b)) / scale if scale > 0 else 0.0


def _magnitude(record: Record, k_e: float | None) -> Iterator[Finding]:
    """Compare speed with voltage where there is no position to tell."""
    if 'speed' not in record or not is_angular(record):
        return
    top = float(np.quantile(np.abs(record['speed']), 0.99))
    balance = voltage_balance(record)
    clear = balance is not None and balance.explained > 0.7 and balance.back_emf > 0
    apparent = balance.back_emf if balance is not None and clear else None
    if apparent is not None and k_e:
        yield from _against_datasheet(apparent, k_e)
        return
    too_weak = apparent is not None and apparent < WEAKEST
    if top < FASTEST and not too_weak:
        return
    seen = f', with a back-EMF constant of {apparent:.2g} V s/rad' if apparent is not None else ''
    yield Finding(
        Severity.WARNING, 'speed_unit',
        f'speed reaches {top:.4g} rad/s ({top / RPM:.0f} rpm){seen}, which few motors do; unless '
        'yours does, the unit is wrong',
        'back-EMF constant, inertia and friction would come out wrong by that factor',
        'if it is in rpm or deg/s, say so in the header or in a msg_config file',
        {'top_rad_s': top, **({'k_e': apparent} if apparent is not None else {})},
    )  # fmt: skip


def _against_datasheet(apparent: float, k_e: float) -> Iterator[Finding]:
    ratio = k_e / apparent
    for factor, unit in ((1 / RPM, 'rpm'), (DEG, 'deg/s'), (1 / TURN, 'turns/s')):
        if abs(ratio / factor - 1) < 0.35:
            yield Finding(
                Severity.ERROR, 'speed_unit',
                f'speed seems to be in {unit}: voltage over speed gives a back-EMF constant of '
                f'{apparent:.3g} V s/rad, the data sheet says {k_e:.3g}',
                'inertia and friction would come out wrong by that factor',
                f'write the header as `speed [{unit}]`, or `unit: {unit}` in a msg_config file',
                {'ratio': ratio},
            )  # fmt: skip
            return
    if not 0.5 < ratio < 2:
        yield Finding(
            Severity.WARNING, 'back_emf_constant',
            f'voltage over speed gives a back-EMF constant of {apparent:.3g} V s/rad, the data '
            f'sheet says {k_e:.3g}',
            'unit, gear or data sheet are wrong', 'check which shaft the speed belongs to',
            {'ratio': ratio},
        )  # fmt: skip


@dataclass(frozen=True)
class VoltageBalance:
    """Slow part of ``u = R i + k_e omega + c`` by least squares.

    Attributes
    ----------
    resistance:
        R in ohm, NaN without a current.
    back_emf:
        k_e in V s/rad.
    explained:
        Share of the variance of the voltage that the balance explains.
    by_current:
        Share of what the speed leaves that the current explains.
    """

    resistance: float
    back_emf: float
    explained: float
    by_current: float


def voltage_balance(record: Record) -> VoltageBalance | None:
    """Fit the voltage balance, averaged over 20 ms; None where a signal is missing or constant."""
    driver, current = main_input(record), main_current(record)
    if driver not in {'voltage', 'voltage_q'} or 'speed' not in record:
        return None
    width = max(1, round(0.02 / record.dt))
    voltage = smoothed(record[driver], width)
    names = ['speed', *([current] if current else [])]
    columns = [smoothed(record[name], width) for name in names]
    if min(np.std(column) for column in (voltage, *columns)) < TINY:
        return None
    without, _ = _line(columns[:1], voltage)
    left, slopes = _line(columns, voltage)
    return VoltageBalance(
        slopes[1] if current else np.nan,
        slopes[0],
        1 - left / float(np.var(voltage)),
        1 - left / without if without > 0 else 0.0,
    )


def _line(columns: Sequence[Array], values: Array) -> tuple[float, list[float]]:
    """Variance that a line in the columns leaves, and its slopes."""
    scales = [float(np.std(column)) for column in columns]
    matrix = np.column_stack(
        [(column - np.mean(column)) / s for column, s in zip(columns, scales, strict=True)]
    )
    centred = values - np.mean(values)
    solution, *_ = np.linalg.lstsq(matrix, centred, rcond=1e-8)
    left = float(np.var(centred - matrix @ solution))
    return left, [float(x) / s for x, s in zip(solution, scales, strict=True)]
