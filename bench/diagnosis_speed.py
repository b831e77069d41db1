"""How long a diagnosis of a minute at 1 kHz takes, cold and warm, and where the time goes.

    .venv/bin/python bench/diagnosis_speed.py --json speed.json
    .venv/bin/python bench/diagnosis_speed.py --case friction_cogging --seconds 60 --rate 1000

Cold is a fresh process with compiled code on disk, imports included; warm is the second diagnosis
in that process.  The records come from the benchmark's own simulator: one closed-loop run of a
20 W motor with encoder and current sensor, the last fifth held back.  CPU time stands beside wall
time: on a busy machine the first is the one to compare.  The ratio is wall time to the limit.
"""

import argparse
from itertools import pairwise
import json
import os
from pathlib import Path
import subprocess
import sys
import time

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

CASES = {
    'complete': (),
    'friction_cogging': ('coulomb_friction', 'cogging_torque'),
    'flexible_shaft': ('flexible_shaft',),
}
SIZE = 0.1
LIMITS = {'cold': 10.0, 'warm': 4.0}
"""s, on two cores."""


def main() -> None:
    """Run every case in a process of its own and print its figures."""
    args = arguments()
    if args.child:
        print(json.dumps(measure(args.child, args.seconds, args.rate, args.seed)))  # noqa: T201
        return
    names = [args.case] if args.case else list(CASES)
    found = {name: in_fresh_process(name, args) for name in names}
    for name, result in found.items():
        show(name, result)
    if args.json:
        args.json.write_text(json.dumps(found, indent=1) + '\n')


def arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--case', choices=CASES)
    parser.add_argument('--seconds', type=float, default=60.0)
    parser.add_argument('--rate', type=float, default=1000.0)
    parser.add_argument('--seed', type=int, default=3)
    parser.add_argument('--json', type=Path)
    parser.add_argument('--child', choices=CASES, help=argparse.SUPPRESS)
    return parser.parse_args()


def in_fresh_process(case: str, args: argparse.Namespace) -> dict[str, object]:
    """Measure a case twice: the first process fills the caches, the second is the cold one."""
    command = [
        sys.executable, __file__, '--child', case, '--seconds', str(args.seconds),
        '--rate', str(args.rate), '--seed', str(args.seed),
    ]  # fmt: skip
    fill = [*command]
    fill[fill.index('--seconds') + 1] = '5'
    subprocess.run(fill, check=True, capture_output=True)
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    result: dict[str, object] = json.loads(done.stdout.splitlines()[-1])
    return result


def measure(case: str, seconds: float, rate: float, seed: int) -> dict[str, object]:
    """Diagnose a case twice in this process; the first time counts the imports, too."""
    begun = time.perf_counter(), time.process_time()
    from motor_sysid.threads import use_one

    use_one()  # as every program of ours does
    import motor_sysid.diagnosis.diagnose as _  # noqa: F401

    loading = time.perf_counter() - begun[0], time.process_time() - begun[1]
    record = closed_loop(CASES[case], seconds, rate, seed)
    cold = timed(record)
    cold['wall_s'] += loading[0]
    cold['cpu_s'] += loading[1]
    cold['stages'].insert(0, ('imports', *loading, 0.0))
    warm = timed(record)
    return {'cold': cold, 'warm': warm, 'load': os.getloadavg()[0], 'samples': len(record)}


def closed_loop(effects: tuple[str, ...], seconds: float, rate: float, seed: int):  # type: ignore[no-untyped-def]
    """Return the record of a motor with hidden effects under PI speed control."""
    import numpy as np

    from motor_sysid.benchmark.cases import slow_time
    from motor_sysid.benchmark.datasheets import DataSheet
    from motor_sysid.benchmark.excitation import random_steps
    from motor_sysid.benchmark.hidden import HIDE, Situation
    from motor_sysid.benchmark.plant import Plant
    from motor_sysid.benchmark.sensors import measure as sensed
    from motor_sysid.benchmark.sensors import Sensors
    from motor_sysid.benchmark.truth import Control, run

    rng = np.random.default_rng(seed)
    sheet = DataSheet('20 W', '', 24.0, 3.99, 556e-6, 35.2e-3, 45.3e-7, 43e-3)
    drag = 0.04 * sheet.torque / sheet.top_speed
    plant = Plant(sheet.R, sheet.L, sheet.k, 3 * sheet.J, drag)
    for key in effects:
        plant = HIDE[key](plant, SIZE, Situation(sheet, seconds, 1.0), rng)
    slow, dt = slow_time(plant), 1 / rate
    time_s = dt * np.arange(round(seconds * rate))
    reference = 0.4 * sheet.top_speed * random_steps(time_s, slow, rng)
    control = Control(
        reference, 2 * plant.k, 2 * plant.k / slow, sheet.voltage, sheet.voltage / 1000, 2048
    )
    noise = 0.006 * sheet.current
    sensors = Sensors(2048, 0.0, noise, 20 * sheet.current / 4096, noise, position=True)
    return sensed(run(plant, control, dt), sensors, dt, rng, reference)


def timed(record) -> dict[str, object]:  # type: ignore[no-untyped-def]
    """Diagnose once; return seconds, stages, simulated steps, and what was found."""
    from motor_sysid.diagnosis import diagnose
    from motor_sysid.effort import counted_by, Effort

    effort = Effort()
    with counted_by(effort):
        def now() -> tuple[float, float, int]:
            return time.perf_counter(), time.process_time(), effort.steps

        marks: list[tuple[str, tuple[float, float, int]]] = [('preparing', now())]
        found = diagnose([record], progress=lambda text: marks.append((text, now())))
        marks.append(('', now()))
    stages: list[tuple[str, float, float, float]] = [
        (text, b[0] - a[0], b[1] - a[1], (b[2] - a[2]) / 1e6)
        for (text, a), (_, b) in pairwise(marks)
    ]
    return {
        'wall_s': sum(s[1] for s in stages), 'cpu_s': sum(s[2] for s in stages),
        'million_steps': sum(s[3] for s in stages), 'stages': stages,
        'verdict': found.verdict.value, 'effects': list(found.effects),
        'error_percent': found.steps[-1].validation_error_percent,
        'floor_percent': found.noise_floor_percent,
    }  # fmt: skip


def show(name: str, result: dict[str, object]) -> None:
    """Print one case."""
    print(f'{name}: {result["samples"]} samples, load {result["load"]:.1f}')  # noqa: T201
    for which, limit in LIMITS.items():
        run = result[which]
        assert isinstance(run, dict)
        lines = [
            f'  {which}: {run["wall_s"]:.2f} s wall, {run["cpu_s"]:.2f} s CPU, '
            f'{run["wall_s"] / limit:.2f} of the limit of {limit:g} s; '
            f'{run["million_steps"]:.1f} million steps; {run["verdict"]} {run["effects"]}',
            '     wall     CPU  million steps',
        ]
        lines += [f'  {w:7.2f} {c:7.2f} {m:7.1f}  {stage}' for stage, w, c, m in run['stages']]
        print('\n'.join(lines))  # noqa: T201


if __name__ == '__main__':
    main()
