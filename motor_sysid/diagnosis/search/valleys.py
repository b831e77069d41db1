"""Standard errors where the sum of squares rises less around a fit than its derivatives say.

Derivatives tell how the data change within a hair of a fit.  Where a current settles far within a
sample, an inductance that a filter makes up for may be anything from nothing to ten times as
much; where a sharp sign sticks and slips, a few samples jump, and a combination of parameters
seems known that is not.  So the sum of squares is looked at as far away as the estimate may be:

    rise = xi' M xi,   move = C^(1/2) xi,   C what the derivatives say of the covariance

With right derivatives ``M`` is the identity.  Where one of its eigenvalues is less, the estimate
may be farther off along that direction: as far as the sum of squares rises by 4, two standard
errors, on the flatter side.  (Venzon and Moolgavkar 1988, doi:10.2307/2347496, for intervals from
how the error rises.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch import Linearization, Problem, Weighting
from motor_sysid.estimation.batch.least_squares import normal_equations

Array = NDArray[np.float64]

AWAY = 2.0
"""Distance in standard errors, in each of the parameters, at which the rise is looked at."""

TURNS = 2
"""How many times valleys are looked for, each time with what was found before."""

AGAIN = 1.5
"""How far one must reach, in units of what derivatives say, for another look to be worth it."""

LOOKS = 16
"""Directions, both ways of each, that tell whether there is a valley at all: one block of runs."""

AS_TOLD = 0.75
"""Least rise of these, in units of what derivatives say, from which on there is none."""

FLAT = 0.7
"""Eigenvalue of ``M`` below which a direction is looked at by itself."""

MORE = 1.2
"""How many more directions than ``M`` has numbers."""

STEEP = 2.0
"""Rise in units of what derivatives say, beyond which it counts for no more: a valley is asked
for, and it is asked of the flatter side alone."""

REACHES = np.geomspace(1.0, 64.0, 9)
"""Distances along a flat direction, in units of what derivatives say."""


@dataclass(frozen=True)
class Around:
    """The weighted sum of squares around a fit.

    What must be positive counts as known to a factor of e (one standard deviation): without that,
    what no sample shows could go anywhere, and take others along where no derivative holds.

    Attributes
    ----------
    problem, weighting, near:
        The fitted model with the data, the noise model, and derivatives there.
    """

    problem: Problem
    weighting: Weighting
    near: Sequence[Linearization]

    @cached_property
    def precision(self) -> Array:
        """(d, d) of what is believed beside the data."""
        return np.diag([1.0 if p.logarithmic else 0.0 for p in self.problem.free])

    @cached_property
    def told(self) -> tuple[Array, Array]:
        """(d,) half the fall of the cost along each parameter, and (d, d) how that bends."""
        downhill, curvature, _ = normal_equations(self.near, self.weighting)
        return downhill, curvature + self.problem.precision + self.precision

    @cached_property
    def centre(self) -> Array:
        """(d,) where the derivatives see the least cost: the fit, but for what is left to fall."""
        lower, upper = self.problem.box()
        z, root = self.problem.vector(), self.root
        there: Array = np.clip(z + root @ (root.T @ self.told[0]), lower, upper)
        return there if self._costs(there[np.newaxis])[0] < self._costs(z[np.newaxis])[0] else z

    @cached_property
    def least(self) -> float:
        """Cost at the centre."""
        return float(self._costs(self.centre[np.newaxis])[0])

    @cached_property
    def root(self) -> Array:
        """(d, d) moves of one standard error each, as the derivatives have it.

        Not a number where these overflow: then nothing is known.
        """
        known = self.told[1]
        if not np.all(np.isfinite(known)):
            return np.full(known.shape, np.nan)
        size = np.sqrt(np.maximum(np.diag(known), 1e-300))
        values, vectors = np.linalg.eigh(known / np.outer(size, size))
        moves: Array = vectors / np.sqrt(np.maximum(values, 1e-12)) / size[:, np.newaxis]
        return moves

    def rise(self, moves: Array) -> Array:
        """Return (K,) rises of the cost by (K, d) moves, on the flatter side of each."""
        rises = self._costs(self.centre + np.concatenate((moves, -moves))) - self.least
        flatter: Array = np.minimum(*np.split(np.where(np.isnan(rises), np.inf, rises), 2))
        return np.maximum(flatter, 0.0)

    def _costs(self, z: Array) -> Array:
        """Return (K,) costs at (K, d) vectors, what is believed with them."""
        away = z - self.problem.vector()
        known = np.einsum('pi,ij,pj->p', away, self.precision, away)
        inside = np.clip(z, *self.problem.box())
        costs: Array = self.problem.costs(inside, self.weighting, self.near) + known
        return costs


def less_known(around: Around) -> Array:
    """Return (d,) factors, one or more, by which standard errors grow for valleys in the cost."""
    begun = root = around.root
    if not np.all(np.isfinite(root)):
        return np.ones(len(root))
    random = np.random.default_rng(0)
    for _ in range(TURNS):
        flat = _flat_directions(around, root, random)
        if not flat.shape[1]:
            break
        reach = _reaches(around, flat.T @ root.T)
        root = root + root @ (flat * (reach - 1.0)) @ flat.T
        if np.all(reach < AGAIN):
            break
    with np.errstate(over='ignore', invalid='ignore'):  # what nothing tells of has no size
        before, after = _size(begun), _size(root)
        return np.where(np.isfinite(before), np.maximum(after / before, 1.0), 1.0)


def _flat_directions(around: Around, root: Array, random: np.random.Generator) -> Array:
    """Return (d, k) unit vectors, in standard errors, along which the cost is too flat."""
    size = len(root)
    expected = AWAY**2 * size
    looked = _directions(random, LOOKS, size) * np.sqrt(expected)
    rises = around.rise(looked @ root.T)
    if np.min(rises) > AS_TOLD * expected:
        return np.zeros((size, 0))
    numbers = size * (size + 1) // 2
    further = max(int(np.ceil(MORE * numbers / LOOKS)) - 1, 1) * LOOKS
    more = _directions(random, further, size) * np.sqrt(expected)
    looked = np.concatenate((looked, more))
    rises = np.concatenate((rises, around.rise(more @ root.T)))
    values, vectors = np.linalg.eigh(_quadratic(looked, np.minimum(rises, STEEP * expected)))
    found: Array = vectors[:, values < FLAT]
    return found


def _directions(random: np.random.Generator, count: int, size: int) -> Array:
    """Return (count, size) unit vectors."""
    drawn = random.standard_normal((count, size))
    unit: Array = drawn / np.linalg.norm(drawn, axis=1, keepdims=True)
    return unit


def _quadratic(xi: Array, rises: Array) -> Array:
    """Return the (d, d) matrix of the quadratic form nearest to (K,) rises at (K, d) places."""
    one, other = np.triu_indices(xi.shape[1])
    products = xi[:, one] * xi[:, other] * np.where(one == other, 1.0, 2.0)
    found = np.zeros((xi.shape[1], xi.shape[1]))
    found[one, other] = np.linalg.lstsq(products, rises, rcond=None)[0]
    found[other, one] = found[one, other]
    return found


def _reaches(around: Around, directions: Array) -> Array:
    """Return (k,) how much farther than (k, d) `directions` say one standard error is."""
    allowed = AWAY**2
    moves = AWAY * REACHES[:, np.newaxis] * directions[:, np.newaxis]
    rises = around.rise(moves.reshape(-1, directions.shape[1])).reshape(len(directions), -1)
    reaches = np.full(len(directions), REACHES[-1])
    for k, along in enumerate(rises):
        beyond = np.flatnonzero(along > allowed)
        if beyond.size:
            n = int(beyond[0])
            told = slice(n - 1, n + 1)
            reaches[k] = np.interp(allowed, along[told], REACHES[told]) if n else 1.0
    return reaches


def _size(root: Array) -> Array:
    """Return (d,) standard errors of the parameters."""
    size: Array = np.linalg.norm(root, axis=1)
    return size
