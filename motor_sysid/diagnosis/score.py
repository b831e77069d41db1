"""Score every candidate effect at once, without refitting: which explains what is left.

For every candidate the model is simulated with a touch of the effect; the change of its outputs is
a regressor free of measurement noise.  The residual is regressed on it beside the sensitivities of
all base parameters, after whitening with a noise model that is fitted to what the *whole*
dictionary leaves: fitted to the residual itself, the noise model would swallow the effect.
(Rao 1948 for score tests; Cochrane and Orcutt 1949 for whitening.)
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.problem import Linearization, Problem
from motor_sysid.estimation.batch.weighting import coloured, Weighting, white
from motor_sysid.physics.effect import Amplitude, Effect, Shape
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import Scales

Array = NDArray[np.float64]

PASSES = 3
AR_ORDER = 12
EACH, PAIRS = 3, 3
"""Variants of each effect that are paired with others; pairs that are told."""


@dataclass(frozen=True)
class Variant:
    """An effect with its shape chosen, ready to be tried on a model.

    Attributes
    ----------
    effect:
        The effect.
    values:
        Shapes, and the amplitude where a finite trial is made of it.
    model:
        The model with the effect, in which only the effect's amplitudes are free (none, for a
        finite trial).
    inherits:
        Whether it replaces an effect of the model.
    """

    effect: Effect
    values: Mapping[str, float]
    model: Model
    inherits: bool


@dataclass(frozen=True)
class Scored:
    """A variant with what it explains.

    Attributes
    ----------
    variant:
        What was tried.
    gain:
        Decrease of the whitened sum of squares.
    delta_bic:
        That, less the price of the parameters and of the choice among variants.
    amplitudes:
        Amplitudes that the regression proposes.
    allowed:
        Whether their signs are physically possible.
    overlap:
        Share of the variant's effect that base parameters could mimic, 0 to 1.
    """

    variant: Variant
    gain: float
    delta_bic: float
    amplitudes: Mapping[str, float]
    allowed: bool
    overlap: float


@dataclass(frozen=True)
class Scores:
    """What scoring finds.

    Attributes
    ----------
    singles:
        Variants, best first.
    pairs:
        The best pairs of variants of two effects that have nothing to do with each other, best
        first, each with the amplitudes that the two have together.
    weighting:
        The noise model that the whole dictionary leaves.
    """

    singles: list[Scored]
    pairs: list[tuple[Scored, Scored]]
    weighting: Weighting


def variants(
    model: Model,
    scales: Scales,
    effects: Sequence[Effect],
    proposed: Mapping[str, Sequence[float]],
) -> Iterator[Variant]:
    """Give every effect that can be added to the fitted model, once for each choice of its shape.

    `proposed` gives, by key, values worth trying for shapes that the data are searched for; see
    `motor_sysid.diagnosis.proposals`.  Effects that a free parameter of the motor covers are left
    out.
    """
    frozen = model.with_free([p.name for p in model.parameters.free], free=False)
    for one in effects:
        if one.key in model.effects or not model.admits(one):
            continue
        if any(one.key in effect(key).card.generalises for key in model.effects):
            continue
        if any(p.name == one.card.covers for p in model.parameters.free):
            continue
        inherits = any(special in model.effects for special in one.card.generalises)
        for values in _choices(one, scales, proposed.get(one.key, ())):
            tried = frozen.with_effect(one.key, values, scales)
            fixed = [f'{one.key}.{name}' for name in values]
            yield Variant(one, values, tried.with_free(fixed, free=False), inherits)


def _choices(
    one: Effect, scales: Scales, proposed: Sequence[float]
) -> Iterator[dict[str, float]]:
    grids: list[list[tuple[str, float]]] = []
    for card in one.card.parameters:
        size = scales.size(card.scale)
        if isinstance(card, Amplitude):
            if card.trials:
                grids.append([(card.name, t * size) for t in card.trials])
        elif card.name in (one.card.orders, one.card.moment, one.card.frequency):
            grids.append([(card.name, float(value)) for value in proposed])
        elif isinstance(card, Shape):
            grids.append([(card.name, s * size) for s in card.starts])
    for choice in product(*grids):
        yield dict(choice)


def score(problem: Problem, z: Array, tried: Sequence[Variant]) -> Scores:
    """Score variants on a fitted model.

    Parameters
    ----------
    problem, z:
        The fitted model's problem and solution.
    tried:
        Variants to score.

    """
    near = problem.linearize(z)
    columns = [_columns(problem, near, variant) for variant in tried]
    weighting = white([one.residual for one in near])
    for _ in range(PASSES):
        weighting = _whitened(near, columns, weighting)
    flat = [
        weighting.removed(
            np.concatenate(
                [one.residual[:, :, np.newaxis], one.slope, *[c[k] for c in columns]], axis=2
            ),
            one.start,
        )
        for k, one in enumerate(near)
    ]
    joined = np.concatenate(flat)
    residual, base, dictionary = np.split(joined, [1, 1 + problem.dimension], axis=1)
    q, _ = np.linalg.qr(base)
    residual = (residual - q @ (q.T @ residual))[:, 0]
    scored, parts, first = [], [], 0
    family = {v.effect.key: sum(o.effect.key == v.effect.key for o in tried) for v in tried}
    for variant, column in zip(tried, columns, strict=True):
        width = column[0].shape[2]
        raw = dictionary[:, first : first + width]
        first += width
        part = _Part.of(raw, raw - q @ (q.T @ raw))
        scored.append(_score(variant, raw, part, residual, family))
        parts.append(part)
    found = best_pairs(scored, parts, residual)
    scored.sort(key=lambda s: -s.delta_bic)
    return Scores(scored, found, weighting)


def _columns(
    problem: Problem, near: Sequence[Linearization], variant: Variant
) -> list[Array]:
    """Return for each stretch the changes of the outputs that the variant makes, (N, n_y, a)."""
    side = Problem(
        variant.model,
        problem.chains,
        problem.outputs,
        substeps=problem.substeps,
        threads=problem.threads,
    )
    if side.dimension == 0:
        runs = side.simulate(np.empty((1, 0)))
        if not all(np.all(np.isfinite(run)) for run in runs):
            return [np.zeros_like(run) for run in runs]
        return [
            run - (stretch.judged - one.residual)[:, :, np.newaxis]
            for run, stretch, one in zip(runs, problem.stretches, near, strict=True)
        ]
    return [one.slope / side.size for one in side.linearize(side.vector())]


def _whitened(
    near: Sequence[Linearization], columns: Sequence[Sequence[Array]], weighting: Weighting
) -> Weighting:
    """Fit the noise model to what base parameters and the whole dictionary leave."""
    rows, raw = [], []
    for k, one in enumerate(near):
        everything = [one.residual[:, :, np.newaxis], one.slope, *[c[k] for c in columns]]
        raw.append(np.concatenate(everything, axis=2))
        rows.append(weighting.removed(raw[-1], one.start))
    stacked = np.concatenate(rows)
    scale = np.linalg.norm(stacked, axis=0)
    scale[scale == 0] = 1.0
    scaled = stacked / scale
    gram = scaled[:, 1:].T @ scaled[:, 1:]
    coefficients = np.linalg.lstsq(gram, scaled[:, 1:].T @ scaled[:, 0], rcond=1e-8)[0]
    coefficients = coefficients * scale[0] / scale[1:]
    left = [part[:, :, 0] - part[:, :, 1:] @ coefficients for part in raw]
    return coloured(left, AR_ORDER)


@dataclass(frozen=True)
class _Part:
    """What a variant can do that base parameters cannot.

    Attributes
    ----------
    basis:
        (N, m) orthonormal.
    back:
        (a, m) from coordinates in that basis to the variant's amplitudes.
    """

    basis: Array
    back: Array

    @classmethod
    def of(cls, raw: Array, beyond: Array) -> '_Part':
        size = np.linalg.norm(raw, axis=0)
        size[size == 0] = 1.0
        u, s, vt = np.linalg.svd(beyond / size, full_matrices=False)
        kept = s > 1e-3
        return cls(u[:, kept], (vt[kept].T / s[kept]) / size[:, np.newaxis])


def _score(
    variant: Variant, raw: Array, part: _Part, residual: Array, family: Mapping[str, int]
) -> Scored:
    along = part.basis.T @ residual
    gain = float(np.sum(along**2))
    solution = part.back @ along
    names = [p.name for p in variant.model.parameters.free]
    amplitudes, allowed = _amplitudes(variant, names, solution)
    price = along.size * np.log(residual.size) + 2 * np.log(family[variant.effect.key])
    length = float(np.linalg.norm(along))
    whole = float(np.linalg.norm(raw @ solution))
    return Scored(
        variant,
        gain,
        gain - float(price),
        amplitudes,
        allowed,
        1.0 - min(length / whole, 1.0) ** 2 if whole > 0 else 1.0,
    )


def best_pairs(
    scored: Sequence[Scored], parts: Sequence[_Part], residual: Array
) -> list[tuple[Scored, Scored]]:
    """Return the pairs that explain most together, best first.

    Of each effect the three best variants are looked at.  What two effects explain together cannot
    be told from what each explains alone: a third one may look better than both.
    """
    order = sorted(range(len(scored)), key=lambda k: -scored[k].delta_bic)
    taken: dict[str, int] = {}
    chosen = []
    for k in order:
        key = scored[k].variant.effect.key
        taken[key] = taken.get(key, 0) + 1
        if taken[key] <= EACH and parts[k].basis.shape[1]:
            chosen.append(k)
    found = []
    for k, m in combinations(chosen, 2):
        if _related(scored[k].variant.effect, scored[m].variant.effect):
            continue
        a, b = parts[k].basis, parts[m].basis
        along_a, along_b, cross = a.T @ residual, b.T @ residual, a.T @ b
        width = along_a.size
        gram = np.eye(width + along_b.size)
        gram[:width, width:], gram[width:, :width] = cross, cross.T
        along = np.concatenate((along_a, along_b))
        both = np.linalg.lstsq(gram, along, rcond=1e-6)[0]
        gain = float(both @ along)
        pair = _with_amplitudes(scored[k], parts[k].back @ both[:width], gain), _with_amplitudes(
            scored[m], parts[m].back @ both[width:], gain
        )
        if all(one.allowed for one in pair):
            price = sum(s.gain - s.delta_bic for s in (scored[k], scored[m]))
            found.append((gain - price, pair))
    found.sort(key=lambda one: -one[0])
    return [pair for _, pair in found[:PAIRS]]


def _related(one: Effect, other: Effect) -> bool:
    """Whether two variants are of one effect, or of one and what generalises it."""
    families = [{e.key, *e.card.generalises} for e in (one, other)]
    return bool(families[0] & families[1])


def _with_amplitudes(one: Scored, solution: Array, gain: float) -> Scored:
    names = [p.name for p in one.variant.model.parameters.free]
    amplitudes, allowed = _amplitudes(one.variant, names, solution)
    return replace(one, amplitudes=amplitudes, allowed=allowed, gain=gain)


def _amplitudes(
    variant: Variant, names: Sequence[str], solution: Array
) -> tuple[dict[str, float], bool]:
    """Turn regression coefficients into parameter values inside their boxes."""
    if not names:
        return {}, bool(solution[0] > 0)
    values, allowed = {}, True
    for name, change in zip(names, solution, strict=True):
        p = variant.model.parameters[name]
        proposed = p.value + float(change)
        allowed = allowed and proposed >= p.lower - 1e-12
        values[name.split('.', 1)[1]] = float(np.clip(proposed, p.lower, p.upper))
    return values, allowed
