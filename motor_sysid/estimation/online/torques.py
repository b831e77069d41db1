"""The torque balance of a motor with the parameters that its model has, all but one load known."""

from collections.abc import Mapping
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.equation import fill_row, signal_places
from motor_sysid.estimation.online.laws import LawColumns
from motor_sysid.estimation.online.regressors import signal_names
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]


class Torques:
    """``inertia * domega/dt = known - load``, from the signals of a sample.

    Parameters
    ----------
    model:
        The model.
    load:
        The parameter whose law is not among what is known.

    Attributes
    ----------
    inertia:
        Factor of the acceleration.
    needs:
        States and inputs that are read.
    size:
        Number of torques that are added up, and of uncertainties: see `spread`.
    """

    def __init__(self, model: Model, load: str) -> None:
        balance = next(b for b in model.kind.balances if b.force == 'torque')
        signals = signal_names(model.kind)
        self._laws = LawColumns(model, ['torque'], signals)
        terms = (balance.drive, *balance.terms, *balance.given)
        factors = [math.prod((t.sign, *(model[name] for name in t.factors))) for t in terms]
        self._terms = signal_places(terms, signals, {}), np.array(factors)
        values = [model[t.parameter] if t.parameter else 1.0 for t in terms]
        turns = np.array([t.derivative for t in terms])
        self.inertia = float(np.sum(np.where(turns, np.array(values) * factors, 0.0)))
        names = [c.name for c in self._laws.columns]
        laws = [0.0 if name == load else model[name] if name else 1.0 for name in names]
        signs = np.where(turns, 0.0, -1.0)
        signs[0] = 1.0
        self._weights = np.concatenate((signs * values, laws))
        self._names = [*(t.parameter for t in terms), *('' if n == load else n for n in names)]
        self._turns = np.concatenate((turns, np.zeros(len(names), dtype=bool)))
        used = {signal for term in terms for signal in term.signals}
        self.needs, self.size = used | self._laws.needs, self._weights.size + 1
        shown = {o.state: o.bias for o in model.kind.outputs if o.bias}
        self._biased = [
            (k, shown[t.signals[0]])
            for k, t in enumerate(terms)
            if not t.derivative and len(t.signals) == 1 and t.signals[0] in shown
        ]
        self._rows = np.zeros((2, self._weights.size))

    def begin(self, tracked: Array) -> None:
        """Begin own states of laws at the present signals (2, S)."""
        self._laws.begin(tracked[0])

    def known(self, measured: Array, tracked: Array, h: float) -> float:
        """Return the mean torque over a sample of length h s, from signals (2, S) at its ends."""
        for end in range(2):
            fill_row(
                *self._terms, *self._laws.table, measured[end], tracked[end], self._rows[end]
            )
        self._laws.advance(h)
        return float(0.5 * (self._rows[0] + self._rows[1]) @ self._weights)

    def note(self, net: float, effects: Array, share: float) -> None:
        """Have `effects` (size,) follow what each parameter is multiplied with.

        Parameters
        ----------
        net:
            Torque that is left for the acceleration.
        share:
            How far to go from the old values to the new ones.
        """
        now = np.where(self._turns, net / self.inertia, 0.5 * (self._rows[0] + self._rows[1]))
        effects[:-1] += share * (now - effects[:-1])
        effects[-1] = 1.0

    def spread(self, sigma: Mapping[str, float]) -> Array:
        """Return (size,) standard deviations of the parameters, last that of sensor offsets."""
        known = [sigma.get(name, 0.0) for name in self._names]
        return np.array([*known, self._offsets(sigma)])

    def _offsets(self, sigma: Mapping[str, float]) -> float:
        """Return the torque that a standard deviation of the sensor offsets makes."""
        total = 0.0
        for k, bias in self._biased:
            total += (self._weights[k] * self._terms[1][k] * sigma.get(bias, 0.0)) ** 2
        return math.sqrt(total)
