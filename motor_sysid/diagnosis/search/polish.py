"""The last fit of a model that was fitted over short looks ahead: over free runs."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.rung import judge, Rung
from motor_sysid.diagnosis.search.sense import vanished
from motor_sysid.diagnosis.search.standard_errors import profiled
from motor_sysid.estimation.batch import fit, Problem
from motor_sysid.physics.parameters import Parameter, ParameterSet

REACH = 3.0
"""Standard errors that a parameter may move by."""


def polish(rung: Rung, bench: Bench) -> Rung:
    """Fit a model that was fitted over short looks ahead once more over free runs.

    A free run tells of what adds up, an offset say; what it does to inertia or friction is drift.
    So no parameter may go further than `REACH`; the standard errors are those of the looks ahead.
    What a valley in their cost adds is left out: drift would follow it.
    The result counts only if it runs better on held-out data, too.
    """
    if bench.horizon is None:
        return rung
    told = np.sqrt(np.maximum(np.diag(rung.result.covariance), 0.0)).tolist()
    scanned = profiled(rung.model)
    sizes = {
        p.name: p.sigma or 0.0 if p.name in scanned else size
        for p, size in zip(rung.model.parameters.free, told, strict=True)
    }
    boxed = ParameterSet(tuple(_within_reach(p, sizes) for p in rung.model.parameters))
    model = replace(rung.model, parameters=boxed)
    found = fit(Problem(model, bench.train_free, bench.outputs, substeps=bench.substeps)).model
    known = {p.name: p.sigma for p in rung.model.parameters if p.sigma is not None}
    moved = rung.model.with_estimates(found.parameters.values(), known)
    better = judge(replace(rung.result, model=moved), bench)
    improved = better.validation.error_percent < rung.validation.error_percent
    improved = improved and not any(vanished(better.model, key) for key in better.model.effects)
    return better if improved else rung


def _within_reach(p: Parameter, sizes: Mapping[str, float]) -> Parameter:
    """Return a parameter that may move by `REACH` standard errors only."""
    size = sizes.get(p.name, 0.0)
    if not 0.0 < size < np.inf:
        return p
    low, high = p.value - REACH * size, p.value + REACH * size
    return replace(p, lower=max(low, p.lower), upper=min(high, p.upper))
