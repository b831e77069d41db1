"""Currents of the phases, or of d and q, that are turned round or exchanged.

In the frame of the rotor, with both sides averaged, ``u = Z i + speed (M i + e + |speed| l) + c``:
the real part of Z is a resistance.  Exchanged currents turn against the voltages, and explain
nothing there; those that are turned round explain as much with a negative resistance.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.checks.common import Array, smoothed
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.phases import electrical_angle, phase_columns, PHASES, to_dq
from motor_sysid.signals.record import Record

Complex = NDArray[np.complex128]

AVERAGED = 0.02
"""Time over which both sides of the balance are averaged, s."""
EXPLAINED = 0.5
"""Share of what the motion leaves that a current must explain for its sign to count."""
MENDED = 0.7
"""Share of it that currents must explain once they are mended."""
ASTRAY = math.radians(60)
"""Angle of the impedance up to which currents pass."""
UPRIGHT = math.radians(20)
"""Largest angle of the impedance of currents that are mended."""


@dataclass(frozen=True)
class _Balance:
    """What currents explain: the sum of squares left, and the impedance of each, ohm."""

    left: float
    impedance: Complex

    @property
    def angle(self) -> float:
        """Angle of the first impedance, rad."""
        return float(np.angle(self.impedance[0]))


def _balance(u: Complex, currents: Sequence[Complex], speed: Array, dt: float) -> _Balance:
    """Fit (N,) voltages with currents (N,), vectors or one axis of them."""
    width = max(1, round(AVERAGED / dt))

    def smooth(x: Complex) -> Complex:
        return np.asarray(smoothed(x.real, width) + 1j * smoothed(x.imag, width))

    columns = [*currents, *(speed * x for x in currents)]
    columns += [x.astype(np.complex128) for x in (speed, speed * np.abs(speed), speed**0)]
    x = np.column_stack([smooth(column) for column in columns])
    scale = np.sqrt(np.mean(np.abs(x) ** 2, axis=0))
    scale[scale < 1e-12] = 1.0
    y = smooth(u)
    solution = np.linalg.lstsq(x / scale, y, rcond=1e-3)[0]
    left = float(np.sum(np.abs(y - (x / scale) @ solution) ** 2))
    return _Balance(left, (solution / scale)[: len(currents)])


def _vector(abc: Array, angle: Array) -> Complex:
    x = to_dq(abc, angle)
    return np.asarray(x[:, 0] + 1j * x[:, 1])


def of_phases(record: Record, speed: Array, pole_pairs: int) -> Iterator[Finding]:
    """Find phase currents that are turned round, or in another order than the voltages."""
    measured = [f'current_{p}' for p in PHASES if f'current_{p}' in record]
    if len(measured) < 2:
        return
    angle = electrical_angle(record['position'], pole_pairs)
    halfway = angle + 0.5 * np.append(np.diff(angle), 0.0)
    u = _vector(phase_columns(record, 'voltage'), halfway)

    def balance(currents: Array) -> _Balance:
        return _balance(u, [_vector(currents, angle)], speed, record.dt)

    without = _balance(u, [], speed, record.dt).left
    now = balance(phase_columns(record, 'current'))
    if now.left < EXPLAINED * without and abs(now.angle) < ASTRAY:
        return
    best, least = None, (1 - MENDED) * without
    for finding, currents in _mended(record, measured):
        then = balance(currents)
        clear = then.left < EXPLAINED * now.left or abs(now.angle) > math.pi / 2
        if clear and then.left < least and abs(then.angle) < UPRIGHT:
            best, least = finding, then.left
    if best:
        yield best


def _mended(record: Record, measured: list[str]) -> Iterator[tuple[Finding, Array]]:
    """Yield what may be wrong with phase currents, with (N, 3) currents where that is mended."""
    columns = phase_columns(record, 'current')
    yield _turned(measured), -columns
    for one in measured if len(measured) == 2 else ():
        other = record.with_signal(one, -record[one], 'A')
        yield _turned([one]), phase_columns(other, 'current')
    for order in permutations(range(3)):
        moved = [k for k in range(3) if order[k] != k]
        if moved:
            yield _exchanged([PHASES[k] for k in moved]), columns[:, order]


def _turned(names: list[str]) -> Finding:
    listed = f'{", ".join(names[:-1])} and {names[-1]}' if len(names) > 1 else names[0]
    return Finding(
        Severity.ERROR, 'current_sign',
        f'{listed} {"is" if len(names) == 1 else "are"} turned round against the voltages',
        'resistance and torque constant would come out negative',
        f'write `sign: -1` for {listed} in a msg_config file', {},
    )  # fmt: skip


def _exchanged(phases: list[str]) -> Finding:
    which = f'{", ".join(phases[:-1])} and {phases[-1]}'
    return Finding(
        Severity.ERROR, 'current_order',
        f'{"two" if len(phases) == 2 else "all"} phases of the currents are exchanged, {which}: '
        'they do not go with the voltages',
        'd and q currents would mean nothing, and resistance and inductance come out wrong',
        f'exchange the columns or fields of current {which} in a msg_config file', {},
    )  # fmt: skip


def of_dq(record: Record, speed: Array) -> Iterator[Finding]:
    """Find a d current that is turned round alone; `plausibility` looks at the q current."""
    d, q, u_d, u_q = (
        record[name].astype(np.complex128)
        for name in ('current_d', 'current_q', 'voltage_d', 'voltage_q')
    )
    found, without = (_balance(u_d, i, speed, record.dt) for i in ([d, q], [q]))
    r_d = float(found.impedance[0].real)
    r_q = float(_balance(u_q, [q, d], speed, record.dt).impedance[0].real)
    alike = r_q > 0 and -2.0 * r_q < r_d < -0.5 * r_q
    if alike and found.left < (1 - EXPLAINED) * without.left:
        yield Finding(
            Severity.ERROR, 'current_d_sign',
            f'current_d runs against voltage_d (apparent resistance {r_d:.2g} ohm; {r_q:.2g} ohm '
            'on the q axis)',
            'resistance and inductances would come out wrong',
            'write `sign: -1` for one of them in a msg_config file', {'ohm': r_d},
        )  # fmt: skip
