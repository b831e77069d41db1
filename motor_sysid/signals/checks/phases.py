"""Three phases: whether order, sum, pole pairs and the electrical angle fit together."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.checks import phase_currents
from motor_sysid.signals.checks.common import Array, smoothed, speed_of
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.noise import noise_sigma
from motor_sysid.signals.phases import electrical_angle, phase_columns, PHASES, to_dq
from motor_sysid.signals.record import Record

Complex = NDArray[np.complex128]

OFFSET_SUM = 0.1
"""Mean of the sum of currents, in parts of their RMS, that is worth a warning; models fit smaller
offsets."""
UNEVEN_SUM = 0.15
"""Spread of that sum beyond which no noise explains it."""
MOST_PAIRS = 60
AVERAGED = 0.02
"""Time over which speeds, and both sides of a voltage balance, are averaged, s."""
FOUND = 0.5
"""Correlation from which the pole pairs count as found."""
LEAST_TURNS = 1.5
"""Turns of the shaft within which pole pairs can be told apart."""
MOST_SAMPLES = 20_000
"""Samples that are looked at for the pole pairs."""
FAST_TURN = 0.5
"""Electrical angle per sample from which phases are too coarse, rad."""
OFF = math.radians(20)
"""Error of the electrical angle that is reported; saturation and iron explain less."""
CLASSIC = math.radians(25)
"""Distance from 90 or 180 degrees at which a known mix-up is named."""
CLEAR = 0.7
"""Share of the voltage's variance that its balance must explain."""


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look at the phases, and at d and q, of the longest record that has them."""
    with_currents = [r for r in records if all(f'current_{p}' in r for p in PHASES)]
    if with_currents:
        yield from _sum_of_currents(max(with_currents, key=len))
    with_phases = [r for r in records if 'position' in r and _has(r, 'voltage', 'abc')]
    if with_phases:
        yield from _rotation(max(with_phases, key=len))
    with_dq = [r for r in records if _has(r, 'voltage', 'dq') and _has(r, 'current', 'dq')]
    if with_dq:
        yield from _angle_of_dq(max(with_dq, key=len))


def _has(record: Record, kind: str, axes: str) -> bool:
    return all(f'{kind}_{axis}' in record for axis in axes)


def _sum_of_currents(record: Record) -> Iterator[Finding]:
    """Currents into a floating neutral add up to zero, but for the noise of three sensors."""
    currents = phase_columns(record, 'current')
    size = float(np.sqrt(np.mean(currents**2)))
    if size == 0:
        return
    total = currents.sum(axis=1)
    beyond_noise = max(float(np.var(total)) - noise_sigma(total) ** 2, 0.0)
    uneven = float(np.sqrt(beyond_noise)) / size
    if uneven > UNEVEN_SUM:
        yield _uneven(currents, size, uneven)
        return
    offset = float(np.mean(total))
    if abs(offset) > OFFSET_SUM * size:
        yield Finding(
            Severity.WARNING, 'current_sum',
            f'the three currents add up to {offset:.3g} A in the mean, {abs(offset) / size:.0%} '
            'of their size: sensors have offsets',
            'torque would seem to ripple once per electrical turn',
            'measure the offsets at standstill with the bridge off, and write them as `offset:` '
            'in a msg_config file',
            {'offset_a': offset, 'rms_a': size},
        )  # fmt: skip


def _uneven(currents: Array, size: float, uneven: float) -> Finding:
    """Return what is wrong with currents that do not add up: a turned sensor, or another scale."""
    numbers = {'spread': uneven, 'rms_a': size}
    for k, phase in enumerate(PHASES):
        turned = currents * np.where(np.arange(3) == k, -1, 1)
        if np.std(turned.sum(axis=1)) < UNEVEN_SUM * size:
            return Finding(
                Severity.ERROR, 'current_sum',
                f'the three currents do not add up to zero, but would with current_{phase} turned '
                'round',
                'd and q currents would be wrong and ripple twice per electrical turn',
                f'write `sign: -1` for current_{phase} in a msg_config file', numbers,
            )  # fmt: skip
    return Finding(
        Severity.ERROR, 'current_sum',
        f'the three currents do not add up to zero: the sum varies by {uneven:.0%} of their size',
        'd and q currents would be wrong and ripple twice per electrical turn',
        'check that the columns are the three phases of one motor, sampled together and scaled '
        'alike; where two are right, leave the third one out', numbers,
    )  # fmt: skip


def _rotation(record: Record) -> Iterator[Finding]:
    """Look for the frame in which the voltage goes with the speed: that of the rotor."""
    speed = speed_of(record)
    turns = float(np.ptp(record['position'])) / math.tau
    if speed is None or turns < LEAST_TURNS or not np.any(speed):
        return
    pairs, score = _best_pairs(record, speed)
    numbers = {'pole_pairs': pairs, 'score': score}
    if score < FOUND:
        yield Finding(
            Severity.WARNING, 'pole_pairs',
            f'no number of pole pairs up to {MOST_PAIRS} makes the voltages of the phases turn '
            f'with the shaft (the best is {abs(pairs)}, with a correlation of {score:.2f})',
            'the electrical angle would drift away from the rotor',
            'check the unit of the position, a gear between motor and encoder (`gear_ratio:` in '
            'a msg_config file), and that voltages and position are of the same motor', numbers,
        )  # fmt: skip
        return
    turn = abs(pairs) * float(np.quantile(np.abs(speed), 0.95)) * record.dt
    if turn > FAST_TURN:
        yield _coarse(turn)
    if pairs > 0:
        yield from _angle_of_phases(record, speed, pairs)
        if turn <= FAST_TURN:
            yield from phase_currents.of_phases(record, speed, pairs)
        return
    yield Finding(
        Severity.ERROR, 'phase_order',
        f'the voltages of the phases turn against the shaft, {-pairs} times in each of its turns',
        'd and q would turn twice as fast as the rotor, and mean nothing',
        'swap two phases, b and c, of voltages and currents alike, or turn the position round '
        '(`sign: -1` in a msg_config file)', numbers,
    )  # fmt: skip


def _best_pairs(record: Record, speed: Array) -> tuple[int, float]:
    """Return the pole pairs, negative for the other order of phases, and the correlation.

    That of the voltage with a back-EMF that turns so many times as fast as the shaft, after what
    the currents at both ends of each sample explain (resistance and inductance) has gone.
    """
    rows = slice(0, MOST_SAMPLES)
    u = _vector(record, 'voltage')[rows]
    omega = smoothed(speed[rows], max(1, round(AVERAGED / record.dt)))
    position = record['position'][rows]
    halfway = position + 0.5 * np.append(np.diff(position), 0.0)
    turn = np.exp(1j * halfway)
    basis = np.empty((u.size, 0), dtype=np.complex128)
    if sum(f'current_{p}' in record for p in PHASES) >= 2:
        i = _vector(record, 'current')[rows]
        basis = np.linalg.qr(np.column_stack([i, np.append(i[1:], i[-1])]))[0]

    def rest(x: Complex) -> Complex:
        return np.asarray(x - basis @ (basis.conj().T @ x))

    left, scores = rest(u), {}
    ahead, back = omega.astype(np.complex128), omega.astype(np.complex128)
    for pairs in range(1, MOST_PAIRS + 1):
        ahead, back = ahead * turn, back / turn
        scores[pairs] = _correlation(rest(ahead), left)
        scores[-pairs] = _correlation(rest(back), left)
    best = max(scores, key=lambda pairs: scores[pairs])
    return best, scores[best]


def _vector(record: Record, kind: str) -> Complex:
    """Return three phases as one complex number, (N,)."""
    x = to_dq(phase_columns(record, kind), 0.0)
    return np.asarray(x[:, 0] + 1j * x[:, 1])


def _correlation(x: Complex, y: Complex) -> float:
    scale = float(np.linalg.norm(x) * np.linalg.norm(y))
    return float(abs(np.vdot(x, y))) / scale if scale > 0 else 0.0


def _coarse(turn: float) -> Finding:
    return Finding(
        Severity.WARNING, 'phase_rate',
        f'the field turns by {math.degrees(turn):.0f} degrees from sample to sample at higher '
        'speeds',
        'phases change within a sample; voltages held from one to the next are not those that '
        'acted',
        f'record faster (by {math.ceil(turn / 0.2)} times), run slower, or record d and q from '
        'the drive', {'angle_rad': turn},
    )  # fmt: skip


@dataclass(frozen=True)
class _Emf:
    """Where the back-EMF lies: its angle from the d axis, rad, and its size, V s/rad."""

    angle: float
    constant: float


def _emf(u: Array, i: Array, speed: Array, dt: float) -> _Emf | None:
    """Find the back-EMF in d and q voltages (N, 2): what goes with the speed alone.

    ``u = Z i + speed (M i + e + |speed| l)`` with 2 x 2 matrices Z and M, both sides averaged;
    None where the motion does not tell.  An angle that is late turns the back-EMF as the speed
    grows (l), which is no wrong offset.
    """
    width = max(1, round(AVERAGED / dt))

    def smooth(x: Array) -> Array:
        return smoothed(x, width)

    currents = [i[:, 0], i[:, 1]]
    columns = [smooth(x) for x in (speed, *currents, *(speed * x for x in currents))]
    columns += [smooth(speed * np.abs(speed)), np.ones(speed.size)]
    x = np.column_stack(columns)
    scale = np.sqrt(np.mean(x**2, axis=0))
    seen = scale > 1e-12
    if not seen[0] or np.std(x[:, 0]) < 0.1 * scale[0]:
        return None
    y = np.column_stack([smooth(u[:, 0]), smooth(u[:, 1])])
    solution = np.linalg.lstsq(x[:, seen] / scale[seen], y, rcond=1e-3)[0]
    left = float(np.sum((y - (x[:, seen] / scale[seen]) @ solution) ** 2))
    if left > (1 - CLEAR) * float(np.sum((y - y.mean(axis=0)) ** 2)):
        return None
    e_d, e_q = solution[0] / scale[0]
    return _Emf(math.atan2(e_q, e_d), math.hypot(e_d, e_q))


def _angle_of_phases(record: Record, speed: Array, pole_pairs: int) -> Iterator[Finding]:
    """Tell what the phases say of pole pairs and electrical offset."""
    offset = math.nan
    if sum(f'current_{p}' in record for p in PHASES) >= 2:
        angle = electrical_angle(record['position'], pole_pairs)
        halfway = angle + 0.5 * np.append(np.diff(angle), 0.0)
        u = to_dq(phase_columns(record, 'voltage'), halfway)
        found = _emf(u, to_dq(phase_columns(record, 'current'), angle), speed, record.dt)
        offset = math.remainder(found.angle - math.pi / 2, math.tau) if found else math.nan
    known = f', the magnet lies at {offset:.3f} rad electrical where the position is 0'
    yield Finding(
        Severity.INFO, 'electrical_angle',
        f'the phases show {pole_pairs} pole pairs{known if math.isfinite(offset) else ""}',
        '', f'd and q: `with_dq(record, {pole_pairs}, {offset:.3f})`',
        {'pole_pairs': pole_pairs, 'offset_rad': offset},
    )  # fmt: skip


def _angle_of_dq(record: Record) -> Iterator[Finding]:
    """Look for the back-EMF: with d on the magnet it lies on q."""
    speed = speed_of(record)
    if speed is None:
        return
    yield from phase_currents.of_dq(record, speed)
    u, i = (
        np.column_stack([record[f'{kind}_{axis}'] for axis in 'dq'])
        for kind in ('voltage', 'current')
    )
    found = _emf(u, i, speed, record.dt)
    if found is None:
        return
    error = math.remainder(found.angle - math.pi / 2, math.tau)
    if abs(error) < OFF:
        return
    degrees = math.degrees(error)
    yield Finding(
        Severity.ERROR, 'electrical_offset',
        f'the back-EMF lies {degrees:.0f} degrees from the q axis{_mix_up(error)}',
        'torque would seem to come from the wrong current, and the flux of the magnet would come '
        'out wrong or negative',
        f'add {error:.3f} rad to the electrical offset of the drive or of `with_dq` (d lies on '
        'the magnet, see docs/notation.md), or exchange and turn the columns accordingly',
        {'error_rad': error, 'k_e_v_s_per_rad': found.constant},
    )  # fmt: skip


def _mix_up(error: float) -> str:
    if abs(abs(error) - math.pi / 2) < CLASSIC:
        return ': the angle seems to be counted from the q axis, or d and q are exchanged'
    if abs(error) > math.pi - CLASSIC:
        return ': the angle is off by half a turn, or the speed has the wrong sign'
    return ''
