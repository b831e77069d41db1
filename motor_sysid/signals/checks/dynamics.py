"""Rate and length against the time constants, and the lag between voltage and response."""

from collections.abc import Iterator, Sequence

import numpy as np

from motor_sysid.signals.checks.common import Array, main_current, main_input, speed_of
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Record

ELECTRICAL_RATE = 500.0
"""Hz; below it the rise of the current after a step is over within a sample."""
EARLIEST, LATEST = -5, 200
"""Lags that are tried, in samples."""
CLEAR = 0.4
"""Correlation that the best lag must reach."""
SHARP = 1.3
"""The best lag must beat those three samples away by this factor."""
EXPLAINED = 0.8
"""Share of the speed that a first-order lag must explain for its time constant to count."""
MOST = 20_000
"""Samples that are looked at."""
ROWS_BACK = 4
"""Rows that the speed is regressed on."""
MUCH, EARLY = 1.5, 0.1
"""Ratio of the squares that are left without the input of the same row to those with it, and share
of the answer, from which on an answer comes too early."""


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look at delays and time constants."""
    record = max(records, key=len)
    driver = main_input(record)
    if not driver or len(record) < 50 or np.ptp(record[driver]) == 0:
        return
    yield from _lag(records, driver)
    yield from _answers_early(records, driver)
    yield from _electrical(record, driver)
    if driver.startswith(('voltage', 'duty')):
        yield from _mechanical(records, record, driver)


def response_lag(record: Record, driver: str, response: str) -> tuple[int, float] | None:
    """Return the lag in samples from `driver` to `response` and its correlation; None if unclear.

    With the convention of records, the first answer to the input of row k is in row k + 1.
    """
    change, answer = np.diff(record[driver][:MOST]), np.diff(record[response][:MOST])
    scale = float(np.sqrt(np.sum(change**2) * np.sum(answer**2)))
    if scale == 0:
        return None
    latest = min(LATEST, change.size // 4)
    size = 1 << int(np.ceil(np.log2(2 * change.size)))
    spectrum = np.conj(np.fft.rfft(change, size)) * np.fft.rfft(answer, size)
    full = np.fft.irfft(spectrum, size) / scale
    lags = np.arange(EARLIEST, latest)
    correlation = full[lags]
    best = int(np.argmax(correlation))
    aside = np.abs(lags - lags[best]) >= 3
    rival = float(np.max(np.abs(correlation[aside])))
    if correlation[best] < CLEAR or correlation[best] < SHARP * rival:
        return None
    return int(lags[best]), float(correlation[best])


def _lag(records: Sequence[Record], driver: str) -> Iterator[Finding]:
    """Compare changes of current and voltage: the answer comes within one sample."""
    current = main_current(records[0])
    if not current or current == driver or not driver.startswith(('voltage', 'duty')):
        return
    found = [
        lag for r in records
        if current in r and driver in r and _is_regular(r)
        and (lag := response_lag(r, driver, current))
    ]  # fmt: skip
    if not found:
        return
    samples, correlation = max(found, key=lambda item: item[1])
    dt = records[0].dt
    numbers = {'lag_samples': samples, 'lag_s': (samples - 1) * dt, 'correlation': correlation}
    closed = 'speed_reference' in records[0] or 'position_reference' in records[0]
    if samples >= 3:
        yield Finding(
            Severity.WARNING, 'late_response',
            f'{current} answers {driver} {samples - 1} samples '
            f'({(samples - 1) * dt * 1e3:.3g} ms) late',
            'a model without a delay cannot follow',
            'if driver or bus are that slow, it is the effect `input_delay`; else the stamps of '
            'the two topics come from different clocks', numbers,
        )  # fmt: skip
    elif samples <= 0 and not closed:
        yield Finding(
            Severity.WARNING, 'early_response',
            f'{current} changes {1 - samples} sample(s) before {driver} could have caused it',
            'resistance and inductance come out wrong',
            f'row k must hold the {driver} that is applied from t_k on; if yours was applied up '
            'to t_k, say `shift: -1` of its column in a msg_config file, or correct the stamps',
            numbers,
        )  # fmt: skip


def early_share(record: Record, driver: str) -> float:
    """Return the share of the speed's answer to `driver` that comes before its time, 0 to 1.

    The measured speed of row k is regressed on the input and itself `ROWS_BACK` rows back.  With
    the convention of records the input of row k is applied from then on and tells nothing of it; a
    controller that answers to noise in the speed makes its coefficient negative.  The share counts
    only where the input of the same row explains much of what is left without it.
    """
    if 'speed' not in record or len(record) < 20 * ROWS_BACK:
        return 0.0
    y, u = (x - np.mean(x) for x in (record['speed'][:MOST], record[driver][:MOST]))
    back = range(1, ROWS_BACK + 1)
    rows = slice(ROWS_BACK, None)
    past = np.column_stack([np.roll(x, k)[rows] for x in (u, y) for k in back])
    both = np.column_stack((u[rows], past))
    (without, _), (left, found) = (_regressed(columns, y[rows]) for columns in (past, both))
    inputs = found[: 1 + ROWS_BACK]
    if left * MUCH > without or inputs[0] * float(u @ y) <= 0:
        return 0.0
    return float(abs(inputs[0]) / np.sum(np.abs(inputs)))


def _regressed(columns: Array, target: Array) -> tuple[float, Array]:
    """Return the sum of squares that a linear regression leaves, and its coefficients."""
    found = np.linalg.lstsq(columns, target, rcond=None)[0]
    return float(np.sum((target - columns @ found) ** 2)), np.asarray(found, dtype=np.float64)


def _answers_early(records: Sequence[Record], driver: str) -> Iterator[Finding]:
    """Compare speed and voltage, where no current tells and nobody is seen to control."""
    first = records[0]
    closed = 'speed_reference' in first or 'position_reference' in first
    if closed or main_current(first) or not driver.startswith(('voltage', 'duty')):
        return
    shares = [early_share(r, driver) for r in records if driver in r and _is_regular(r)]
    if not shares or min(shares) < EARLY:
        return
    yield Finding(
        Severity.WARNING, 'early_response',
        f'the speed answers {driver} within the same row: {100 * min(shares):.0f} % of its answer '
        'comes before that can have caused it',
        'no model can follow; friction and inertia come out wrong',
        f'row k must hold the {driver} that is applied from t_k on; if yours was applied up to '
        't_k (set, wait, read, log), say `shift: -1` of its column in a msg_config file; if the '
        'speed was smoothed forward and backward, take the raw one', {'share': min(shares)},
    )  # fmt: skip


def _is_regular(record: Record) -> bool:
    """Tell whether lags in samples mean anything."""
    steps = np.diff(record.time)
    return len(record) >= 50 and bool(np.quantile(np.abs(steps / record.dt - 1), 0.95) < 0.5)


def _electrical(record: Record, driver: str) -> Iterator[Finding]:
    rate = 1 / record.dt
    slow = rate < 0.99 * ELECTRICAL_RATE  # by more than stamps are rounded
    if not slow or not main_current(record) or not driver.startswith('voltage'):
        return
    yield Finding(
        Severity.INFO, 'electrical_invisible',
        f'at {rate:.4g} Hz the rise of the current after a step is over within a sample or two',
        'the inductance cannot be found; the rest can',
        f'sample at {ELECTRICAL_RATE:.0f} Hz or more if the inductance matters',
        {'rate_hz': rate},
    )  # fmt: skip


def time_constant(record: Record, driver: str, speed: Array) -> tuple[float, float]:
    """Return the time constant (s) of the best first-order lag from input to speed.

    The second value is the share of the speed's variance that it explains.
    """
    step = max(1, len(record) // MOST)
    dt, inputs, output = record.dt * step, record[driver][::step], speed[::step]
    spread = float(np.var(output))
    best = (0.0, -1.0)
    for tau in np.geomspace(dt / 2, max(record.duration, 4 * dt), 24):
        filtered = _lagged(inputs, float(np.exp(-dt / tau)))
        left = _residual(filtered, output)
        explained = 1 - left / spread if spread > 0 else 0.0
        best = max(best, (float(tau), explained), key=lambda item: item[1])
    return best


def _lagged(values: Array, pole: float) -> Array:
    """Return ``y[k + 1] = pole y[k] + (1 - pole) values[k]`` from rest (by FFT: no scipy here)."""
    size = 1 << int(np.ceil(np.log2(2 * values.size)))
    kernel = (1 - pole) * pole ** np.arange(values.size)
    kernel = np.concatenate(([0.0], kernel[:-1]))
    spectrum = np.fft.rfft(values, size) * np.fft.rfft(kernel, size)
    return np.asarray(np.fft.irfft(spectrum, size)[: values.size], dtype=np.float64)


def _residual(regressor: Array, output: Array) -> float:
    """Variance of the output that a straight line in the regressor leaves."""
    a, b = regressor - np.mean(regressor), output - np.mean(output)
    power = float(np.mean(a * a))
    slope = float(np.mean(a * b)) / power if power > 0 else 0.0
    return float(np.mean((b - slope * a) ** 2))


def _mechanical(records: Sequence[Record], record: Record, driver: str) -> Iterator[Finding]:
    speed = speed_of(record)
    if speed is None or not record.is_uniform:
        return
    tau, explained = time_constant(record, driver, speed)
    if explained < EXPLAINED:
        return
    duration = sum(r.duration for r in records)
    numbers = {'time_constant_s': tau, 'explained': explained}
    if duration < 5 * tau:
        yield Finding(
            Severity.WARNING, 'too_short',
            f'the record lasts {duration:.3g} s, the motor needs about {tau:.3g} s to settle',
            'friction and inertia cannot be told apart', 'record at least ten time constants',
            numbers,
        )  # fmt: skip
    if record.dt > tau / 2:
        yield Finding(
            Severity.WARNING, 'too_slow',
            f'samples are {record.dt * 1e3:.3g} ms apart, the motor settles within about '
            f'{tau * 1e3:.3g} ms',
            'the inertia cannot be found', f'sample at {5 / tau:.0f} Hz or more', numbers,
        )  # fmt: skip
