"""What genetic algorithms do to their members: choose, cross, mutate.

Simulated binary crossover (Deb and Agrawal 1995, Complex Systems 9, 115-148) and polynomial
mutation (Deb and Goyal 1996, Computer Science and Informatics 26, 30-45).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_CROSS_INDEX, _MUTATE_INDEX = 10.0, 20.0


def tournament(order: NDArray[np.intp], rng: np.random.Generator) -> NDArray[np.intp]:
    """Return (P,) winners of duels; `order` (P,) is the rank of each member, 0 the best."""
    pairs = rng.integers(order.size, size=(2, order.size))
    first_wins = order[pairs[0]] <= order[pairs[1]]
    winners: NDArray[np.intp] = np.where(first_wins, pairs[0], pairs[1])
    return winners


def crossed(parents: Array, rate: float, rng: np.random.Generator) -> Array:
    """Return (P, d) children of neighbours in (P, d) parents; P even or the last one stays."""
    children, half = parents.copy(), len(parents) // 2
    a, b = parents[0 : 2 * half : 2], parents[1 : 2 * half : 2]
    u = rng.random(a.shape)
    power = 1.0 / (_CROSS_INDEX + 1.0)
    beta = np.where(u <= 0.5, (2 * u) ** power, (2 * (1 - u)) ** -power)
    swap = rng.random(a.shape) < 0.5
    mate = rng.random((half, 1)) < rate
    other = np.where(rng.random(a.shape) < 0.5, -1.0, 1.0)  # which child is near which parent
    spread = np.where(mate & swap, other * beta, 1.0) * 0.5 * (a - b)
    middle = 0.5 * (a + b)
    children[0 : 2 * half : 2], children[1 : 2 * half : 2] = middle + spread, middle - spread
    return children


def mutated(members: Array, rate: float, rng: np.random.Generator) -> Array:
    """Return (P, d) members of the cube, each coordinate moved with the given probability."""
    u = rng.random(members.shape)
    power = 1.0 / (_MUTATE_INDEX + 1.0)
    step = np.where(u < 0.5, (2 * u) ** power - 1.0, 1.0 - (2 * (1 - u)) ** power)
    hit = rng.random(members.shape) < rate
    return members + np.where(hit, 2.0 * step, 0.0)
