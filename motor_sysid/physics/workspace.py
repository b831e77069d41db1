"""What the kernel works on for one block of parameter vectors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.implicit import KEPT_ROWS
from motor_sysid.physics.lanes import LANES

Array = NDArray[np.float64]

WORTH_CUTTING = 4_000
"""Samples from which on half the stretches run in a thread of their own."""

FINE, FINEST = 8, 32
"""Steps in which a step is taken again where a stiff law turns, and how many of them a sample may
have."""


@dataclass
class Workspace:
    """Matrices and lengths of the substeps, lanes in use, coarse pieces, delay, flat memory.

    `linear` is A, B, G of the motor by vectors of lanes, (V, n, ..., 8), or empty where no law
    needs them.  See `motor_sysid.physics.kernel.run_block` for shapes.
    """

    matrices: tuple[Array, Array, Array]
    width: Array
    wide: int
    coarse: int
    late: NDArray[np.int64]
    buffer: Array
    linear: tuple[Array, Array, Array]

    def again(self) -> 'Workspace':
        """Return one that runs the same with a memory of its own."""
        return replace(self, buffer=self.buffer.copy())

    def rest(self) -> None:
        """Forget how large the laws have been: a stretch begins."""
        self.buffer[-KEPT_ROWS * LANES :] = 0.0

    @property
    def by_force(self) -> Array:
        """(n, m) change of the state in one step by constant forces of one, in the first lane."""
        return self.matrices[1][0, 0, :, :, 0]


def graded(width: Array, parts: int, *, even: bool = False) -> Array:
    """Cut pieces (S, W) of a sample in `parts` each, in proportion to the odd numbers.

    The input changes at the start of a piece, and the current follows within its own time
    constant, which may be a hundredth of the sample: there the parts are shortest.  Twice as many
    are half as long throughout, so that the error falls with the square of their number.  Laws
    that turn with the angle, as those of three phases do, change all the time: their parts are
    `even`.

    Returns
    -------
    (S parts, W) lengths.
    """
    shares = np.diff(np.linspace(0.0, 1.0, parts + 1) ** (1 if even else 2))
    return np.concatenate([np.outer(shares, piece) for piece in width])


def coarse_and_fine(
    width: Array, parts: int, substeps: int, *, again: bool, even: bool
) -> tuple[int, Array]:
    """Cut pieces (S, W) of a sample in `parts` of `substeps`; and these if they are taken `again`.

    Returns
    -------
    How many parts there are, and the lengths (C, W) of a step in each of them and then of those
    in place of one step of the first, the second, ...
    """
    steps = graded(width, parts, even=even) / substeps
    finer = min(FINE, FINEST // (parts * substeps)) if again else 1
    if finer == 1:
        return len(steps), steps
    return len(steps), np.concatenate((steps, graded(steps, finer, even=even)))


def delays(delay: Array, dt: float) -> tuple[NDArray[np.int64], Array]:
    """Split input delays (K, W) in s, one after the other.

    Returns
    -------
    (W,) whole samples, and the lengths (2, W) of the parts of a sample under either input.
    """
    total = np.maximum(delay, 0.0).sum(axis=0) / dt
    whole = np.floor(np.where(np.isfinite(total), total, 0.0))
    return whole.astype(np.int64), np.stack(((total - whole) * dt, (1 - total + whole) * dt))


def halves(lengths: Sequence[int], begins: Sequence[int]) -> list[slice]:
    """Cut stretches (of so many samples) in two of about one length, if they are long.

    Only the stretches that are numbered in `begins` need not know how the one before them ended.
    """
    ends = np.cumsum([0, *lengths])
    inner = [n for n in begins if 0 < n < len(lengths)]
    if not inner or ends[-1] < WORTH_CUTTING:
        return [slice(0, len(lengths))]
    middle = min(inner, key=lambda n: float(abs(2 * ends[n] - ends[-1])))
    return [slice(0, middle), slice(middle, len(lengths))]


def filled(push: Array) -> Array:
    """Return forces from outside with every lane of a block filled."""
    if push.shape[0] == 0:
        return push
    full = np.zeros((*push.shape[:3], LANES))
    full[..., : push.shape[3]] = push
    return full
