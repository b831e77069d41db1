"""Pole pairs of a permanent magnet motor, read from records in rotor coordinates.

What a current induces on the other axis at speed, over what its change asks for on its own, is
the electrical speed.  Between samples currents are taken to go as they do under a voltage that
stands still in the rotor's frame, ``i' = -(R / L + j omega_e) i + u / L``: the area under them is

    dt (i_0 + i_1) / 2 + c (i_1 - i_0)
    c = dt / 2 (coth x - 1 / x),   x = dt / 2 (R / L + j omega_e)

Without c, inductances seem too large where currents settle within a sample, too small where the
field turns far within one, and the pole pairs come out wrong by as much.
"""

from collections.abc import Sequence
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.motors.base import Array, windows
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.signals.record import Record

MOST = 63
"""Pole pairs that are looked for."""
LENGTHS = (16, 40)
"""Windows over which the balances are integrated, in samples; shorter ones let noise in."""
NEAR = 0.35
"""Distance from the whole number within which the estimate of every window must lie."""
SURE = 2.0
"""Standard errors about the estimate within which no other whole number may lie."""
PARTS = 16
"""Pieces of a record whose spread tells the standard error."""
_ROUNDS = 8


def pole_pairs_of(records: Sequence[Record]) -> int:
    """Return the pole pairs, or 0 where no whole number is singled out."""
    pairs = _settled(records)
    sure = 0 < pairs <= MOST and all(_agrees(records, pairs, length) for length in LENGTHS)
    return pairs if sure else 0


def _settled(records: Sequence[Record]) -> int:
    """Return the whole number that estimates come to when they are begun from themselves."""
    pairs = 0
    for _ in range(_ROUNDS):
        now = round(_estimate(records, pairs, LENGTHS[0])[0])
        if now == pairs or not 0 < now <= MOST:
            return max(now, 0)
        pairs = now
    return pairs


def _agrees(records: Sequence[Record], pairs: int, length: int) -> bool:
    value, sigma = _estimate(records, pairs, length)
    return abs(value - pairs) < NEAR and abs(value - pairs) + SURE * sigma < 1.0


def _estimate(records: Sequence[Record], pairs: int, length: int) -> tuple[float, float]:
    """Return the pole pairs and their standard error, c being that of `pairs`."""
    decay, found = 0.0, np.zeros(9)
    for _ in range(3):
        parts = [_columns(r, length, decay, pairs) for r in records]
        x, y = (np.concatenate([part[k] for part in parts]) for k in range(2))
        found = _solved(x, y)
        decay = _decay(found, records[0].dt, decay)
    if found[1] <= 0 or found[3] <= 0:
        return 0.0, math.inf
    return _joint(x, y, found, [len(part[1]) for part in parts])


def _solved(x: Array, y: Array) -> Array:
    scale = np.linalg.norm(x, axis=0)
    scale[scale == 0] = 1.0
    solution: Array = np.linalg.lstsq(x / scale, y, rcond=1e-10)[0] / scale
    return solution


def _decay(found: Array, dt: float, before: float) -> float:
    """Return R / L, 1/s: from trapezoids, where L comes out as R dt / 2 coth(x), or else as is."""
    r, inductance = found[0], 0.5 * (found[1] + found[3])
    if r <= 0 or inductance <= 0:
        return 0.0
    if before:
        return float(r / inductance)
    return 2 / dt * math.atanh(min(0.5 * r * dt / inductance, 0.99))


def _columns(record: Record, length: int, decay: float, pairs: int) -> tuple[Array, Array]:
    """Return (2K, 9) regressors and (2K,) drive of both voltage balances over windows."""
    dt, speed = record.dt, measured_speed(record)
    i = record['current_d'] + 1j * record['current_q']
    steps = np.append(np.diff(i), 0.0)
    halfway = speed + 0.5 * np.append(np.diff(speed), 0.0)
    rate = np.asarray(decay + 1j * pairs * halfway, dtype=np.complex128)
    area = dt * (i + 0.5 * steps) + _bend(0.5 * dt * rate, dt) * steps
    turning = halfway * area

    def over(values: Array) -> Array:
        return windows(values, length)[0]

    r_d, r_q, speed_d, speed_q = map(over, (area.real, area.imag, turning.real, turning.imag))
    l_d, l_q = over(steps.real), over(steps.imag)
    emf = over(halfway * dt)
    zero = np.zeros_like(emf)
    d = [r_d, l_d, -speed_q, zero, zero, zero, -emf, l_q, -speed_d]
    q = [r_q, zero, zero, l_q, speed_d, emf, zero, l_d, speed_q]
    drive = [over(record[f'voltage_{axis}']) * dt for axis in 'dq']
    both = np.stack([np.column_stack(d), np.column_stack(q)], axis=1)
    return both.reshape(-1, 9), np.stack(drive, axis=1).ravel()


def _bend(x: NDArray[np.complex128], dt: float) -> NDArray[np.complex128]:
    """Return c, by its series where x is small."""
    small = np.abs(x) < 1e-2
    safe = np.where(small, 1.0, x)
    return np.asarray(0.5 * dt * np.where(small, x / 3, 1 / np.tanh(safe) - 1 / safe))


def _joint(x: Array, y: Array, found: Array, sizes: Sequence[int]) -> tuple[float, float]:
    """Fit one number of pole pairs to all terms with it: value and standard error."""
    r, l_d, crossed, l_q, _, e_q, e_d, across, _ = found
    p = np.array([r, l_d, l_q, e_q, e_d, across, crossed / l_q])
    for _ in range(_ROUNDS):
        n = p[6]
        slope = np.column_stack([
            x[:, 0], x[:, 1] + n * x[:, 4], x[:, 3] + n * x[:, 2], x[:, 5], x[:, 6],
            x[:, 7] + n * x[:, 8], p[1] * x[:, 4] + p[2] * x[:, 2] + p[5] * x[:, 8],
        ])  # fmt: skip
        rest = y - slope[:, :6] @ p[:6]
        p = p + _solved(slope, rest)
    scale = np.linalg.norm(slope, axis=0)
    scale[scale == 0] = 1.0
    moved = np.linalg.pinv(slope / scale)[6] / scale[6] * rest
    ends = np.cumsum(sizes)[:-1]
    pieces = [b.sum() for a in np.split(moved, ends) for b in np.array_split(a, PARTS)]
    return float(p[6]), float(np.sqrt(np.sum(np.square(pieces))))
