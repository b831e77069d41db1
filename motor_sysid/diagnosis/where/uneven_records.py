"""Records that a model describes unevenly: what is missing acts in some of them only.

Sensors make the same error in every record, and so do random loads, within a tenth or two.  A
drive that clips only in the largest moves cannot be predicted from the records in which it did
not, but it shows: the model fails there, and holds in the others.
"""

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.estimation.batch import Chain
from motor_sysid.estimation.batch.methods.reference import moving_references
from motor_sysid.signals.lattice import lattice

Array = NDArray[np.float64]

UNEVEN = 1.5
"""Ratio of the errors of two records from which on the model lacks something; complete models with
random loads reach 1.2."""

FEW = 1e-3
"""Share of the samples, those with the largest errors, that counts for nothing: one commutation
that a model puts into the sample before may weigh as much as ten thousand good samples."""

OF_COUNTS = 0.5
"""Most that the difference of counts may err by, root mean square, in units of its step: that of
two values in equal parts.  A motion in step with the counts makes less of it, down to nothing."""


def unevenness_of(
    training: Comparison,
    held: Comparison,
    chains: tuple[Sequence[Chain], Sequence[Chain]],
    noise: Array,
    differenced: Sequence[bool],
) -> float:
    """Return how many times larger an output's error is in one record than in another, at most.

    The smaller one counts as sensor noise at least, which is `noise` (n_y,), or what counts make
    at most where an output is the difference of these.  Records under control and others are
    compared apart: a controller lets random loads do less to the speed.
    """
    noise = np.maximum(noise, _of_counts([*training.measured, *held.measured], differenced))
    residuals = [*by_chain(training, chains[0]), *by_chain(held, chains[1])]
    loops = [loop for side in chains for loop in _loops(side)]
    ratios = [1.0]
    for kind in set(loops):
        own = [r for r, loop in zip(residuals, loops, strict=True) if loop == kind]
        errors = np.array([but_for_few(residual) for residual in own])
        best = np.maximum(np.min(errors, axis=0), noise)
        ratios.append(float(np.max(np.max(errors, axis=0) / np.maximum(best, 1e-300))))
    return max(ratios)


def but_for_few(residual: Array) -> Array:
    """Return (n_y,) root mean squares of (N, n_y) errors, each without its `FEW` largest."""
    squares, keep = residual**2, len(residual) - int(FEW * len(residual))
    if keep < len(residual):
        squares = np.partition(squares, keep - 1, axis=0)[:keep]
    rms: Array = np.sqrt(np.mean(squares, axis=0))
    return rms


def _of_counts(measured: Sequence[Array], differenced: Sequence[bool]) -> Array:
    """Return (n_y,) the most that counts make of each output (N, n_y); 0 where it is of none."""
    columns = np.concatenate(measured).T
    steps = [
        lattice(column) if late else None
        for column, late in zip(columns, differenced, strict=True)
    ]
    return np.array([OF_COUNTS * found.step if found else 0.0 for found in steps])


def _loops(chains: Sequence[Chain]) -> Iterator[bool]:
    """Yield of each chain that is scored whether its record holds a reference that moves."""
    for chain in chains:
        records = [stretch.record for stretch in chain if stretch.scored]
        if records:
            yield any(moving_references(record) for record in records)


def by_chain(comparison: Comparison, chains: Sequence[Chain]) -> Iterator[Array]:
    """Yield the residual (N, n_y) of each chain that is scored."""
    residuals = iter(comparison.residuals)
    for chain in chains:
        own = list(islice(residuals, sum(stretch.scored for stretch in chain)))
        if own:
            yield np.concatenate(own)
