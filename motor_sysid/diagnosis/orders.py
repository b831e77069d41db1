"""How many waves per turn: a matched filter for every order, on the fitted model.

A force that is a wave over the rotor angle is pushed through the model along its own trajectory,
sine and cosine of every order, and the residual is regressed on what comes out, after whitening
and beside the base parameters.  So an order is judged by what it explains of the outputs, fast
and slow parts of a record each with the weight that they deserve; a spectrum of the unexplained
torque sees only what its differentiation leaves.
"""

from collections.abc import Sequence
import inspect

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.columns import judged_runs, Path, paths_of
from motor_sysid.diagnosis.residual import surroundings
from motor_sysid.estimation.batch import coloured, Linearization, Problem, white
from motor_sysid.estimation.batch.weighting import Weighting
from motor_sysid.physics.effect import Effect

Array = NDArray[np.float64]

TOP_ORDER = 400
_AT_ONCE = 31
"""Orders in one run: their sines and cosines fill two blocks of the kernel."""

_NOISE_ORDER = 12
_BESIDE = 12
_TOUCH = 1e-3


def likely_orders(
    problem: Problem, one: Effect, count: int = 5, *, contrast: float = 0.0
) -> tuple[int, ...]:
    """Return the waves per turn at which an effect would explain most, best first.

    Parameters
    ----------
    problem:
        The fitted model and data; where the rotor angle is not measured, nothing is found.
    one:
        The effect; its first two amplitudes are those of cosine and sine.
    count:
        Most that are returned.
    contrast:
        Least ratio of what an order explains to what its neighbours do (their median).
    """
    gains = wave_gains(problem, one)
    background = surroundings(gains, _BESIDE)
    padded = np.concatenate(([0.0], gains[1:], [0.0]))
    peaks = (gains >= padded[:-1]) & (gains >= padded[1:]) & (gains > contrast * background)
    peaks[0] = False
    peaks &= gains > 0.0
    best = [n for n in np.argsort(-gains).tolist() if peaks[n]]
    return tuple(best[:count])


def wave_gains(problem: Problem, one: Effect) -> Array:
    """Return (`TOP_ORDER` + 1,) the decrease of the whitened sum of squares by each order."""
    gains = np.zeros(TOP_ORDER + 1)
    turning = [s.drive.position for s in problem.stretches]
    if any(angle.size == 0 for angle in turning):
        return gains
    if sum(float(np.ptp(angle)) for angle in turning) < 2 * np.pi:
        return gains
    near = problem.linearize(problem.vector())
    weighting = _noise(near)
    basis, left = _without_base(near, weighting)
    paths = paths_of(problem)
    lower = next(s.lower for s in one.card.shapes if s.name == one.card.orders)
    orders = np.arange(max(round(lower), 1), TOP_ORDER + 1)
    for first in range(0, orders.size, _AT_ONCE):
        some = orders[first : first + _AT_ONCE]
        flat = _pushed(problem, one, some, paths, weighting)
        gains[some] = _explained(flat, basis.T @ flat, flat.T @ left)
    return gains


def _noise(near: Sequence[Linearization]) -> Weighting:
    """Return the noise model of what base parameters leave."""
    flat = white([one.residual for one in near])
    slope = np.concatenate([flat.flat(one.slope) for one in near])
    error = np.concatenate([flat.flat(one.residual[:, :, np.newaxis]) for one in near])[:, 0]
    change = np.linalg.lstsq(slope, error, rcond=1e-10)[0]
    return coloured([one.residual - one.slope @ change for one in near], _NOISE_ORDER)


def _without_base(near: Sequence[Linearization], weighting: Weighting) -> tuple[Array, Array]:
    """Return a basis (K, d) of what base parameters do, and the residual (K,) without it."""
    slope = np.concatenate([weighting.flat(one.slope) for one in near])
    error = np.concatenate([weighting.flat(one.residual[:, :, np.newaxis]) for one in near])[:, 0]
    basis = np.linalg.qr(slope / (np.linalg.norm(slope, axis=0) + 1e-300))[0]
    return basis, error - basis @ (basis.T @ error)


def _pushed(
    problem: Problem,
    one: Effect,
    orders: NDArray[np.int64],
    paths: Sequence[tuple[Path, Path]],
    weighting: Weighting,
) -> Array:
    """Return (K, 2 P) what cosine and sine of P orders do to the outputs, whitened."""
    forces = [force.name for force in problem.model.kind.forces]
    lanes = 2 * orders.size + 1
    size = _TOUCH * problem.model['k_t'] if 'k_t' in problem.program.names else _TOUCH
    pushes = {}
    for number, (path, _) in enumerate(paths):
        push = np.zeros((len(path['t']), 2, len(forces), lanes))
        for j, force in enumerate(forces):
            if force in one.laws:
                for k in range(2):
                    at = slice(1 + k * orders.size, 1 + (k + 1) * orders.size)
                    push[:, 0, j, at] = _waves(problem, one, force, k, size, orders, path)
        push[:-1, 1], push[-1, 1] = push[1:, 0], push[-1, 0]
        pushes[number] = push
    values = problem.model.parameters.values()
    table = {name: np.full(lanes, values[name]) for name in problem.program.names}
    runs = judged_runs(problem.program, problem, table, pushes)
    return np.concatenate(
        [weighting.flat((run[:, :, 1:] - run[:, :, :1]) / size) for run in runs]
    )


def _waves(
    problem: Problem,
    one: Effect,
    force: str,
    which: int,
    size: float,
    orders: NDArray[np.int64],
    path: Path,
) -> Array:
    """Return (N, P) the law with one of its first two amplitudes at `size`."""
    known: dict[str, object] = dict(problem.model.parameters.values())
    known.update({name: values[:, np.newaxis] for name, values in path.items()})
    known.update({a.name: 0.0 for a in one.card.amplitudes})
    known[one.card.amplitudes[which].name] = size
    known[one.card.orders] = orders.astype(float)[np.newaxis, :]
    law = one.laws[force]
    found: Array = np.asarray(law(*[known[n] for n in inspect.signature(law).parameters]))
    return found


def _explained(flat: Array, shared: Array, along: Array) -> Array:
    """Return (P,) what cosine and sine of each of P orders explain together.

    Parameters
    ----------
    flat:
        (K, 2 P) their columns, cosines first.
    shared, along:
        (d, 2 P) products with the basis of what base parameters do, (2 P,) with the residual.
    """
    half = flat.shape[1] // 2
    cosine, sine = slice(0, half), slice(half, None)
    cc, ss, cs = (
        np.einsum('tk,tk->k', flat[:, a], flat[:, b])
        - np.einsum('dk,dk->k', shared[:, a], shared[:, b])
        for a, b in ((cosine, cosine), (sine, sine), (cosine, sine))
    )
    c, s = along[cosine], along[sine]
    scale = cc * ss
    volume = scale - cs**2
    gain = (ss * c**2 - 2 * cs * c * s + cc * s**2) / np.maximum(volume, 1e-300)
    alone = np.maximum(c**2 / np.maximum(cc, 1e-300), s**2 / np.maximum(ss, 1e-300))
    found: Array = np.where(volume > 1e-6 * scale, gain, alone)
    return np.nan_to_num(found, nan=0.0, posinf=0.0)
