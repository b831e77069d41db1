r"""Ask the command about motors drawn at random, from a simulator apart from the benchmark's.

    .venv/bin/python bench/random_motors.py --seed 6 --folder motors --results six.jsonl
    .venv/bin/python bench/random_motors.py --seed 6 --folder motors \
        --also bench/results/random_motors_*.jsonl --markdown page.md

Motors are no data sheets: power, speed and time constants are drawn over a decade or two.  Each
case is a folder with three CSV files, a data sheet that is up to 12 % off, and what
`motor-sysid diagnose` said; those that have an answer are not asked again.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import json
from pathlib import Path
import subprocess
import sys
import time

import numpy as np
from numpy.typing import NDArray
from pages import filled, markdown
from plain_motor import measure, Motor, Rig
import yaml

Array = NDArray[np.float64]
Values = Mapping[str, float]

FILES = ('steps', 'triangle', 'judge')
LIMIT_S = 900


@dataclass(frozen=True)
class Draw:
    """What is known of a motor when what hides in it is drawn.

    Attributes
    ----------
    rng:
        Source of numbers.
    motor:
        The linear motor.
    size:
        Size of what hides, in units of the rated torque, of the voltage, or the like.
    current, supply:
        Rated current, A, and supply, V.
    dt, seconds:
        Time between samples and length of a record, s.
    top:
        Speed without load, rad/s.
    """

    rng: np.random.Generator
    motor: Motor
    size: float
    current: float
    supply: float
    dt: float
    seconds: float
    top: float

    @property
    def torque(self) -> float:
        """The size, in N m."""
        return self.size * self.motor.k * self.current

    def moment(self) -> float:
        """Return when something sets in, s."""
        return self.seconds * self.rng.uniform(0.3, 0.7)

    def lag(self, low: float, high: float) -> float:
        """Return a time constant, s: some samples, more where the size is large."""
        return self.rng.uniform(low, high) * self.dt * (1 if self.size < 0.1 else 3)


def _heating(d: Draw) -> Values:
    warmth = max(2.0, 100 * d.size)
    cooling = 1 / d.rng.uniform(6, 20)
    return {'heating': warmth * cooling / (4 * d.motor.R * (0.35 * d.current) ** 2),
            'cooling': cooling}  # fmt: skip


def _shaft(d: Draw) -> Values:
    ratio = d.rng.uniform(0.3, 3)
    near, far = d.motor.J / (1 + ratio), d.motor.J * ratio / (1 + ratio)
    reduced = near * far / d.motor.J
    stiffness = (2 * np.pi * d.rng.uniform(8, 40)) ** 2 * reduced
    return {'J': near, 'far_inertia': far, 'shaft': stiffness,
            'shaft_damping': 0.08 * np.sqrt(stiffness * reduced)}  # fmt: skip


def _play(d: Draw) -> Values:
    ratio, gear = d.rng.uniform(0.8, 3), d.rng.choice([1.0, 20.0, 50.0])
    near, far = d.motor.J / (1 + ratio), d.motor.J * ratio / (1 + ratio) * gear**2
    stiffness = (2 * np.pi * 60) ** 2 * near * gear**2
    width = d.rng.choice([0.01, 0.03, 0.08]) * (3 if gear > 1 else 8) * 4 * d.size
    return {'J': near, 'far_inertia': far, 'shaft': stiffness, 'gear': gear, 'play': width,
            'shaft_damping': 0.5 * np.sqrt(stiffness * near) * gear,
            'far_friction': 0.5 * d.motor.b * gear**2}  # fmt: skip


HIDDEN: dict[str, Callable[[Draw], Values]] = {
    'coulomb_friction': lambda d: {'friction': d.torque, 'stiction': d.torque},
    'stribeck_friction': lambda d: {
        'friction': d.torque, 'stiction': d.rng.uniform(1.5, 2.5) * d.torque,
        'fades_at': d.rng.uniform(2, 15),
    },
    'cogging_torque': lambda d: {
        'cogging': d.torque, 'teeth': d.rng.choice([10.0, 12.0, 14.0, 24.0, 36.0]),
    },
    'load_torque_step': lambda d: {'load': d.torque, 'load_from': d.moment()},
    'constant_load_torque': lambda d: {'load': d.rng.choice([-1, 1]) * d.torque},
    'quadratic_drag': lambda d: {'drag': 2 * d.torque / (0.8 * d.top) ** 2},
    'armature_heating': _heating,
    'friction_drift': lambda d: {
        'b': d.motor.b + 2 * d.torque / d.top, 'thins_to': d.motor.b,
        'thins_within': d.rng.uniform(3, 9),
    },
    'supply_sag': lambda d: {'supply_resistance': 1.5 * d.size * d.motor.R},
    'brush_voltage_drop': lambda d: {
        'brushes': 0.4 * d.size * d.supply, 'brushes_width': 0.003 * d.current,
    },
    'inverter_dead_time': lambda d: {
        'dead': 0.3 * d.size * d.supply, 'dead_width': d.rng.uniform(0.05, 0.2) * d.current,
    },
    'flexible_shaft': _shaft,
    'backlash': _play,
    'gravity_load': lambda d: {'weight': d.torque, 'weight_at': d.rng.uniform(0, 2 * np.pi)},
    'inertia_change': lambda d: {
        'more_inertia': 3 * d.size * d.motor.J, 'inertia_from': d.moment(),
    },
    'speed_sensor_lag': lambda d: {'speed_filter': d.lag(1, 4)},
    'current_sensor_lag': lambda d: {'current_filter': d.lag(0.5, 2)},
    'torque_ripple': lambda d: {
        'ripple': 0.6 * d.size, 'bars': d.rng.choice([7.0, 9.0, 11.0, 13.0]),
    },
    'input_delay': lambda d: {'delay': d.rng.uniform(0.6, 3.5) * d.dt},
}  # fmt: skip
"""Effect of the catalogue to what it is in the simulator."""

SLOW = {'stribeck_friction', 'cogging_torque', 'gravity_load', 'torque_ripple'}
"""Effects that a motor shows as it turns slowly."""

TOGETHER = (
    ('coulomb_friction', 'cogging_torque'), ('coulomb_friction', 'supply_sag'),
    ('stribeck_friction', 'gravity_load'), ('quadratic_drag', 'input_delay'),
    ('coulomb_friction', 'load_torque_step'), ('armature_heating', 'coulomb_friction'),
    ('inverter_dead_time', 'coulomb_friction'), ('current_sensor_lag', 'coulomb_friction'),
    ('flexible_shaft', 'coulomb_friction'), ('torque_ripple', 'coulomb_friction'),
    ('coulomb_friction', 'inertia_change'), ('brush_voltage_drop', 'quadratic_drag'),
)  # fmt: skip

CASES: tuple[tuple[str, ...], ...] = ((), *((key,) for key in HIDDEN), (), *TOGETHER)


def main() -> int:
    """Draw motors, ask about each, and print or write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seed', type=int, default=3)
    parser.add_argument('--to', type=int, default=len(CASES), metavar='N', help='number of motors')
    parser.add_argument('--folder', type=Path, required=True, help='where records are written')
    parser.add_argument('--results', type=Path, metavar='FILE', help='where answers are written')
    parser.add_argument('--also', type=Path, nargs='*', default=(), metavar='FILE',
                        help='answers of other seeds for the table')  # fmt: skip
    parser.add_argument('--markdown', type=Path, metavar='FILE', help='page to bring up to date')
    args = parser.parse_args()
    answers = []
    for number in range(args.to):
        answers.append(answer(number, args.seed, args.folder / f'{args.seed}_{number:03d}'))
        print(json.dumps(answers[-1]), flush=True)  # noqa: T201
    if args.results:
        lines = ''.join(f'{json.dumps(one)}\n' for one in answers)
        args.results.write_text(lines, encoding='utf-8')
    if args.markdown:
        page = filled(args.markdown, 'random motors', table([*kept(args.also), *answers]))
        args.markdown.write_text(page, encoding='utf-8')
    return 0


def kept(files: Sequence[Path]) -> list[dict[str, object]]:
    """Return the answers of results files."""
    return [json.loads(line) for file in files for line in file.read_text('utf-8').splitlines()]


def answer(number: int, seed: int, folder: Path) -> dict[str, object]:
    """Return what is hidden in a motor, what was said, and the held-out errors."""
    hidden, said = CASES[number % len(CASES)], folder / 'answer.json'
    if not said.exists():
        draw(hidden, np.random.default_rng([seed, number]), folder)
        ask(folder, said)
    found = json.loads(said.read_text(encoding='utf-8'))
    errors = [step['validation_error_percent'] for step in found['steps']]
    return {
        'hidden': list(hidden), 'verdict': found['verdict'], 'named': found['effects'],
        'before': errors[0], 'after': errors[-1], 'sensors': found['noise_floor_percent'],
        'seconds': found['seconds'],
    }  # fmt: skip


def table(answers: Sequence[Mapping[str, object]]) -> str:
    """Return a table in Markdown: how many were answered by exactly what is hidden."""
    rows = []
    for hidden in dict.fromkeys(CASES):
        mine = [one for one in answers if tuple(one['hidden']) == hidden]
        others = [in_words(one) for one in mine if not is_right(one)]
        if mine:
            row = ' + '.join(hidden) or 'nothing', len(mine), len(mine) - len(others)
            rows.append([*map(str, row), '; '.join(others)])
    return markdown(('hidden', 'motors', 'named exactly', 'other answers'), rows)


def is_right(one: Mapping[str, object]) -> bool:
    """Whether exactly what is hidden is named, for certain."""
    verdict = 'effect_missing' if one['hidden'] else 'complete'
    return one['verdict'] == verdict and set(one['named']) == set(one['hidden'])


def in_words(one: Mapping[str, object]) -> str:
    """Return what was said, with the errors."""
    said = str(one['verdict']).replace('_', ' ')
    names = ' + '.join(one['named'])
    said = names if one['verdict'] == 'effect_missing' else f'{said} {names}'.strip()
    return (
        f'{said} ({one["before"]:.3g} → {one["after"]:.3g} %, sensors alone {one["sensors"]:.3g})'
    )


def ask(folder: Path, said: Path) -> None:
    """Let the command diagnose the records of a folder."""
    began = time.monotonic()
    command = [
        sys.executable, '-m', 'motor_sysid.cli', 'diagnose', 'steps.csv', 'triangle.csv',
        '--validate', 'judge.csv', '--nominal', 'sheet.yaml', '--motor', 'brushed_dc',
        '--json', said.name,
    ]  # fmt: skip
    with (folder / 'said.txt').open('w', encoding='utf-8') as out:
        subprocess.run(
            command, cwd=folder, stdout=out, stderr=subprocess.STDOUT, check=True, timeout=LIMIT_S
        )
        print(f'{time.monotonic() - began:.0f} s', file=out)


def draw(hidden: Sequence[str], rng: np.random.Generator, folder: Path) -> None:
    """Draw a motor with what is hidden in it, measure it and write what a user has of it."""
    d = drawn(rng)
    motor, rig = d.motor, rig_of(d)
    for key in hidden:
        found = HIDDEN[key](d)
        rig = rig._replace(**{k: float(v) for k, v in found.items() if k in rig._fields})
        motor = motor._replace(**{k: float(v) for k, v in found.items() if k in motor._fields})
    folder.mkdir(parents=True, exist_ok=True)
    slow = bool(SLOW & set(hidden))
    closed, judged_closed = rng.random() < 0.45, rng.random() < 0.5
    shown = 4 if slow or rng.random() < 0.7 else 3
    for name, volts in zip(FILES, voltages(d, slow=slow), strict=True):
        loop = closed or (judged_closed and name == 'judge')
        asked = volts / d.supply * 0.75 * d.top if loop else volts
        gains = controller(d) if loop else {}
        noise = d.current * rng.uniform(0.003, 0.015) * rng.standard_normal(volts.size)
        columns = measure(motor, rig._replace(**gains), asked, d.dt, noise)[:, :shown]
        write(folder / f'{name}.csv', d.dt, columns)
    sheet = {
        'resistance_ohm': d.motor.R, 'inductance_H': d.motor.L,
        'torque_constant_Nm_per_A': d.motor.k, 'inertia_total_kgm2': d.motor.J,
        'viscous_friction_Nms': d.motor.b,
    }  # fmt: skip
    nominal = {name: float(value * rng.uniform(0.88, 1.12)) for name, value in sheet.items()}
    text = yaml.safe_dump({'motor_type': 'brushed_dc', 'nominal': nominal})
    (folder / 'sheet.yaml').write_text(text, encoding='utf-8')


def drawn(rng: np.random.Generator) -> Draw:
    """Draw a linear motor: 6 to 200 W, electrical and mechanical times over a decade each."""
    supply, top = rng.choice([6.0, 12.0, 18.0, 24.0, 36.0, 48.0]), rng.uniform(300, 900)
    power, within = _spread(rng, 6, 200), _spread(rng, 8e-3, 80e-3)
    k, current = supply / top, power / (0.8 * supply)
    r = supply / (current * rng.uniform(6, 25))
    motor = Motor(
        r, r * _spread(rng, 8e-5, 1.5e-3), k, within * k**2 / r,
        rng.uniform(0.005, 0.04) * k * current / top,
    )  # fmt: skip
    dt = rng.choice([1e-3] * 6 + [2e-3, 5e-4] + ([5e-3] if within > 25e-3 else []))
    seconds = min(20000 * dt, rng.uniform(10, 20))
    size = rng.choice([0.03, 0.1, 0.25], p=[0.35, 0.45, 0.2])
    return Draw(rng, motor, size, current, supply, dt, seconds, top)


def _spread(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def rig_of(d: Draw) -> Rig:
    """Draw drive and sensors; every fifth current sensor has a range of its own."""
    usual = d.rng.random() < 0.8
    end = 1.3 * d.supply / d.motor.R if usual else 42.0
    return Rig(
        d.supply, d.rng.choice([255.0, 1000.0, 2400.0]),
        d.rng.choice([1024.0, 2000.0, 4096.0, 16384.0]), d.current * d.rng.uniform(-0.01, 0.01),
        end / 2048, end,
    )  # fmt: skip


def _within(d: Draw) -> float:
    """Return the mechanical time constant, s."""
    return d.motor.R * d.motor.J / d.motor.k**2


def controller(d: Draw) -> dict[str, float]:
    """Return the gains of a speed loop that is 2.5 times as fast as the motor, if it can be."""
    fast = min(2.5 / _within(d), 0.08 / d.dt)
    return {'proportional': fast * _within(d) * d.motor.k, 'integral': fast * d.motor.k}


def voltages(d: Draw, *, slow: bool) -> list[Array]:
    """Return steps, a triangle and a sum of sines, V, the first half second of each zero."""
    t = d.dt * np.arange(round(d.seconds / d.dt))
    least = max(0.06, 1.5 * _within(d))
    edges = 0.5 + np.cumsum(d.rng.uniform(least, 6 * least + 0.2, t.size))
    heights = d.rng.uniform(-1, 1, t.size + 1)
    wave = sum(np.sin(2 * np.pi * f * t + d.rng.uniform(0, 6)) for f in (0.3, 0.9, 2.1, 4.7))
    turns = 2.5 * (t - 0.5) / d.seconds
    shapes = [
        (0.4 if slow else 0.85) * heights[np.searchsorted(edges, t)],
        (0.25 if slow else 0.8) * 2 / np.pi * np.arcsin(np.sin(2 * np.pi * turns)),
        (0.25 if slow else 0.5) * 0.65 * wave,
    ]
    return [np.where(t < 0.5, 0.0, d.supply * shape) for shape in shapes]


def write(path: Path, dt: float, columns: Array) -> None:
    """Write a record as CSV with units in its head."""
    names = ('voltage [V]', 'current [A]', 'speed [rad/s]', 'position [rad]')
    head = ','.join(('time [s]', *names[: columns.shape[1]]))
    rows = np.column_stack([dt * np.arange(len(columns)), columns])
    np.savetxt(path, rows, fmt='%.9g', delimiter=',', header=head, comments='')


if __name__ == '__main__':
    sys.exit(main())
