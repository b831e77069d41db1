"""The last fit of a model that was fitted over short looks ahead: over free runs."""

from dataclasses import replace

import numpy as np

from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.rung import judge, Rung, vanished
from motor_sysid.estimation.batch import fit, Problem
from motor_sysid.physics.parameters import Parameter, ParameterSet

REACH = 3.0
"""Standard errors that a parameter may move by."""


def polish(rung: Rung, bench: Bench) -> Rung:
    """Fit a model that was fitted over short looks ahead once more over free runs.

    A free run tells of what adds up, an offset say; what it does to inertia or friction is drift.
    So no parameter may go further than `REACH`; the standard errors are those of the looks ahead.
    The result counts only if it runs better on held-out data, too.
    """
    if bench.horizon is None:
        return rung
    boxed = ParameterSet(tuple(map(_within_reach, rung.model.parameters)))
    model = replace(rung.model, parameters=boxed)
    found = fit(Problem(model, bench.train_free, bench.outputs, substeps=bench.substeps)).model
    known = {p.name: p.sigma for p in rung.model.parameters if p.sigma is not None}
    moved = rung.model.with_estimates(found.parameters.values(), known)
    better = judge(replace(rung.result, model=moved), bench)
    improved = better.validation.error_percent < rung.validation.error_percent
    improved = improved and not any(vanished(better.model, key) for key in better.model.effects)
    return better if improved else rung


def _within_reach(p: Parameter) -> Parameter:
    """Return a parameter that may move by `REACH` standard errors only."""
    if not p.free or p.sigma is None or not 0.0 < p.sigma < np.inf:
        return p
    low, high = p.value - REACH * p.sigma, p.value + REACH * p.sigma
    return replace(p, lower=max(low, p.lower), upper=min(high, p.upper))
