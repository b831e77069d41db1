"""How far simulated values lie from measured ones, in the numbers that people use.

With e = measured - simulated, y the measured values, and sample k standing for the time dt_k until
the next one:

    SSE = sum e^2                     MSE = SSE / N            RMSE = sqrt(MSE)
    fit = 1 - |e| / |y - mean(y)|     R^2 = 1 - SSE / sum (y - mean(y))^2
    IAE = sum |e_k| dt_k              ITAE = sum (t_k - t_0) |e_k| dt_k
    MAPE = mean |e / y|               SMAPE = mean 2 |e| / (|y| + |simulated|)

(Ljung 1999, section 16.4 for the fit; Graham and Lathrop 1953, doi:10.1109/TAI.1953.6371346, for
the ITAE, an integral over time: a sum of |e| times the number of samples is not one.)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError

Array = NDArray[np.float64]

SMALL = 0.01
"""Share of the RMS of the measured values under which no relative error is taken."""

AXES = ('current_d', 'current_q')
"""Parts of one vector."""

ANYWHERE = 'position'
"""Signal whose zero says nothing: an encoder may begin to count wherever it likes."""


def sizes_of(outputs: Sequence[str], measured: Sequence[Array]) -> Array:
    """Return (n_y,) RMS of measured signals, of a position since its first one.

    Field-oriented control holds the d current at zero: against its own RMS, noise is all of it, so
    that of d and q currents is the one of their vector.

    Parameters
    ----------
    outputs:
        Names of the signals.
    measured:
        For each stretch of data its (N, n_y) values.
    """
    power: Array = np.mean(_moved(outputs, measured) ** 2, axis=0)
    vector = np.isin(outputs, AXES)
    power[vector] = np.sum(power[vector])
    return np.sqrt(power)


def moving(outputs: Sequence[str], measured: Sequence[Array]) -> NDArray[np.bool_]:
    """Return which (n_y,) signals are ever anything but zero, or a position that stays."""
    found: NDArray[np.bool_] = np.any(_moved(outputs, measured), axis=0)
    return found


def _moved(outputs: Sequence[str], measured: Sequence[Array]) -> Array:
    """Return (N, n_y) values, of a position since the first one."""
    values = np.concatenate(measured)
    since: Array = values - values[0] * np.isin(outputs, ANYWHERE)
    return since


@dataclass(frozen=True)
class Metrics:
    """Errors of one signal; in its unit, with seconds for the integrals.

    Attributes
    ----------
    samples:
        Samples in which both values are known.
    sse, mse, rmse, largest:
        Sum and mean of squares, its root, and the largest absolute error.
    fit_percent:
        100 for equal signals, 0 for the mean of the measured values; NaN if those are constant.
    r2:
        Explained share of the variance; NaN if the measured values are constant.
    iae, itae:
        Integral of the absolute error, in unit s, and of time since `t_0` times it, in unit s².
    mape_percent, smape_percent:
        Mean relative errors over the samples that are not close to zero; NaN if none is.
    ignored_percent:
        Samples that were too close to zero for a relative error.
    """

    samples: int
    sse: float
    mse: float
    rmse: float
    largest: float
    fit_percent: float
    r2: float
    iae: float
    itae: float
    mape_percent: float
    smape_percent: float
    ignored_percent: float


def metrics(
    measured: Array, simulated: Array, time: Array, *, begin: float | None = None
) -> Metrics:
    """Compare two signals.

    Parameters
    ----------
    measured, simulated:
        (N,) in one unit; samples that are NaN in either are left out.
    time:
        (N,) strictly increasing, s.
    begin:
        Where the time in the ITAE counts from, s; by default ``time[0]``.

    Raises
    ------
    UserError
        If lengths differ, time does not increase, or fewer than two samples are known.
    """
    if not measured.shape == simulated.shape == time.shape or np.any(np.diff(time) <= 0):
        raise UserError(
            f'measured {measured.shape}, simulated {simulated.shape} and time {time.shape} must '
            'be of one length, and time must increase'
        )
    known = np.isfinite(measured) & np.isfinite(simulated)
    if np.count_nonzero(known) < 2:
        raise UserError('fewer than two samples are known in both signals; there is no error')
    widths = np.diff(time, append=2 * time[-1] - time[-2])[known]
    y, guess = measured[known], simulated[known]
    errors = np.where(known, measured - simulated, 0.0)
    error = np.abs(y - guess)
    iae, ahead = float(error @ widths), 0.0 if begin is None else float(time[0] - begin)
    sse, spread = float(error @ error), float(np.sum((y - y.mean()) ** 2))
    mape, smape, ignored = _relative(error, y, guess)
    return Metrics(
        samples=y.size,
        sse=sse,
        mse=sse / y.size,
        rmse=float(np.sqrt(sse / y.size)),
        largest=float(error.max()),
        fit_percent=float(100 * (1 - np.sqrt(sse / spread))) if spread else float('nan'),
        r2=1 - sse / spread if spread else float('nan'),
        iae=iae,
        itae=float(itae(errors, time)) + ahead * iae,
        mape_percent=mape,
        smape_percent=smape,
        ignored_percent=ignored,
    )


def itae(error: Array, time: Array) -> Array:
    """Return the integrals (...,) of time since ``time[0]`` times errors (..., N), in unit s²."""
    widths = np.diff(time, append=2 * time[-1] - time[-2])
    total: Array = np.abs(error) @ ((time - time[0]) * widths)
    return total


def _relative(error: Array, y: Array, guess: Array) -> tuple[float, float, float]:
    """Return MAPE, SMAPE and the samples that were ignored, in percent."""
    size = float(np.sqrt(np.mean(y**2)))
    good = np.abs(y) > SMALL * size
    ignored = 100.0 * float(np.mean(~good))
    if not np.any(good):
        return float('nan'), float('nan'), ignored
    e, a, b = error[good], np.abs(y[good]), np.abs(guess[good])
    return 100 * float(np.mean(e / a)), 100 * float(np.mean(2 * e / (a + b))), ignored
