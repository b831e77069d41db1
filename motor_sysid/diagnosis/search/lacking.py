"""Effects whose laws follow what the equations lack, whatever simulations make of a touch of them.

Where a model runs far astray, or chatters about a sign, a touch of an effect moves the outputs in
ways that tell little of the effect.  What an equation lacks is read from the output error along
the motion, without a run of the effect; a law is worth a trial where it predicts that in blocks of
time that it was not fitted to (`motor_sysid.diagnosis.where.unknown` tells shapes in this way).
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.candidates.score import Scored
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.rung import Rung
from motor_sysid.diagnosis.where.orthogonal_rows import Rows, rows_of
from motor_sysid.diagnosis.where.unexplained import Lack, lack_of, orthogonal, share_of
from motor_sysid.diagnosis.where.unknown import LEAST_CERTAINTY, LEAST_SHARE, share_and_certainty
from motor_sysid.diagnosis.where.where import Failure
from motor_sysid.physics.effect import Amplitude, arguments
from motor_sysid.signals.noise import noise_sigmas

Array = NDArray[np.float64]

MOST = 2
"""Effects that are tried for what they follow, at most."""

NEARLY = 0.5
"""Share of what the equation lacks, in units of that of the best law, from which on another law is
tried as well."""


def following(
    rung: Rung, bench: Bench, singles: Sequence[Scored], tried: Set[str]
) -> list[list[Scored]]:
    """Return the starts of at most `MOST` effects that follow what an equation lacks, best first.

    Parameters
    ----------
    rung:
        The fitted model.
    singles:
        Scores of all variants; the starts have amplitudes of their own.
    tried:
        Keys of effects that had their turn.
    """
    lacks = _lacks(rung, bench)
    if not lacks or not lacks[0].forces:
        return []
    share = share_of(lacks)
    failure = Failure((), (), (), tuple(orthogonal(lacks, share)), share, {})
    residuals = (*rung.training.residuals, *rung.validation.residuals)
    noise = noise_sigmas(residuals, bench.differenced(rung.model))
    sigmas = dict(zip(bench.outputs, noise.tolist(), strict=True))
    rows = {one.force: one for one in rows_of(rung.model, failure, bench.records[0].dt, sigmas)}
    found: dict[str, tuple[float, Scored]] = {}
    for one in singles:
        key = one.variant.effect.key
        if key in tried:
            continue
        for part, start in _shares(one, rows, lacks, bench):
            if part > found.get(key, (0.0,))[0]:
                found[key] = part, start
    best = max((part for part, _ in found.values()), default=0.0)
    order = sorted(found.values(), key=lambda pair: -pair[0])
    return [[start] for part, start in order[:MOST] if part >= max(LEAST_SHARE, NEARLY * best)]


def _lacks(rung: Rung, bench: Bench) -> list[Lack]:
    """Return what the model lacks on each record that is reported."""
    predicted = (*rung.training.predictions, *rung.validation.predictions)
    return [
        lack_of(rung.model, record, one)
        for record, one in zip(bench.records, predicted, strict=True)
    ]


def _shares(
    one: Scored, rows: Mapping[str, Rows], lacks: Sequence[Lack], bench: Bench
) -> Iterator[tuple[float, Scored]]:
    """Yield the share that a variant predicts of what an equation lacks, with its amplitudes."""
    variant, card = one.variant, one.variant.effect.card
    names = [a.name for a in card.amplitudes]
    if card.states or card.delay or variant.inherits or not variant.model.parameters.free:
        return
    for force, law in variant.effect.laws.items():
        if force not in rows:
            continue
        parts = [_columns(one, law, lack, record) for lack, record in zip(lacks, bench.records)]
        if any(part is None for part in parts):
            continue
        here = rows[force]
        columns = here.take([part for part in parts if part is not None])
        if not np.all(np.isfinite(columns)) or not np.any(columns):
            continue
        part, certainty = share_and_certainty(here, columns)
        sizes = dict(zip(names, here.fitted(columns)[0].tolist(), strict=True))
        if certainty >= LEAST_CERTAINTY and _is_possible(card.amplitudes, sizes):
            yield part, replace(one, amplitudes=sizes, allowed=True, base={})


def _columns(one: Scored, law, lack: Lack, record) -> Array | None:
    variant = one.variant
    values, key = variant.model.parameters.values(), variant.effect.key
    dt, count = record.dt, len(record)
    known = {**values, **{p.name: values[f'{key}.{p.name}'] for p in variant.effect.card.parameters}}
    known |= {**lack.states, 't': np.arange(count) * dt}
    if 'omega' in known:
        known['turn'] = dt * known['omega']
    found = []
    for amplitude in variant.effect.card.amplitudes:
        zeros = dict.fromkeys((a.name for a in variant.effect.card.amplitudes), 0.0)
        unit = {**known, **zeros, amplitude.name: 1.0}
        if not set(arguments(law)) <= unit.keys():
            return None
        with np.errstate(all='ignore'):
            found.append(np.broadcast_to(law(*[unit[n] for n in arguments(law)]), count))
    return np.stack(found, axis=1).astype(np.float64)


def _is_possible(amplitudes: Sequence[Amplitude], sizes: Mapping[str, float]) -> bool:
    return all(sizes[a.name] > 0.0 for a in amplitudes if a.positive)
