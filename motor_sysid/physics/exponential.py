"""Matrix exponential and its two integrals for one substep of many small linear systems.

    E = exp(Ah),  phi1 = (E - 1) / Ah,  phi2 = (E - 1 - Ah) / (Ah)^2

phi2 is summed as a Taylor series of ``Z = Ah / 2^s`` with a norm below 1/4, phi1 = 1 + Z phi2 and
E = 1 + Z phi1 follow, and s doublings lead back (none of these cancels digits):

    phi2(2Z) = (phi1^2 + 2 phi2) / 4,  phi1(2Z) = (E + 1) phi1 / 2,  E(2Z) = E^2.

(Higham, Functions of Matrices, 2008, sections 10.7.4 and 10.5.)
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.native import behind, compiled, data_of, inlined, rows
from motor_sysid.physics.vector import get, put, some, spread, where, WIDTH

Array = NDArray[np.float64]

CHUNK = 3
"""The kernel sums so many products at a time."""

_DEGREE = 9
_LARGEST_NORM = 1e12


def in_vectors(matrices: Array) -> Array:
    """Return matrices (W, n, m) of lanes as (V, n, m, 8) of vectors of lanes; W is 8 V."""
    wide, n, m = matrices.shape
    by_vector = matrices.reshape(wide // WIDTH, WIDTH, n, m)
    return np.ascontiguousarray(np.moveaxis(by_vector, 1, 3), dtype=np.float64)


def step_matrices(a: Array, b: Array, g: Array, width: Array) -> tuple[Array, Array, Array]:
    """Return what the kernel multiplies in steps of several lengths.

    Parameters
    ----------
    a, b, g:
        (V, n, n, 8), (V, n, k, 8) and (V, n, m, 8) matrices by vectors of lanes.
    width:
        (S, W) lengths of the steps in s, W at least V vectors.

    Returns
    -------
    (V, S, n, K, 8) E, h phi1 B and h phi1 G side by side, filled up with zeros to a multiple of
    `CHUNK` columns; (V, S, n, m, 8) h phi1 G; and h phi2 G.  NaN in lanes whose matrix is not
    finite or so large that the motor of that lane makes no sense.
    """
    vectors, n, k, m = *b.shape[:3], g.shape[2]
    columns = -(-(n + k + m) // CHUNK) * CHUNK
    whole = np.zeros((vectors, len(width), n, columns, WIDTH))
    phi1_force, phi2_force = np.empty((2, vectors, len(width), n, m, WIDTH))
    _fill(a, b, g, width, whole, phi1_force, phi2_force)
    return whole, phi1_force, phi2_force


@compiled
def _fill(a, b, g, width, whole, phi1_force, phi2_force):  # type: ignore[no-untyped-def]
    """Write the matrices of `step_matrices`."""
    vectors, steps, n, columns = whole.shape[:4]
    k, m = b.shape[2], g.shape[2]
    z, e, p1, p2, work = rows(n * n), rows(n * n), rows(n * n), rows(n * n), rows(n * n)
    for vector in range(vectors):
        of_state = behind(data_of(a), vector * n * n * WIDTH)
        of_input = behind(data_of(b), vector * n * k * WIDTH)
        of_force = behind(data_of(g), vector * n * m * WIDTH)
        for step in range(steps):
            h = get(data_of(width), step * width.shape[1] + vector * WIDTH)
            at = vector * steps + step
            into = behind(data_of(whole), at * n * columns * WIDTH)
            norm = _scaled(n, of_state, h, z)
            sane = norm < _LARGEST_NORM
            doublings = _halve(n, z, where(sane, norm, 0.0))
            _series(n, z, p2, work)
            _one_plus_product(n, z, p2, p1)
            _one_plus_product(n, z, p1, e)
            left = doublings
            while some(left > 0.0):
                _double(n, e, p1, p2, work, left > 0.0)
                left = left - 1.0
            nothing = where(sane, 0.0, spread(np.nan))
            for i in range(n):
                for j in range(n):
                    value = get(e, (i * n + j) * WIDTH) + nothing
                    put(into, (i * columns + j) * WIDTH, value)
            h = h + nothing
            force = behind(into, (n + k) * WIDTH)
            _product(n, k, p1, of_input, h, behind(into, n * WIDTH), columns)
            _product(n, m, p1, of_force, h, force, columns)
            _product(n, m, p1, of_force, h, behind(data_of(phi1_force), at * n * m * WIDTH), m)
            _product(n, m, p2, of_force, h, behind(data_of(phi2_force), at * n * m * WIDTH), m)


@inlined
def _scaled(n, a, h, z):  # type: ignore[no-untyped-def]
    """Set `z` to h A; return its norm, which is no number where an element is none."""
    norm = spread(0.0)
    for i in range(n):
        row = spread(0.0)
        for j in range(n):
            value = get(a, (i * n + j) * WIDTH) * h
            put(z, (i * n + j) * WIDTH, value)
            row = row + abs(value)
        norm = np.maximum(norm, row)
    return norm


@inlined
def _halve(n, z, norm):  # type: ignore[no-untyped-def]
    """Halve `z` until its norm is below 1/4, in every lane; return how often."""
    doublings, scale = spread(0.0), spread(1.0)
    while some(norm > 0.25):
        large = norm > 0.25
        doublings, scale = doublings + where(large, 1.0, 0.0), where(large, 0.5 * scale, scale)
        norm = where(large, 0.5 * norm, norm)
    for i in range(n * n):
        put(z, i * WIDTH, get(z, i * WIDTH) * scale)
    return doublings


@inlined
def _series(n, z, total, work):  # type: ignore[no-untyped-def]
    """Set `total` to sum over k of z^k / (k + 2)!, by Horner's rule."""
    for i in range(n):
        for j in range(n):
            put(total, (i * n + j) * WIDTH, spread(1.0 if i == j else 0.0))
    for k in range(_DEGREE, 0, -1):
        factor = 1.0 / (k + 2)
        for i in range(n):
            for j in range(n):
                value = _sum(n, z, total, i, j, spread(0.0)) * factor
                put(work, (i * n + j) * WIDTH, value + (1.0 if i == j else 0.0))
        for i in range(n * n):
            put(total, i * WIDTH, get(work, i * WIDTH))
    for i in range(n * n):
        put(total, i * WIDTH, get(total, i * WIDTH) * 0.5)


@inlined
def _sum(n, left, right, i, j, value):  # type: ignore[no-untyped-def]
    """Return an element of a product of matrices (n, n), and a value more."""
    for m in range(n):
        value = value + get(left, (i * n + m) * WIDTH) * get(right, (m * n + j) * WIDTH)
    return value


@inlined
def _one_plus_product(n, z, p, out):  # type: ignore[no-untyped-def]
    """Set `out` to 1 + z p."""
    for i in range(n):
        for j in range(n):
            put(out, (i * n + j) * WIDTH, _sum(n, z, p, i, j, spread(1.0 if i == j else 0.0)))


@inlined
def _double(n, e, p1, p2, work, where_to):  # type: ignore[no-untyped-def]
    """Go from Z to 2Z in place, in lanes in which it is to be done."""
    for i in range(n):
        for j in range(n):
            at = (i * n + j) * WIDTH
            put(work, at, 0.25 * _sum(n, p1, p1, i, j, 2.0 * get(p2, at)))
    _take(n, work, p2, where_to)
    for i in range(n):
        for j in range(n):
            at = (i * n + j) * WIDTH
            put(work, at, 0.5 * _sum(n, e, p1, i, j, get(p1, at)))
    _take(n, work, p1, where_to)
    for i in range(n):
        for j in range(n):
            put(work, (i * n + j) * WIDTH, _sum(n, e, e, i, j, spread(0.0)))
    _take(n, work, e, where_to)


@inlined
def _take(n, fresh, values, where_to):  # type: ignore[no-untyped-def]
    """Copy a matrix to another one in some lanes."""
    for i in range(n * n):
        put(values, i * WIDTH, where(where_to, get(fresh, i * WIDTH), get(values, i * WIDTH)))


@inlined
def _product(n, count, p, right, h, out, columns):  # type: ignore[no-untyped-def]
    """Set the first `count` of the `columns` of `out` to h p right."""
    for i in range(n):
        for j in range(count):
            value = spread(0.0)
            for m in range(n):
                value = value + get(p, (i * n + m) * WIDTH) * get(right, (m * count + j) * WIDTH)
            put(out, (i * columns + j) * WIDTH, h * value)
