"""The deepest of many pits: where teeth strike, a fit begins again from all around.

A little more or less of anything moves every later blow, and the sum of squares has pits
everywhere, some per cent apart.  The one that a fit happens to end in says little; the deepest of
several is mostly near the truth, and how far they are apart tells how well the data tell it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.refit import rough_fit, ROUGH_STEPS
from motor_sysid.diagnosis.search.rung import climb, FINER, Rung, SPOILED
from motor_sysid.estimation.batch import FitResult, misfit
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.threads import in_threads

Array = NDArray[np.float64]

STARTS, APART = 12, 0.1
"""From how many places around a fit others begin, and how far away, as a share of each parameter
of what strikes."""

KEPT = 0.5
"""Share of the fits, deepest first, whose spread is that of the parameters."""


def strikes(model: Model) -> bool:
    """Whether teeth strike in a model."""
    return any(effect(key).card.strikes for key in model.effects)


def deepest(rung: Rung, bench: Bench) -> tuple[Rung, Array]:
    """Return the deepest of the pits around a fit, and how far apart (p,) they are.

    The spread is a standard deviation in the units of the parameters; zero where nothing strikes.
    The fit itself stays if another one does the held-out error harm.
    """
    if not strikes(rung.model):
        return rung, np.zeros(len(rung.model.parameters.free))
    finer = replace(bench, substeps=max(bench.substeps, FINER))
    weighting = rung.result.weighting

    def fitted(model: Model) -> FitResult:
        return rough_fit(model, weighting, finer, ROUGH_STEPS, reweight=0)

    fits = in_threads(fitted, [rung.model, *_around(rung.model)])
    here, best = fits[0], min(fits, key=misfit)
    kept = sorted(fits, key=misfit)[: round(KEPT * len(fits))]
    spread = np.std([[p.value for p in one.model.parameters.free] for one in kept], axis=0)
    if best is here:
        return rung, spread
    other = climb(best.model, bench, weighting, briefly=True)
    better = other.held.error_percent < SPOILED * rung.held.error_percent
    return (other if better else rung), spread


def _around(model: Model) -> list[Model]:
    """Return models with other values of what strikes."""
    own = [
        p for key in model.effects if effect(key).card.strikes
        for p in model.parameters.free if p.name.startswith(f'{key}.')
    ]  # fmt: skip
    factors = np.exp(APART * np.random.default_rng(0).standard_normal((STARTS, len(own))))
    return [
        model.with_values({
            p.name: float(np.clip(p.value * factor, p.lower, p.upper))
            for p, factor in zip(own, row, strict=True)
        })
        for row in factors
    ]  # fmt: skip
