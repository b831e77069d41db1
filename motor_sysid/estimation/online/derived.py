"""Signals that follow from states and inputs: what a balance of a three-phase motor multiplies."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.laws import evaluate_columns
from motor_sysid.machine_code import kept
from motor_sysid.physics.lanes import (
    compile_effect,
    FIRST_PARAMETER_ROW,
    LANES,
    ROW_OF_ARGUMENT,
    ROW_OF_FORCE,
)
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

_ROW = 'torque'


class DerivedSignals:
    """The derived signals of a motor kind, with the parameters of a model.

    Parameters
    ----------
    model:
        The model.
    signals:
        Names of the vector of signals; those that are derived stand side by side in it.
    """

    def __init__(self, model: Model, signals: tuple[str, ...]) -> None:
        kind = model.kind
        names = tuple(p.name for p in kind.parameters)
        buffer = np.zeros((FIRST_PARAMETER_ROW + len(names), LANES))
        buffer[FIRST_PARAMETER_ROW:] = np.array([[model[name]] for name in names])
        self._flat = buffer.ravel()
        self._first = signals.index(next(iter(kind.derived))) if kind.derived else 0
        self._out = np.empty(len(kind.derived))
        self._lanes = [
            compile_effect(replace(kind.own, laws={_ROW: law}, rates={}), names)[0]
            for law in kind.derived.values()
            if kind.own
        ]
        calls = [(lane.address, 0, 0, ROW_OF_FORCE[_ROW] * LANES, 1) for lane in self._lanes]
        reads = [(ROW_OF_ARGUMENT[s], k) for k, s in enumerate(signals) if s in ROW_OF_ARGUMENT]
        self._calls = np.array(calls, dtype=np.int64).reshape(-1, 5)
        self._reads = np.array(reads, dtype=np.int64).reshape(-1, 2)

    def fill(self, signals: Array) -> None:
        """Write the derived signals of both ends of a sample into their places in (2, S)."""
        if self._out.size:
            _fill(
                self._flat, self._flat.ctypes.data, self._calls, self._reads, signals,
                self._first, self._out,
            )  # fmt: skip


@kept(error_model='numpy')
def _fill(buffer, base, calls, reads, signals, first, out):  # type: ignore[no-untyped-def]
    for end in range(2):
        evaluate_columns(buffer, base, calls, reads, signals[end], out)
        for k in range(out.size):
            signals[end, first + k] = out[k]
