"""Which causes of the table agree with how parameters have moved.

A cause says a direction; its size is fitted, and what is left is compared with a chi-square
distribution.  So is what it takes away: a small change leaves little, whatever is said to have
made it.  All that are not rejected are told: where several explain the change, the record cannot
tell them apart.  Where none does, pairs are tried.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import chi2

from motor_sysid.diagnosis.condition.causes import Cause, CAUSES, COPPER, role_of
from motor_sysid.diagnosis.condition.drift import Drift

Array = NDArray[np.float64]

REJECTED = 0.01
"""p-value of what is left below which a cause does not explain the change, and of what it takes
away above which it has no part in it."""

MOST = 4
"""Pairs that are told."""


@dataclass(frozen=True)
class Likely:
    """A cause, or two together, that explains a change.

    Attributes
    ----------
    causes:
        One or two.
    p_value:
        How often chance leaves more than this cause does.
    words:
        What it is, with the temperature where it is one of heat.
    """

    causes: tuple[Cause, ...]
    p_value: float
    words: str


def likely(drift: Drift, brushed: bool) -> tuple[Likely, ...]:
    """Return the causes that explain a drift, best first; pairs only where no single one does.

    `brushed` tells whether the motor has brushes.
    """
    known = [c for c in CAUSES if brushed or not c.brushed]
    able = [c for c in known if not brushed or c.brushed or not _same_as_brushes(c)]
    single = _explaining([(c,) for c in able], drift)
    if single:
        return tuple(single)
    return tuple(_explaining(list(combinations(able, 2)), drift)[:MOST])


def _same_as_brushes(cause: Cause) -> bool:
    """Whether a cause of motors without brushes has a twin among those with them."""
    twins = [c.directions for c in CAUSES if c.brushed]
    return not cause.warms and cause.directions in twins


def _explaining(sets: Sequence[tuple[Cause, ...]], drift: Drift) -> list[Likely]:
    roles = [role_of(p) for p in drift.parameters]
    whiten = np.linalg.inv(np.linalg.cholesky(drift.covariance))
    target = whiten @ drift.change
    sure = max(REJECTED, float(np.min(drift.p_values())))  # no cause is surer than the change
    found = []
    for causes in sets:
        parts = [whiten @ _columns(cause, roles) for cause in causes]
        left, used = _fitted(parts, target)
        freedom = max(target.size - used, 0)
        p_value = float(chi2.sf(left, freedom)) if freedom else 1.0
        without = [_fitted(parts[:k] + parts[k + 1 :], target) for k in range(len(parts))]
        idle = any(chi2.sf(more - left, max(used - less, 1)) > sure for more, less in without)
        if p_value > REJECTED and not idle:
            found.append(Likely(causes, p_value, _words(causes, drift, roles)))
    return sorted(found, key=lambda one: -one.p_value)


def _fitted(parts: Sequence[Array], target: Array) -> tuple[float, int]:
    """Return the squares that causes leave of a change, and how many directions they take."""
    columns = np.concatenate([np.empty((target.size, 0)), *parts], axis=1)
    columns = columns[:, np.any(columns, axis=0)]
    if not columns.size:
        return float(target @ target), 0
    sizes, left = nnls(columns, target)
    return left**2, int(np.count_nonzero(sizes))


def _columns(cause: Cause, roles: Sequence[str]) -> Array:
    """Return the (p, directions) changes that a cause can make."""
    return np.array([[way.get(role, 0.0) for way in cause.directions] for role in roles])


def _words(causes: Sequence[Cause], drift: Drift, roles: Sequence[str]) -> str:
    texts = []
    for cause in causes:
        text = cause.words
        if cause.warms and 'resistance' in roles:
            k = roles.index('resistance')
            change = float(np.expm1(drift.change[k])) / COPPER
            sigma = float(drift.sigma[k] * np.exp(drift.change[k])) / COPPER
            text += f' ({change:+.0f} ± {sigma:.0f} K if it is of copper and heat alone)'
        texts.append(text)
    return ' together with '.join(texts)
