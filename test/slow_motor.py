"""A motor whose signals are sampled at times of their own, by a finer integrator."""

from bench_motor import a_motor, COUNTS, CURRENT_NOISE, DT, voltage_profile
import numpy as np

from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record, Samples

UNITS = {'voltage': 'V', 'current': 'A', 'speed': 'rad/s', 'position': 'rad'}
FINE = 20
"""Samples of the truth in one of the record."""
SLOW = {'current': 0.0063, 'speed': 0.0105, 'position': 0.0105}
"""Periods, s, of signals with a clock of their own."""


def truth(
    kind: str, seed: int, effects: dict[str, dict[str, float]], seconds: float = 8.0
) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return the held voltage, fine times, and what the motor does at these."""
    volts = voltage_profile(kind, seconds, np.random.default_rng(seed))
    fine = DT / FINE * np.arange(FINE * volts.size)
    record = Record(fine, {'voltage': np.repeat(volts, FINE)}, {'voltage': 'V'})
    run = simulate(a_motor(effects), record, follow_position=False, substeps=4)
    return volts, fine, dict(run.outputs)


def sampled(
    kind: str, seed: int, slow: tuple[str, ...], effects: dict[str, dict[str, float]]
) -> Record:
    """Return a record at 1 kHz of which some signals were sampled at jittered times of their own.

    The speed is the difference of positions as they were sampled.
    """
    rng = np.random.default_rng([seed, 7])
    volts, fine, run = truth(kind, seed, effects)
    time = DT * np.arange(volts.size)
    count = 2 * np.pi / COUNTS
    shake = rng.uniform(-0.2, 0.2, 4000)
    signals, samples = {'voltage': volts}, {}
    for name in ('position', 'speed', 'current'):
        own = time
        if name in slow:
            period = SLOW[name]
            turns = np.arange(1, int(time[-1] / period))
            own = period * (turns + shake[: turns.size])
        if name == 'current':
            values = np.interp(own, fine, run[name]) + CURRENT_NOISE * rng.normal(size=own.size)
        else:
            values = count * np.floor(np.interp(own, fine, run['position']) / count)
        if name == 'speed':
            values = np.diff(values, prepend=values[0]) / np.diff(own, prepend=own[0] - DT)
        signals[name] = np.interp(time, own, values)
        if name in slow:
            samples[name] = Samples(own, values)
    return Record(time, signals, UNITS, samples=samples)


def records(*slow: str, **effects: dict[str, float]) -> list[Record]:
    """Return a record of each kind of excitation."""
    kinds = ('steps', 'triangle', 'sines')
    return [sampled(kind, seed, slow, effects) for seed, kind in enumerate(kinds)]
