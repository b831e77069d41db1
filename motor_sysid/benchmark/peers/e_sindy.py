"""PySINDy's ensemble of sparse regressions on the equation errors.

E-SINDy (Fasel, Kutz, Brunton and Brunton 2022, doi:10.1098/rspa.2021.0904): sequentially
thresholded least squares over bags of rows; a term is named if it survives in most bags.  The base
columns are projected out first, so that they are never thresholded away, and of the shapes of an
effect the best fitting one takes part.  The threshold is the best of 0.002, 0.005, 0.01, 0.02 and
0.05 on 18 cases of another seed (exact set in 0, 0, 0, 5 and 7 of them).
"""

from collections.abc import Sequence
import importlib
import warnings

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.peers.equations import Equations, equations
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

BAGS = 20
INCLUSION = 0.6
THRESHOLD = 0.05
"""Share of the bags in which a named term survives, and size of a term, relative to the RMS of the
left-hand side, below which it does not."""


def name_effects(records: Sequence[Record], effects: Sequence[str]) -> tuple[str, ...]:
    """Return the effects that most bags keep, largest contribution first.

    Raises
    ------
    ImportError
        If PySINDy is not installed.
    """
    balances = equations(records, effects)
    sizes: dict[str, float] = {}
    for name in balances.target:
        for key, size in _kept(balances, name).items():
            sizes[key] = max(size, sizes.get(key, 0.0))
    return tuple(sorted(sizes, key=lambda key: -sizes[key]))


def _kept(balances: Equations, name: str) -> dict[str, float]:
    """Return effect to relative size for one equation."""
    target = balances.target[name]
    basis = np.linalg.qr(balances.base[name])[0]
    library, owners = _library(balances, name, basis, target)
    if not owners:
        return {}
    unit = np.sqrt(np.mean(target**2))
    scale = np.sqrt(np.mean(library**2, axis=0))
    rest = (target - basis @ (basis.T @ target)) / unit
    coefficients = _ensemble(library / scale, rest)
    inclusion = np.mean(np.abs(coefficients) > 0, axis=0)
    size = np.abs(np.median(coefficients, axis=0))
    found: dict[str, float] = {}
    for owner, share, one in zip(owners, inclusion, size, strict=True):
        if share >= INCLUSION:
            found[owner] = max(float(one), found.get(owner, 0.0))
    return found


def _library(
    balances: Equations, name: str, basis: Array, target: Array
) -> tuple[Array, list[str]]:
    """Return the columns of the best shape of every effect, without what the base explains."""
    best: dict[str, tuple[float, Array]] = {}
    for term in balances.terms:
        if name not in term.columns:
            continue
        added = term.columns[name]
        new = added - basis @ (basis.T @ added)
        keep = np.linalg.norm(new, axis=0) > 1e-3 * np.linalg.norm(added, axis=0)
        if not np.any(keep):
            continue
        own = np.linalg.qr(new[:, keep])[0]
        gain = float(np.sum((own.T @ target) ** 2))
        if gain > best.get(term.effect, (-1.0, added))[0]:
            best[term.effect] = (gain, new[:, keep])
    owners = [key for key, (_, columns) in best.items() for _ in range(columns.shape[1])]
    return np.column_stack([c for _, c in best.values()] or [np.empty((target.size, 0))]), owners


def _ensemble(library: Array, target: Array) -> Array:
    """Return the (bags, K) coefficients of the ensemble."""
    optimizers = importlib.import_module('pysindy').optimizers
    state = np.random.get_state()  # noqa: NPY002 - PySINDy draws its bags from the global state
    np.random.seed(0)  # noqa: NPY002
    try:
        ensemble = optimizers.EnsembleOptimizer(
            optimizers.STLSQ(threshold=THRESHOLD, alpha=1e-6), bagging=True, n_models=BAGS
        )
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # it warns where it keeps nothing, which is an answer
            ensemble.fit(library, target[:, None])
    finally:
        np.random.set_state(state)  # noqa: NPY002
    return np.array(ensemble.coef_list)[:, 0, :]
