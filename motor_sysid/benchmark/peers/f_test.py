"""Forward selection on the equation errors with F-tests: what a careful engineer does by hand.

The strongest term is added as long as its F-test passes at 1 % divided by the number of tests
(Draper and Smith, Applied Regression Analysis, 3rd ed. 1998, chapter 15).
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from motor_sysid.benchmark.peers.equations import Equations, equations, Term
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

ALPHA = 0.01
MOST = 5
"""Family-wise level of each step, and most effects that are added."""


def name_effects(records: Sequence[Record], effects: Sequence[str]) -> tuple[str, ...]:
    """Return the effects that pass, in the order of adding."""
    balances = equations(records, effects)
    columns = dict(balances.base)
    chosen: list[str] = []
    while len(chosen) < MOST:
        best = _strongest(balances, columns, chosen)
        if best is None:
            break
        chosen.append(best.effect)
        columns = {
            name: np.column_stack([x, best.columns[name]]) if name in best.columns else x
            for name, x in columns.items()
        }
    return tuple(chosen)


def _strongest(
    balances: Equations, columns: Mapping[str, Array], chosen: Sequence[str]
) -> Term | None:
    """Return the term with the largest gain among those that pass; None if none does."""
    tests = []
    for name, target in balances.target.items():
        basis = np.linalg.qr(columns[name])[0]
        rest = target - basis @ (basis.T @ target)
        for term in balances.terms:
            if name in term.columns and term.effect not in chosen:
                tests.append((*_test(basis, rest, term.columns[name]), term))
    passing = [(gain, term) for gain, p, term in tests if p * len(tests) < ALPHA]
    return max(passing, key=lambda one: one[0])[1] if passing else None


def _test(basis: Array, rest: Array, added: Array) -> tuple[float, float]:
    """Return the gain in BIC and the p-value of adding columns to a fit that leaves `rest`."""
    new = added - basis @ (basis.T @ added)
    keep = np.linalg.norm(new, axis=0) > 1e-6 * np.linalg.norm(added, axis=0)
    if not np.any(keep):
        return -np.inf, 1.0
    own = np.linalg.qr(new[:, keep])[0]
    count, extra = rest.size, own.shape[1]
    before = float(rest @ rest)
    after = max(before - float(np.sum((own.T @ rest) ** 2)), 1e-300)
    free = count - basis.shape[1] - extra
    ratio = (before - after) / extra / (after / free)
    gain = count * np.log(before / after) - extra * np.log(count)
    return float(gain), float(f_distribution.sf(ratio, extra, free))
