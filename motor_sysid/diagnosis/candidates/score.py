"""Score every candidate effect at once, without refitting: which explains what is left.

For every candidate the model is simulated with a touch of the effect; the change of its outputs is
a regressor free of measurement noise.  The residual is regressed on it beside the sensitivities of
all base parameters, after whitening with a noise model that is fitted to what the *whole*
dictionary leaves: fitted to the residual itself, the noise model would swallow the effect.
(Rao 1948 for score tests; Cochrane and Orcutt 1949 for whitening.)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.candidates.columns import columns
from motor_sysid.diagnosis.candidates.left_noise import left_noise
from motor_sysid.diagnosis.candidates.variants import Variant
from motor_sysid.estimation.batch.problem import Linearization, Problem
from motor_sysid.estimation.batch.weighting import Weighting, white
from motor_sysid.physics.effect import Effect

Array = NDArray[np.float64]

EACH, PAIRS = 3, 6
"""Variants of each effect that are paired with others; pairs of effects that are told."""

BEYOND = 1e-3
"""Part of a column that base parameters cannot mimic below which it counts as nothing."""

FURTHEST = 1.0
"""Largest change of a coordinate of the base parameters that a regression is trusted with."""

SAME = 1e-6
"""Difference of two effects' columns, squared, below which they count as the same."""

SEEN = 1e-12
"""Eigenvalue of the scaled products of base columns below which a combination is not there."""


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
    base:
        Values of the model's free parameters that the regression proposes beside them.
    """

    variant: Variant
    gain: float
    delta_bic: float
    amplitudes: Mapping[str, float]
    allowed: bool
    overlap: float
    base: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Scores:
    """What scoring finds.

    Attributes
    ----------
    singles:
        Variants, best first.
    pairs:
        The best pairs of two effects that have nothing to do with each other, best first, each in
        its best variants and with the amplitudes that the two have together.
    weighting:
        The noise model that the whole dictionary leaves.
    """

    singles: list[Scored]
    pairs: list[tuple[Scored, Scored]]
    weighting: Weighting


def score(
    problem: Problem,
    z: Array,
    tried: Sequence[Variant],
    near: Sequence[Linearization] = (),
    *,
    whitened: bool = True,
) -> Scores:
    """Score variants on a fitted model.

    Parameters
    ----------
    problem, z:
        The fitted model's problem and solution.
    tried:
        Variants to score.
    near:
        Residuals and derivatives of the fitted model, if they are known.
    whitened:
        Whether the noise model is fitted to what the dictionary leaves; else errors count as they
        are, each output's in units of its size.
    """
    near = near or problem.linearize(z)
    added = columns(problem, tried)
    raw = [
        np.concatenate(
            [one.residual[:, :, np.newaxis], one.slope, *[c[k] for c in added]], axis=2
        )
        for k, one in enumerate(near)
    ]
    starts = [one.start for one in near]
    weighting = white([one.residual for one in near])
    weighting = white([Problem.settled(one, weighting) for one in near])
    if whitened:
        weighting = left_noise(problem, raw, starts, weighting)
    first, rows = 1 + problem.dimension, sum(weighting.rows(len(part)) for part in raw)
    count = round(rows * float(np.mean(problem.fresh)))
    whole = weighting.gram(raw, starts)
    base = Base.of(whole, np.arange(1, first))
    left = base.without(whole)
    scored, parts = [], []
    family = {v.effect.key: sum(o.effect.key == v.effect.key for o in tried) for v in tried}
    for variant, column in zip(tried, added, strict=True):
        own = slice(first, first + column[0].shape[2])
        first = own.stop
        part = _Part.of(own, whole, left)
        one = _score(variant, whole[own, own], part, count, family)
        scored.append(replace(one, base=_beside(one, base.beside(own, _moved(one)), problem, z)))
        parts.append(part)
    found = best_pairs(scored, parts, left)
    scored.sort(key=lambda s: -s.delta_bic)
    return Scores(scored, found, weighting)


@dataclass(frozen=True)
class Base:
    """What base parameters can do.

    Attributes
    ----------
    back:
        (d, m) from coordinates in an orthonormal basis of that to the parameters.
    along:
        (m, 1 + K) coordinates of all columns in that basis, residual first.
    """

    back: Array
    along: Array

    @classmethod
    def of(cls, gram: Array, base: NDArray[np.int64]) -> 'Base':
        """Take the columns `base` of the (K, K) products of columns for what parameters do."""
        size = np.sqrt(np.maximum(np.diag(gram)[base], 1e-300))
        values, vectors = np.linalg.eigh(gram[np.ix_(base, base)] / np.outer(size, size))
        kept = values > SEEN * np.max(values, initial=1e-300)
        back = (vectors[:, kept] / np.sqrt(values[kept])) / size[:, np.newaxis]
        return cls(back, back.T @ gram[base])

    def without(self, gram: Array) -> Array:
        """Return the products of all columns after what base parameters can do is taken out."""
        rest: Array = gram - self.along.T @ self.along
        return rest

    def beside(self, own: slice, moved: Array) -> Array:
        """Return (d,) the best changes of base parameters beside given changes of amplitudes."""
        change: Array = self.back @ (self.along[:, 0] - self.along[:, own] @ moved)
        return change


def _moved(one: Scored) -> Array:
    """Return (a,) the changes of a variant's amplitudes; 1 for a finite trial."""
    free = one.variant.model.parameters.free
    if not free:
        return np.ones(1)
    return np.array([one.amplitudes[p.name.split('.', 1)[1]] - p.value for p in free])


def _beside(one: Scored, change: Array, problem: Problem, z: Array) -> dict[str, float]:
    """Return the values of base parameters after a change of z, held back where that is large."""
    if one.variant.effect.card.shrinks:
        return {}
    reach = np.minimum(problem.reach(), FURTHEST)
    values = problem.values((z + np.clip(change, -reach, reach))[np.newaxis, :])
    return {p.name: float(values[p.name][0]) for p in problem.free}


@dataclass(frozen=True)
class _Part:
    """What a variant can do that base parameters cannot.

    Attributes
    ----------
    own:
        Its columns.
    back:
        (a, m) from coordinates in an orthonormal basis of that to the variant's amplitudes.
    along:
        (m,) coordinates of the residual in that basis.
    """

    own: slice
    back: Array
    along: Array

    @classmethod
    def of(cls, own: slice, whole: Array, left: Array) -> '_Part':
        size = np.sqrt(np.maximum(np.diag(whole)[own], 0.0))
        size[size == 0] = 1.0
        values, vectors = np.linalg.eigh(left[own, own] / np.outer(size, size))
        kept = values > BEYOND**2
        back = (vectors[:, kept] / np.sqrt(values[kept])) / size[:, np.newaxis]
        return cls(own, back, back.T @ left[own, 0])


def _score(
    variant: Variant, whole: Array, part: _Part, count: int, family: Mapping[str, int]
) -> Scored:
    along = part.along
    gain = float(np.sum(along**2))
    solution = part.back @ along
    names = [p.name for p in variant.model.parameters.free]
    amplitudes, allowed = _amplitudes(variant, names, solution)
    price = along.size * np.log(count) + 2 * np.log(family[variant.effect.key])
    length = float(np.linalg.norm(along))
    size = float(np.sqrt(max(float(solution @ whole @ solution), 0.0)))
    return Scored(
        variant,
        gain,
        gain - float(price),
        amplitudes,
        allowed,
        1.0 - min(length / size, 1.0) ** 2 if size > 0 else 1.0,
    )


def best_pairs(
    scored: Sequence[Scored], parts: Sequence[_Part], left: Array
) -> list[tuple[Scored, Scored]]:
    """Return the pairs that explain most together, best first.

    `left` holds the products of all columns, residual first, without what base parameters can do.
    Of each effect the three best variants are looked at.  What two effects explain together cannot
    be told from what each explains alone: a third one may look better than both.
    """
    order = sorted(range(len(scored)), key=lambda k: -scored[k].delta_bic)
    taken: dict[str, int] = {}
    chosen = []
    for k in order:
        key = scored[k].variant.effect.key
        taken[key] = taken.get(key, 0) + 1
        if taken[key] <= EACH and parts[k].along.size:
            chosen.append(k)
    effects = [scored[k].variant.effect for k in chosen]
    places = combinations(range(len(chosen)), 2)
    may = np.array([(n, m) for n, m in places if not _related(effects[n], effects[m])], dtype=int)
    if not may.size:
        return []
    both, gains = _together([parts[k] for k in chosen], may, left)
    price = np.array([scored[k].gain - scored[k].delta_bic for k in chosen])
    pairs: dict[frozenset[str], tuple[Scored, Scored]] = {}
    for n in np.argsort(price[may].sum(axis=1) - gains):
        first, second = (
            _with_amplitudes(
                scored[chosen[place]], parts[chosen[place]].back @ own, float(gains[n])
            )
            for place, own in zip(may[n], both[n], strict=True)
        )
        keys = frozenset((first.variant.effect.key, second.variant.effect.key))
        if first.allowed and second.allowed:
            pairs.setdefault(keys, (first, second))
        if len(pairs) == PAIRS:
            break
    return list(pairs.values())


def _together(
    parts: Sequence[_Part], pairs: NDArray[np.int64], left: Array
) -> tuple[list[tuple[Array, Array]], Array]:
    """Return the coordinates that the parts of each pair have together, and what they gain.

    All (P, 2) pairs are solved at once, in as many coordinates as the widest part has.
    """
    sizes = [part.along.size for part in parts]
    width = max(sizes)
    back, along = np.zeros((len(left), len(parts), width)), np.zeros((len(parts), width))
    for n, part in enumerate(parts):
        back[part.own, n, : sizes[n]] = part.back
        along[n, : sizes[n]] = part.along
    flat = back.reshape(len(left), -1)
    products = (flat.T @ left @ flat).reshape(len(parts), width, len(parts), width)
    one, other = pairs.T
    gram = np.tile((1.0 + SAME) * np.eye(2 * width), (len(pairs), 1, 1))
    gram[:, :width, width:] = products[one, :, other]
    gram[:, width:, :width] = products[other, :, one]
    sides = np.concatenate((along[one], along[other]), axis=1)
    both = np.linalg.solve(gram, sides[:, :, np.newaxis])[:, :, 0]
    split = [
        (row[: sizes[n]], row[width : width + sizes[m]])
        for row, (n, m) in zip(both, pairs, strict=True)
    ]
    return split, np.sum(both * sides, axis=1)


def _related(one: Effect, other: Effect) -> bool:
    """Whether two variants are of one effect, or of two of which one replaces the other."""
    families = [{e.key, *e.card.replaces} for e in (one, other)]
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
