"""Made-up results of the benchmark, and tasks for its workers."""

import os
import time

import numpy as np

from motor_sysid.benchmark.outcome import Named, Outcome, Result

BASE = ('R', 'L', 'k_t', 'J', 'b')


def result(
    effects: tuple[str, ...] = (),
    outcome: Outcome = Outcome.RIGHT,
    named: tuple[str, ...] | None = None,
    number: int = 0,
    **other: object,
) -> Result:
    """Return a result as the benchmark would make it; what is not given is unremarkable."""
    said = effects if named is None else named
    category = ('complete', 'single', 'pair')[len(effects)]
    size = 0.03 if effects else 0.0
    values: dict[str, object] = {
        'case': f'{category}/{"+".join(effects)}/3/{number}',
        'category': category,
        'effects': effects,
        'size': size,
        'known': True,
        'motor': 'some motor',
        'outcome': outcome,
        'verdict': 'effect_missing' if said else 'complete',
        'named': said,
        'first': said[0] if said else 'quadratic_drag',
        'before': 5.0 if effects else 2.0,
        'after': 2.0,
        'reference': 2.0,
        'floor': 1.9,
        'sigmas': {f'{key}.x': 0.5 for key in said},
        'reference_sigmas': {f'{key}.x': 0.4 for key in effects},
        'base_before': dict.fromkeys(BASE, 0.3 if effects else 0.01),
        'base_after': dict.fromkeys(BASE, 0.01),
        'base_reference': dict.fromkeys(BASE, 0.009),
        'peers': {'f_test': Named((*said, 'quadratic_drag'), 0.5)},
        'seconds': 4.0,
    }
    return Result(**{**values, **other})  # type: ignore[arg-type]


def mixture() -> list[Result]:
    """Return some results of every kind."""
    rng = np.random.default_rng(1)
    found = [result(number=k) for k in range(40)]
    found.append(result((), Outcome.FALSE_ALARM, ('quadratic_drag',), 40))
    for key in ('coulomb_friction', 'cogging_torque'):
        for k in range(30):
            z = {f'{key}.x': float(rng.standard_normal())}
            found.append(result((key,), number=k, sigmas=z, reference_sigmas=z))
    found.append(result(('input_delay',), Outcome.WRONG, ('armature_heating',), 0))
    found.append(result(('input_delay',), Outcome.AMBIGUOUS, number=1, verdict='ambiguous'))
    pair = ('coulomb_friction', 'quadratic_drag')
    found.append(result(pair, Outcome.RIGHT))
    found.append(result(pair, Outcome.PART, pair[:1], 1))
    found.append(
        result(('gravity_load',), Outcome.RIGHT, (), 7, category='withheld', known=False,
               verdict='unknown_effect', case='withheld/gravity_load/3/7')
    )  # fmt: skip
    found.append(result(('gravity_load',), Outcome.FAILED, (), 8, error='ValueError: <no> way'))
    return found


def work(task: int) -> int:
    """Square a number; 13 crashes the process, 7 takes for ever, 5 raises."""
    if task == 13:
        os._exit(1)
    if task == 7:
        time.sleep(1000)
    if task == 5:
        raise ValueError('five')
    return task**2


def no_start() -> None:
    """Fail before the first task."""
    os._exit(1)
