"""A motor with a torque that no catalogue knows, integrated by Runge-Kutta in steps of 25 us."""

from numba import njit
import numpy as np

from motor_sysid.signals.record import Provenance, Record

DT, PARTS, COUNTS = 1e-3, 40, 4096
MOTOR = {'R': 2.1, 'L': 2.4e-3, 'k_t': 0.046, 'J': 2.6e-5, 'b': 1.3e-5}
UNITS = {'voltage': 'V', 'current': 'A', 'speed': 'rad/s', 'position': 'rad'}

LAWS = ('plain', 'latch', 'cam', 'weight')
"""What is strange about the motor, by its number in `torque`."""


@njit(cache=True)
def torque(number: int, omega: float, theta: float) -> float:
    """Return a strange torque in N m.

    A drag that sets in around 60 rad/s and is gone at 120 (a shaft that latchs); a cam with a
    spring, a bump over a part of the turn; a weight on an arm.
    """
    if number == 1:
        return -9e-3 * np.exp(-(((omega - 70.0) / 20.0) ** 2))
    if number == 2:
        return 8e-3 * np.sin(theta) * np.exp(2.0 * (np.cos(theta) - 1.0))
    if number == 3:
        return -5e-3 * np.sin(theta)
    return 0.0


@njit(cache=True)
def _rates(law, u, i, omega, theta, p):  # type: ignore[no-untyped-def]
    r, inductance, k, inertia, b = p
    net = k * i - b * omega + torque(law, omega, theta)
    return (u - r * i - k * omega) / inductance, net / inertia, omega


@njit(cache=True)
def _run(law, volts, p, out):  # type: ignore[no-untyped-def]
    h, x = DT / PARTS, np.zeros(3)
    for n in range(volts.size):
        out[n] = x
        for _ in range(PARTS):
            k1 = np.array(_rates(law, volts[n], x[0], x[1], x[2], p))
            y = x + 0.5 * h * k1
            k2 = np.array(_rates(law, volts[n], y[0], y[1], y[2], p))
            y = x + 0.5 * h * k2
            k3 = np.array(_rates(law, volts[n], y[0], y[1], y[2], p))
            y = x + h * k3
            k4 = np.array(_rates(law, volts[n], y[0], y[1], y[2], p))
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def volts(seconds: float, rng: np.random.Generator, top: float = 8.0) -> np.ndarray:
    """Return steps and slow sweeps in turn."""
    t = DT * np.arange(round(seconds / DT))
    edges = np.cumsum(rng.uniform(0.1, 0.5, t.size))
    steps = rng.uniform(-top, top, t.size + 1)[np.searchsorted(edges, t)]
    sweep = top * np.sin(2 * np.pi * 0.35 * t + rng.uniform(0, 6))
    return np.where((t // 2.0) % 2 == 0, steps, sweep)


def recorded(law: str, voltage: np.ndarray, rng: np.random.Generator) -> Record:
    """Return what an encoder and a current sensor see of a motor of `LAWS`."""
    out = np.zeros((voltage.size, 3))
    _run(LAWS.index(law), voltage, tuple(MOTOR.values()), out)
    step = 2 * np.pi / COUNTS
    angle = step * np.floor(out[:, 2] / step)
    signals = {
        'voltage': voltage,
        'current': out[:, 0] + 0.01 * rng.standard_normal(voltage.size),
        'speed': np.diff(angle, prepend=angle[0]) / DT,
        'position': angle,
    }
    time = DT * np.arange(voltage.size)
    return Record(time, signals, UNITS, Provenance('a strange motor'))
