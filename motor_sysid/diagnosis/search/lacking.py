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

from motor_sysid.diagnosis.candidates.columns import law_along, Touch
from motor_sysid.diagnosis.candidates.score import Scored
from motor_sysid.diagnosis.candidates.variants import Variant
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.rung import Rung
from motor_sysid.diagnosis.where.orthogonal_rows import Rows, rows_of
from motor_sysid.diagnosis.where.unexplained import Lack, lack_of, orthogonal, share_of
from motor_sysid.diagnosis.where.unknown import LEAST_CERTAINTY, LEAST_SHARE, share_and_certainty
from motor_sysid.physics.effect import arguments
from motor_sysid.signals.noise import noise_sigmas
from motor_sysid.signals.record import Record

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
        Scores of all variants; the starts have amplitudes of their own, and those of the score.
    tried:
        Keys of effects that had their turn.
    """
    raw = _lacks(rung, bench)
    if not raw or not raw[0].forces:
        return []
    share = share_of(raw)
    lacks = orthogonal(raw, share)
    residuals = (*rung.training.residuals, *rung.validation.residuals)
    noise = noise_sigmas(residuals, bench.differenced(rung.model))
    sigmas = dict(zip(bench.outputs, noise.tolist(), strict=True))
    dt = bench.records[0].dt
    rows = {one.force: one for one in rows_of(rung.model, lacks, share, dt, sigmas)}
    found: dict[str, tuple[float, Scored, Scored]] = {}
    for one in singles:
        key = one.variant.effect.key
        if key in tried:
            continue
        for part, start in _starts(one, rows, lacks, bench.records):
            if part > found.get(key, (0.0,))[0]:
                found[key] = part, start, one
    best = max((part for part, *_ in found.values()), default=0.0)
    order = sorted(found.values(), key=lambda each: -each[0])
    chosen = [pair for share, *pair in order[:MOST] if share >= max(LEAST_SHARE, NEARLY * best)]
    return [[start, one] if one.allowed else [start] for start, one in chosen]


def _lacks(rung: Rung, bench: Bench) -> list[Lack]:
    """Return what the model lacks on each record that is reported."""
    predicted = (*rung.training.predictions, *rung.validation.predictions)
    pairs = zip(bench.records, predicted, strict=True)
    return [lack_of(rung.model, record, one) for record, one in pairs]


def _starts(
    one: Scored, rows: Mapping[str, Rows], lacks: Sequence[Lack], records: Sequence[Record]
) -> Iterator[tuple[float, Scored]]:
    """Yield which share a variant predicts of what an equation lacks, with its amplitudes there.

    Laws with a memory, and those that replace one of the model, have no such columns.
    """
    variant, card = one.variant, one.variant.effect.card
    if card.states or card.delay or variant.inherits or not variant.model.parameters.free:
        return
    for force in (name for name in rows if name in variant.effect.laws):
        pairs = zip(lacks, records, strict=True)
        parts = [_columns(variant, force, lack, record) for lack, record in pairs]
        if not all(part.size for part in parts):
            continue
        columns = rows[force].take(parts)
        if not np.any(columns):
            continue
        share, certainty = share_and_certainty(rows[force], columns)
        fitted = rows[force].fitted(columns)[0].tolist()
        sizes = dict(zip((a.name for a in card.amplitudes), fitted, strict=True))
        possible = all(sizes[a.name] > 0.0 for a in card.amplitudes if a.positive)
        if certainty >= LEAST_CERTAINTY and possible:
            yield share, replace(one, amplitudes=sizes, allowed=True)


def _columns(variant: Variant, force: str, lack: Lack, record: Record) -> Array:
    """Return (N, a) what one of each amplitude adds to a force; none where that is not known."""
    path: dict[str, Array] = {**lack.states, 't': record.clock}
    if 'omega' in path:
        path['turn'] = np.asarray(record.dt * path['omega'], dtype=np.float64)
    known = {*path, *variant.model.parameters.values()}
    known |= {p.name for p in variant.effect.card.parameters}
    if not known >= {*arguments(variant.effect.laws[force])}:
        return np.empty((0, 0))
    names = [f'{variant.effect.key}.{a.name}' for a in variant.effect.card.amplitudes]
    with np.errstate(all='ignore'):
        still = law_along(Touch(variant, names[0], 0.0), force, path)
        found = [law_along(Touch(variant, name, 1.0), force, path) - still for name in names]
    columns = np.stack(found, axis=1)
    return columns if np.all(np.isfinite(columns)) else np.empty((0, 0))
