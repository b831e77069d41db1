"""What the samples before a window tell of the parameters: a quadratic, its arrival cost."""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept

Array = NDArray[np.float64]


class Arrival:
    """``(z - center)' information (z - center)``, which fades, but never below the prior.

    Rao, Rawlings and Mayne 2003, doi:10.1109/TAC.2002.808470, on arrival costs; that of samples
    which leave the window is the quadratic of the normal equations, with where the motion began
    eliminated.

    Parameters
    ----------
    center:
        (d,) coordinates before any data.

    Attributes
    ----------
    center, information, prior:
        (d,), (d, d), and (d,) standard deviations before any data.
    """

    def __init__(self, center: Array) -> None:
        self.center = center.copy()
        self.information = np.zeros((center.size, center.size))
        self.prior = np.full(center.size, np.inf)

    def widen(self, prior: Array) -> None:
        """Know less beforehand: raise the standard deviations to `prior` where it is larger."""
        wider = prior
        if np.isfinite(self.prior).all():
            wider = np.maximum(prior, self.prior)
        self.information += np.diag(1.0 / wider**2 - 1.0 / self.prior**2)
        self.prior = wider

    def fade(self, keep: float) -> None:
        """Believe less of what was known before; what is never forgotten stays."""
        floor = np.diag((1.0 - keep) / self.prior**2)
        self.information = keep * self.information + floor

    def absorb(self, sums: Array, free: Array, at: Array, keep: float) -> None:
        """Take what leaves the window.

        Parameters
        ----------
        sums:
            (n + d, n + d + 1) normal equations of it; the first n are where the motion began.
        free:
            (n, n) information on where the motion began from elsewhere.
        at:
            (d,) coordinates that they were formed at.
        keep:
            What is kept of what was known before.
        """
        n, size = len(free), sums.shape[0]
        inner, cross = sums[:n, :n] + free, sums[n:, :n]
        known = np.linalg.solve(inner, np.column_stack((cross.T, sums[:n, size])))
        new = sums[n:, n:size] - cross @ known[:, :-1]
        new = 0.5 * (new + new.T)
        pull = sums[n:, size] - cross @ known[:, -1]
        floor = (1.0 - keep) / self.prior**2
        old = keep * self.information
        right = old @ self.center + floor * at + new @ at + pull
        self.information = old + np.diag(floor) + new
        self.center = np.asarray(np.linalg.solve(self.information, right), dtype=np.float64)


@kept()
def bounded_step(information, pull, lower, upper):  # type: ignore[no-untyped-def]
    """Minimize ``s' information s / 2 - pull' s`` with some of ``s`` (m,) between bounds.

    What would leave its bounds is put there and the rest solved again, at most m times; where a
    bound was reached in vain it is kept, which costs accuracy but no safety.
    """
    m = pull.size
    step, fixed = np.zeros(m), np.zeros(m, dtype=np.bool_)
    for _ in range(m + 1):
        whole, right = information.copy(), pull.copy()
        for i in range(m):
            if fixed[i]:
                for j in range(m):
                    if not fixed[j]:
                        right[j] -= information[j, i] * step[i]
                    whole[i, j] = 0.0
                    whole[j, i] = 0.0
                whole[i, i] = 1.0
                right[i] = step[i]
        step = np.linalg.solve(whole, right)
        again = False
        for i in range(m):
            if not fixed[i] and not lower[i] <= step[i] <= upper[i]:
                step[i] = min(max(step[i], lower[i]), upper[i])
                fixed[i] = True
                again = True
        if not again:
            break
    return step
