"""A fit whose delay a pit holds: the delay goes from share to share of a sample, the rest follows.

An inductance that is too large makes up for most of a delay that is too short, so the way from one
to the other is a long flat valley.  Wherever an edge of the input passes a sample the outputs
bend, and where a step of the integration is cut in two, waves over a turn are followed otherwise:
the valley has pits, and derivatives lead into the next one.  What is left in it looks like another
missing effect.
"""

from dataclasses import replace

import numpy as np

from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.delay_profile import delays_of, held_at
from motor_sysid.diagnosis.search.further import RESTLESS
from motor_sysid.diagnosis.search.rung import climb, FINER, leaves_much, Rung, SPOILED
from motor_sysid.physics.model import Model
from motor_sysid.threads import in_threads

STRIDE, STRIDES = 0.25, 6
"""Length of a stride in samples, and how many are made each way."""


def walked(rung: Rung, bench: Bench) -> tuple[Rung, Bench]:
    """Return a fit that much is left of from where its delay leads lower, and its steps.

    The fit stays where nothing is lower by more than evidence takes, or where what is does the
    held-out error harm.
    """
    if not leaves_much(rung, bench, RESTLESS, beside=rung.training.residuals):
        return rung, bench
    for name in delays_of(rung.model):
        rung, bench = _walked(rung, name, bench)
    return rung, bench


def _walked(rung: Rung, name: str, bench: Bench) -> tuple[Rung, Bench]:
    finer = replace(bench, substeps=max(bench.substeps, FINER))
    weighting, p = rung.result.weighting, rung.model.parameters[name]
    stride = STRIDE * bench.train[0][0].drive.dt

    def one_way(way: int) -> list[tuple[Model, float]]:
        model, found = rung.model, []
        for k in range(1, STRIDES + 1):
            value = float(np.clip(p.value + way * k * stride, p.lower, p.upper))
            found.append(held_at(model, name, value, finer, weighting))
            model = found[-1][0]
        return found

    seen = [one for way in in_threads(one_way, (-1, 1)) for one in way]
    there, least = min(seen, key=lambda one: one[1])
    here = held_at(rung.model, name, p.value, finer, weighting)[1]
    if not least < here - bench.threshold:
        return rung, bench
    other = climb(there.with_free([name]), finer, weighting)
    better = other.held.error_percent < SPOILED * rung.held.error_percent
    return (other, finer) if better else (rung, bench)
