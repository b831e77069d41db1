"""Tests of what a model leaves: whether it is white, and whether the input still explains it.

Both hold their size: with nothing wrong they speak up as often as the level says, whatever the
colour of the input and, for the second, of the noise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2
from scipy.stats import f as fisher

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.weighting import coloured, filtered

Array = NDArray[np.float64]

_HIGHEST_ORDER = 20
_LEVEL = 1.959964


@dataclass(frozen=True)
class Whiteness:
    """Ljung-Box test.

    Attributes
    ----------
    autocorrelation:
        (L,) of lags 1 to L.
    band:
        What 95 % of the autocorrelations of white noise keep within.
    statistic, p:
        Its value, and how probable as much is for white noise.
    """

    autocorrelation: Array
    band: float
    statistic: float
    p: float


@dataclass(frozen=True)
class Dependence:
    """Test of the residual against the input.

    Attributes
    ----------
    correlation:
        (L + 1,) of the whitened residual with the input 0 to L samples before.
    band:
        What 95 % of them keep within if there is no dependence.
    order:
        Of the autoregression that whitened the residual.
    statistic, p:
        F of the regression of the whitened residual on all lags together, and how probable as much
        is without dependence.
    """

    correlation: Array
    band: float
    order: int
    statistic: float
    p: float


def ljung_box(residual: Array, lags: int = 20, *, fitted: int = 0) -> Whiteness:
    """Test whether a residual (N,) is white.

    ``Q = N (N + 2) sum r_k^2 / (N - k)`` is chi-squared with ``lags - fitted`` degrees of freedom.
    (Ljung and Box 1978, doi:10.1093/biomet/65.2.297.)

    Parameters
    ----------
    residual:
        (N,), uniformly sampled.
    lags:
        How many lags count.
    fitted:
        Parameters of a noise model that were fitted to these values.  Those of a motor fitted by
        output error do not count.

    Raises
    ------
    UserError
        If there are too few samples, or no freedom is left.
    """
    _refuse(residual.size, lags, lags - fitted)
    e = residual - residual.mean()
    power = float(e @ e)
    if power == 0.0:
        return Whiteness(np.zeros(lags), 1.0, 0.0, 1.0)
    n = e.size
    r = np.array([float(e[k:] @ e[:-k]) for k in range(1, lags + 1)]) / power
    q = float(n * (n + 2) * np.sum(r**2 / (n - np.arange(1, lags + 1))))
    return Whiteness(r, _LEVEL / np.sqrt(n), q, float(chi2.sf(q, lags - fitted)))


def input_dependence(residual: Array, driven: Array, lags: int = 20) -> Dependence:
    """Test whether a residual (N,) depends on the input (N,) of now and before.

    The residual is whitened by an autoregression (its order by BIC), the input passes the same
    filter, and the one is regressed on lags 0 to `lags` of the other.  Plain bands of
    ``1.96 / sqrt(N)`` around the correlation of coloured residuals with a coloured input would be
    far too narrow.  (Haugh 1976, doi:10.1080/01621459.1976.10480353; Ljung 1999, section 16.6.)

    Raises
    ------
    UserError
        If lengths differ or there are too few samples.
    """
    if residual.shape != driven.shape:
        raise UserError(f'a residual {residual.shape} and an input {driven.shape} of two lengths')
    _refuse(residual.size, lags, 1)
    taps = _whitener(residual)
    e, u = (
        filtered(np.ascontiguousarray(s - s.mean()).reshape(-1, 1, 1), taps)[:, 0, 0]
        for s in (residual, driven)
    )
    delayed = np.column_stack([u[lags - k : u.size - k] for k in range(lags + 1)])
    delayed -= delayed.mean(axis=0)
    e = e[lags:] - e[lags:].mean()
    size = np.sqrt(np.sum(delayed**2, axis=0) * float(e @ e))
    correlation = delayed.T @ e / np.where(size > 0, size, 1.0)
    left, values, _ = np.linalg.svd(delayed, full_matrices=False)
    told = left[:, values > 1e-9 * values[0]] if values[0] > 0 else left[:, :0]
    explained, freedom = float(np.sum((told.T @ e) ** 2)), e.size - told.shape[1] - 1
    rest = float(e @ e) - explained
    if told.shape[1] == 0 or rest <= 0:
        return Dependence(correlation, 1.0, taps.size - 1, 0.0, 1.0)
    ratio = explained / told.shape[1] / (rest / freedom)
    p = float(fisher.sf(ratio, told.shape[1], freedom))
    return Dependence(correlation, _LEVEL / np.sqrt(e.size), taps.size - 1, ratio, p)


def _whitener(residual: Array) -> Array:
    """Return the (1, order + 1) filter that whitens a residual, its order chosen by BIC."""
    n, best, chosen = residual.size, np.inf, np.ones((1, 1))
    for order in range(min(_HIGHEST_ORDER, n // 20) + 1):
        model = coloured([residual[:, np.newaxis]], order) if order else None
        sigma = float(model.sigma[0]) if model else max(float(residual.std()), 1e-15)
        score = 2 * n * np.log(sigma) + order * np.log(n)
        if score < best:
            best = score
            chosen = model.whiteners[0][np.newaxis, :] if model else np.ones((1, 1))
    return chosen


def _refuse(samples: int, lags: int, freedom: int) -> None:
    if lags < 1 or samples < 4 * lags or freedom < 1:
        raise UserError(
            f'{samples} samples, {lags} lags and {freedom} degrees of freedom; a test needs four '
            'samples for each lag and one degree of freedom at least'
        )
