"""What a black-box structure is: a value that runs freely, and the kind that it is of."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
Numbers = dict[str, Array]

START_ROWS = 40
"""Measured rows from which a free run reads where it begins."""

_GAP = 2.5


@dataclass(frozen=True)
class Run:
    """One uninterrupted stretch: held inputs (N, m) and outputs (N, p), both scaled."""

    u: Array
    y: Array

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.y)

    def until(self, row: int) -> 'Run':
        """Return the rows before `row`."""
        return Run(self.u[:row], self.y[:row])

    def output(self, j: int) -> 'Run':
        """Return the run with one output only."""
        return Run(self.u, self.y[:, j : j + 1])


class Kind(ABC):
    """A kind of structure; one small file of this folder each.

    Everything is in scaled signals.  Row k of the inputs acts from ``time[k]`` to ``time[k + 1]``,
    so it is seen at row k + 1 at the earliest.

    Attributes
    ----------
    key, title:
        Name in files and on the command line; name for people.
    source:
        Where it is described.
    limits:
        What it cannot do, in one sentence.
    orders:
        Orders that the automatic choice tries, small ones first.
    strides:
        Sample times that it tries, in samples of the record.  A difference equation between
        noisy samples wants samples as long as its dynamics; an output error does not care.
    joint:
        Whether one structure describes all outputs; otherwise there is one for each.
    """

    key: str
    title: str
    source: str
    limits: str
    orders: tuple[int, ...] = (1, 2, 3, 4)
    strides: tuple[int, ...] = (1,)
    joint: bool = False

    @abstractmethod
    def fit(self, runs: Sequence[Run], order: int, dt: float) -> Numbers:
        """Return the numbers of the structure of that order that fits best.

        Parameters
        ----------
        runs:
            Data.
        order:
            Order, of at least 1.
        dt:
            Sample time, s.
        """

    @abstractmethod
    def simulate(self, numbers: Numbers, u: Array, start: Array, dt: float) -> Array:
        """Return the (N, p) outputs of a free run.

        Parameters
        ----------
        u:
            (N, m) inputs.
        start:
            (K, p) outputs measured in the first rows, to begin from; with K = 0 it begins at rest.
        """

    def predict(self, numbers: Numbers, run: Run, dt: float) -> Array:
        """Return the (N, p) outputs one row ahead; those of a free run if it knows no noise."""
        return self.simulate(numbers, run.u, run.y[:START_ROWS], dt)


@dataclass(frozen=True)
class Structure:
    """A fitted structure, as a value.

    Attributes
    ----------
    kind:
        Key of its kind.
    inputs, outputs:
        Signals, in the order of the columns.
    dt:
        Its sample time, s.
    orders:
        One order for each part.
    input_size, output_size:
        (m,) and (p,) what the signals are divided by.
    parts:
        The numbers of each part: one part for each output, or one for all.
    """

    kind: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    dt: float
    orders: tuple[int, ...]
    input_size: Array
    output_size: Array
    parts: tuple[Mapping[str, Array], ...]


def runs_of(
    records: Sequence[Record], inputs: Sequence[str], outputs: Sequence[str], dt: float
) -> list[Run]:
    """Return the stretches of records without gaps, on a grid of `dt` s, not yet scaled.

    Raises
    ------
    UserError
        If nothing is left.
    """
    runs = []
    for record in records:
        for piece in record.segments(_GAP * record.dt):
            even = piece.select([*inputs, *outputs]).uniform(dt)
            runs.append(
                Run(
                    np.column_stack([even[name] for name in inputs]),
                    np.column_stack([even[name] for name in outputs]),
                )
            )
    runs = [run for run in runs if len(run) >= START_ROWS]
    if not runs:
        raise UserError(f'no stretch of {START_ROWS} samples without a gap; record more')
    return runs


def scaled(runs: Sequence[Run], input_size: Array, output_size: Array) -> list[Run]:
    """Return runs in units of the sizes."""
    return [Run(run.u / input_size, run.y / output_size) for run in runs]


def sizes(runs: Sequence[Run]) -> tuple[Array, Array]:
    """Return the RMS of every input (m,) and output (p,), 1 for what stays at zero."""
    both = []
    for columns in ([run.u for run in runs], [run.y for run in runs]):
        rms = np.sqrt(np.mean(np.concatenate(columns) ** 2, axis=0))
        both.append(np.where(rms > 0, rms, 1.0))
    return both[0], both[1]
