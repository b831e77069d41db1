"""What a motor kind is: its states, channels, parameters, and its linear core."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.parameters import Parameter
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
Values = Mapping[str, Array]
Matrices = tuple[Array, Array, Array]


@dataclass(frozen=True)
class Output:
    """A signal that the motor kind can predict.

    Attributes
    ----------
    signal:
        Canonical name of the signal.
    state:
        State that it shows.
    bias:
        Motor parameter that is added by the sensor, or empty.
    """

    signal: str
    state: str
    bias: str = ''


@dataclass(frozen=True)
class Force:
    """An equation that effects may add to.

    Attributes
    ----------
    name:
        Name of the laws that enter here: torque, voltage, ...
    own_state:
        The state in which such laws may be stiff.
    unit:
        Unit of the law's value.
    """

    name: str
    own_state: str
    unit: str


@dataclass(frozen=True)
class Term:
    """``factors * parameter * product of signals``, or its time derivative.

    Attributes
    ----------
    parameter:
        Motor parameter in which the term is linear, or empty.
    signals:
        States and inputs (as laws name them) that are multiplied.
    factors:
        Motor parameters that are held and multiply.
    derivative:
        Whether the time derivative of the signal is meant.
    """

    parameter: str
    signals: tuple[str, ...]
    factors: tuple[str, ...] = ()
    derivative: bool = False


@dataclass(frozen=True)
class Balance:
    """One equation of a motor: ``drive + laws = sum of terms``, linear in its parameters.

    Attributes
    ----------
    force:
        Name of the laws that enter here.
    drive, terms:
        Its two sides; the parameter of the drive, if any, belongs to another balance or is held.
    """

    force: str
    drive: Term
    terms: tuple[Term, ...]


@dataclass(frozen=True)
class Motor:
    """A motor kind; one file of this folder each.

    Attributes
    ----------
    key, title:
        Name in files and on the command line; name for people.
    states:
        Core states, named as laws name them.
    inputs:
        Sets of input signals that can drive it, the preferred first; each set lists the signals
        in the order of the columns of ``B``.
    arguments:
        Names under which laws see the inputs, in the same order.
    outputs:
        Signals that it predicts.
    forces:
        Equations that effects may add to, in the order of the columns of ``G``.
    parameters:
        Its parameters with boxes and default values.
    matrices:
        ``values -> (A (P, n, n), B (P, n, n_u), G (P, n, m))`` for arrays of P values each.
    start:
        ``records -> values``: start values read from the records without iteration.
    balances:
        Its equations in a form that is linear in the parameters, for recursive regression.
    drive_torque:
        ``(values, record) -> (N,)`` torque that the motor puts on its shaft, as measured.
    """

    key: str
    title: str
    states: tuple[str, ...]
    inputs: tuple[tuple[str, ...], ...]
    arguments: tuple[str, ...]
    outputs: tuple[Output, ...]
    forces: tuple[Force, ...]
    parameters: tuple[Parameter, ...]
    balances: tuple[Balance, ...]
    matrices: Callable[[Values], Matrices]
    start: Callable[[Sequence[Record]], dict[str, float]]
    drive_torque: Callable[[Mapping[str, float], Record], Array]

    def names(self) -> set[str]:
        """Return everything that a law may ask this motor for."""
        rates = {f'd{force.own_state}' for force in self.forces}
        own = {*self.states, *self.arguments, *(p.name for p in self.parameters)}
        return own | rates | {'t', 'turn'}


def stack(rows: Sequence[Sequence[Array]]) -> Array:
    """Return (P, n, k) from n rows of k arrays (P,)."""
    size = max(np.size(value) for row in rows for value in row)
    out = np.empty((size, len(rows), len(rows[0])))
    for i, row in enumerate(rows):
        for j, value in enumerate(row):
            out[:, i, j] = value
    return out


def integral_regression(
    records: Sequence[Record],
    columns: Callable[[Record, int], tuple[Array, Array]],
) -> Array:
    """Solve ``y = X p`` stacked over records by scaled least squares.

    `columns` gives, for a record and a window in samples, the regressors X (K, p) and y (K,) of
    equations integrated over windows of that length: integration needs no derivative and averages
    the noise.  The window is a fiftieth of the record, between 4 and 400 samples.
    """
    parts = [columns(r, int(np.clip(len(r) // 50, 4, 400))) for r in records]
    x = np.concatenate([p[0] for p in parts])
    y = np.concatenate([p[1] for p in parts])
    scale = np.linalg.norm(x, axis=0)
    scale[scale == 0] = 1.0
    solution: Array = np.linalg.lstsq(x / scale, y, rcond=1e-10)[0] / scale
    return solution


def windows(values: Array, length: int) -> tuple[Array, Array]:
    """Return (integral in sample units, increment) over windows that overlap by three quarters."""
    starts = np.arange(0, values.size - length, max(length // 4, 1))
    area = np.concatenate(([0.0], np.cumsum(values)))
    return area[starts + length] - area[starts], values[starts + length] - values[starts]
