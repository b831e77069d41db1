"""Records of a known motor for tests: finer integration than any model's, and real sensors."""

from collections.abc import Mapping, Sequence

import numpy as np

from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Provenance, Record

MOTOR = {
    'R': 2.1, 'L': 2.4e-3, 'k_t': 0.046, 'J': 2.6e-5, 'b': 1.3e-5, 'omega_eps': 0.02,
    'i_eps': 1e-3,
}  # fmt: skip
DT = 1e-3
COUNTS = 4096
CURRENT_NOISE = 0.012
CURRENT_OFFSET = 0.015


def voltage_profile(kind: str, seconds: float, rng: np.random.Generator) -> np.ndarray:
    """Return a held voltage: random steps, a slow triangle, or a sum of sines."""
    t = DT * np.arange(round(seconds / DT))
    if kind == 'steps':
        heights = rng.uniform(-9, 9, 1000)
        edges = np.cumsum(rng.uniform(0.05, 0.4, 1000))
        volts = heights[np.searchsorted(edges, t)]
    elif kind == 'triangle':
        volts = 6 * (2 * np.abs(2 * ((t / 4) % 1) - 1) - 1)
    else:
        volts = sum(2.0 * np.sin(2 * np.pi * f * t + rng.uniform(0, 6)) for f in (0.3, 0.9, 2.3))
    return np.where(t < 0.3, 0.0, volts)


def a_motor(effects: Mapping[str, Mapping[str, float]]) -> Model:
    """Return the motor with hidden effects."""
    model = Model.base('brushed_dc', MOTOR)
    for key, values in effects.items():
        model = model.with_effect(key, values)
    return model


def measure(
    model: Model, volts: np.ndarray, rng: np.random.Generator, *, substeps: int = 16
) -> Record:
    """Return what realistic sensors see of the motor.

    Encoder counts differenced over the last sample, and a current sensor with noise, an unknown
    offset and 12 bits over 20 A.
    """
    record = Record(DT * np.arange(volts.size), {'voltage': volts}, {'voltage': 'V'})
    run = simulate(model, record, follow_position=False, substeps=substeps)
    step = 2 * np.pi / COUNTS
    angle = step * np.floor(run.outputs['position'] / step + rng.uniform())
    speed = np.diff(angle, prepend=angle[0]) / DT
    bit = 20 / 4096
    current = run.outputs['current'] + CURRENT_OFFSET + CURRENT_NOISE * rng.normal(size=volts.size)
    signals = {
        'voltage': volts, 'current': bit * np.round(current / bit), 'speed': speed,
        'position': angle,
    }  # fmt: skip
    units = {'voltage': 'V', 'current': 'A', 'speed': 'rad/s', 'position': 'rad'}
    return Record(record.time, signals, units, Provenance('simulated'))


def records(
    effects: Mapping[str, Mapping[str, float]],
    kinds: Sequence[str] = ('steps', 'triangle', 'sines'),
    seconds: float = 6.0,
    seed: int = 1,
) -> list[Record]:
    """Return one record of each kind of excitation."""
    rng = np.random.default_rng(seed)
    model = a_motor(effects)
    return [measure(model, voltage_profile(kind, seconds, rng), rng) for kind in kinds]
