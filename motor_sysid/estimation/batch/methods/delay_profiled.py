"""Delay-profiled least squares: every delay of a grid has its own linear fit.

The delay alone is not linear.  For each value the input is shifted and the filtered balances are
solved; the one that runs freely with the smallest error wins, and the output error is fitted from
there.  No start value is needed.  (Profiling a parameter out: Golub and Pereyra 1973,
doi:10.1137/0710036; delays: Ljung 1999, section 4.3.)
"""

from dataclasses import replace

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.chains import Chain
from motor_sysid.estimation.batch.least_squares import fit as fit_output_error
from motor_sysid.estimation.batch.methods.rows import least_squares, solved
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.weighting import white
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import Motor
from motor_sysid.signals.record import Record

EFFECT = 'input_delay'
NAME = 'input_delay.delay'

_SAMPLES = (0.0, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 18.0, 27.0)


def fit(problem: Problem) -> FitResult:
    """Fit a model with an input delay.

    Raises
    ------
    UserError
        If the model has none.
    """
    model = problem.model
    if EFFECT not in model.effects:
        raise UserError(f'`delay_profiled` looks for a delay; add the effect `{EFFECT}`')
    begun = [_at(problem, samples) for samples in _SAMPLES]
    weighting = white([s.judged - s.judged.mean(axis=0) for s in problem.stretches])
    costs = []
    for one in begun:
        here = _problem(problem, one)
        near = here.linearize(here.vector(), parameters=False)
        costs.append(float(here.costs(here.vector()[np.newaxis], weighting, near)[0]))
    return fit_output_error(_problem(problem, begun[int(np.argmin(costs))]))


def _problem(problem: Problem, model: Model) -> Problem:
    return Problem(model, problem.chains, problem.outputs, substeps=problem.substeps)


def _at(problem: Problem, samples: float) -> Model:
    """Return the model whose balances are solved with the input that many samples later."""
    kind = problem.model.kind
    chains: list[Chain] = [
        tuple(replace(s, record=delayed(s.record, kind, samples)) for s in chain)
        for chain in problem.chains
    ]
    shifted = Problem(problem.model, chains, problem.outputs, substeps=problem.substeps)
    found = solved(shifted, lambda model, k, x, y: least_squares(x, y), passes=1).model
    box = problem.model.parameters[NAME]
    dt = problem.stretches[0].record.dt
    return found.with_values({NAME: float(np.clip(samples * dt, box.lower, box.upper))})


def delayed(record: Record, kind: Motor, samples: float) -> Record:
    """Return the record with its inputs later; a part of a sample mixes two held values."""
    whole = int(np.floor(samples))
    part = samples - whole
    for name in input_signals(record, kind):
        u = record[name]
        late = np.concatenate((np.full(whole + 1, u[0]), u))
        mixed = (1 - part) * late[1 : u.size + 1] + part * late[: u.size]
        record = record.with_signal(name, mixed, record.units[name])
    return record
