"""Make the golden bag: a brushed DC motor, simulated exactly, as sqlite3 and as mcap.

Run from the repository root (`.venv/bin/python bags/make_golden.py`); the files are in git, so
this is needed only to change them.  The simulation here is independent of the package: the linear
motor over one sample is a matrix exponential.
"""

from pathlib import Path
import shutil

import numpy as np
from scipy.linalg import expm
import yaml

from motor_sysid.recording import load
from motor_sysid.recording.save import write_record
from motor_sysid.signals import Record

HERE = Path(__file__).resolve().parent
MOTOR = {'R': 2.0, 'L': 0.002, 'k_t': 0.05, 'J': 2e-4, 'b': 1e-4}
RATE, SECONDS, COUNTS = 100, 2, 4000


def simulate() -> Record:
    """Run the motor from rest under steps of random height, and measure it."""
    rng = np.random.default_rng(1)
    r, inductance, k, inertia, b = MOTOR.values()
    block = np.zeros((4, 4))
    block[0] = -r / inductance, -k / inductance, 0, 1 / inductance
    block[1] = k / inertia, -b / inertia, 0, 0
    block[2, 1] = 1
    step = expm(block / RATE)
    count = RATE * SECONDS
    voltage = np.repeat(np.round(rng.uniform(-12, 12, count // 10 + 1), 2), 10)[:count]
    voltage[: RATE // 10] = 0
    state = np.zeros((count, 3))
    for n in range(count - 1):
        state[n + 1] = step[:3, :3] @ state[n] + step[:3, 3] * voltage[n]
    current = np.round((state[:, 0] + 0.01 * rng.standard_normal(count)) / 0.005) * 0.005
    lattice = 2 * np.pi / COUNTS
    position = np.floor(state[:, 2] / lattice) * lattice
    speed = np.diff(position, prepend=position[0]) * RATE
    signals = {'voltage': voltage, 'current': current, 'speed': speed, 'position': position}
    units = {'voltage': 'V', 'current': 'A', 'speed': 'rad/s', 'position': 'rad'}
    return Record(np.arange(count) / RATE, signals, units)


def main() -> None:
    """Write both bags and what is expected of them."""
    record = simulate()
    for storage in ('sqlite3', 'mcap'):
        folder = HERE / f'golden_{storage}'
        shutil.rmtree(folder, ignore_errors=True)
        write_record(record, folder, storage=storage, compress=storage == 'mcap')
    read = load(HERE / 'golden_sqlite3').records[0]
    expected = {
        'motor': 'brushed_dc',
        'parameters': MOTOR,
        'counts_per_turn': COUNTS,
        'samples': len(read),
        'dt_s': 1 / RATE,
        'signals': list(read),
        'sha256': read.digest(),
        'last_row': {name: float(read[name][-1]) for name in read},
    }
    (HERE / 'golden.yaml').write_text(yaml.safe_dump(expected, sort_keys=False))


if __name__ == '__main__':
    main()
