"""Samples that were lost just where the input steps: when it stepped is not known.

A run through such a hole has the step a sample or more too early or too late.  That impulse is
soon larger than all that a model has not right elsewhere, and hides what is missing.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from motor_sysid.signals.channels import Role, role_of
from motor_sysid.signals.finding import Finding, Severity

Array = NDArray[np.float64]

HOLE, ON_GRID = 1.5, 0.25
"""Median steps from which on samples are missing, and how far from a whole number of them a hole
may be: stamps that scatter are none."""

OFTEN = 0.2
"""Share of steps that are holes from which on that is how it was sampled."""

STEEP, LARGE = 5.0, 0.02
"""Change of an input that is a step: in units of what 95 % of the changes from sample to sample
stay below, for each sample; and as a share of its range."""


def after_lost_steps(time: Array, signals: Mapping[str, Array]) -> NDArray[np.intp]:
    """Return the rows that follow on a hole in which an input stepped.

    Parameters
    ----------
    time:
        (N,) s, increasing.
    signals:
        Name to (N,) values.
    """
    steps = np.diff(time)
    if steps.size < 2:
        return np.zeros(0, dtype=np.intp)
    length = steps / np.median(steps)
    holes = (length > HOLE) & (np.abs(length - np.round(length)) < ON_GRID)
    if not np.any(holes) or np.mean(holes) > OFTEN:
        return np.zeros(0, dtype=np.intp)
    lost = np.zeros(steps.size, dtype=bool)
    for values in _inputs(signals):
        change = np.abs(np.diff(values))
        usual = float(np.quantile(change[~holes], 0.95))
        least = np.maximum(STEEP * usual * length, LARGE * float(np.ptp(values)))
        lost |= holes & (change > least)
    return np.flatnonzero(lost) + 1


def _inputs(signals: Mapping[str, Array]) -> Iterator[Array]:
    for name, values in signals.items():
        if role_of(name) is Role.INPUT:
            yield values


def lost_steps(time: Array, rows: NDArray[np.intp]) -> Finding:
    """Return the finding for holes in which an input stepped, which end before these rows."""
    return Finding(
        Severity.WARNING, 'lost_step',
        f'samples are missing where the input steps, {rows.size} time{"s" * (rows.size > 1)}, the '
        f'first before {time[rows[0]]:.6g} s; split into separate records there',
        'each record is simulated from its own start: when the input stepped is not known',
        'look for lost messages (queue depth, QoS) or a busy logger',
        {'holes': rows.size},
    )  # fmt: skip
