"""Records that a model describes unevenly: what is missing acts in some of them only.

Sensors make the same error in every record but for their noise, and so do random loads, within a
tenth or two.  A drive that clips only in the largest moves cannot be predicted from the records in
which it did not, but it shows: the model fails there, and holds in the others.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.estimation.batch import Chain
from motor_sysid.estimation.batch.methods.reference import moving_references
from motor_sysid.signals.noise import fast_part

Array = NDArray[np.float64]

UNEVEN = 1.5
"""Ratio of the errors of two records from which on the model lacks something; complete models with
random loads reach 1.2."""

FEW = 1e-3
"""Share of the samples, those with the largest errors, that counts for nothing: one commutation
that a model puts into the sample before may weigh as much as ten thousand good samples."""


def unevenness_of(
    training: Comparison,
    held: Comparison,
    chains: tuple[Sequence[Chain], Sequence[Chain]],
    noise: Array,
    differenced: Sequence[bool],
) -> float:
    """Return how many times larger an output's error is in one record than in another, at most.

    The smaller one counts as sensor noise at least, which is `noise` (n_y,), or what the other
    record shows of it.  Records under control and others are compared apart: a controller lets
    random loads do less to the speed.
    """
    sides = (training, chains[0]), (held, chains[1])
    residuals = [r for side, chain in sides for r in by_chain(side.residuals, chain)]
    measured = [m for side, chain in sides for m in by_chain(side.measured, chain)]
    errors = np.array([but_for_few(residual) for residual in residuals])
    own = np.array(list(map(partial(_own_noise, differenced), residuals, measured)))
    loops = np.array([loop for side in chains for loop in _loops(side)])
    ratios = [1.0]
    for kind in set(loops.tolist()):
        among = loops == kind
        best = np.maximum(np.min(errors[among], axis=0), noise)
        least = np.maximum(np.maximum(best, own[among]), 1e-300)
        ratios.append(float(np.max(errors[among] / least)))
    return max(ratios)


def _own_noise(differenced: Sequence[bool], residual: Array, measured: Array) -> Array:
    """Return (n_y,) fast noise that one record shows, in what was measured and in what is left.

    A current ripples more at another speed, brushes spark more at another current, and counts err
    by nothing where the motion is in step with them.
    """
    parts = (
        [fast_part(values[:, j], differenced=late) for j, late in enumerate(differenced)]
        for values in (residual, measured)
    )
    both = [but_for_few(np.stack(fast, axis=1)) for fast in parts]
    least: Array = np.minimum(*both)
    return least


def but_for_few(residual: Array) -> Array:
    """Return (n_y,) root mean squares of (N, n_y) errors, each without its `FEW` largest."""
    squares, keep = residual**2, len(residual) - int(FEW * len(residual))
    if keep < len(residual):
        squares = np.partition(squares, keep - 1, axis=0)[:keep]
    rms: Array = np.sqrt(np.mean(squares, axis=0))
    return rms


def _loops(chains: Sequence[Chain]) -> Iterator[bool]:
    """Yield of each chain that is scored whether its record holds a reference that moves."""
    for chain in chains:
        records = [stretch.record for stretch in chain if stretch.scored]
        if records:
            yield any(moving_references(record) for record in records)


def by_chain(parts: Sequence[Array], chains: Sequence[Chain]) -> Iterator[Array]:
    """Yield of (N, n_y) residuals, or the like, of all stretches those of each scored chain."""
    rest = iter(parts)
    for chain in chains:
        own = list(islice(rest, sum(stretch.scored for stretch in chain)))
        if own:
            yield np.concatenate(own)
