"""One balance of a motor as a recursive regression on filtered signals.

The equation ``s drive + laws = sum of p term`` is divided by the parameter ``s`` of its drive,
which another equation gives; what is held goes to the known side.
"""

from collections.abc import Callable, Mapping, Sequence
import math
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.filters import StateVariableFilter
from motor_sysid.estimation.online.laws import LawColumns
from motor_sysid.estimation.online.regression import Regression
from motor_sysid.estimation.online.regressors import End, RAW
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import Balance, Term

Array = NDArray[np.float64]
Found = tuple[float, float]

_SETTLING = 8.0
_BLOCK = 6.0
_STEP = 0.5
_EXACT = 1e-3
"""What straight lines between samples are good for, relative."""


class Equation:
    """A recursive regression of one balance.

    Parameters
    ----------
    model:
        The model.
    balance:
        One of its motor's balances.
    offset:
        Biased state to the free parameter that is its sensor's offset, where this equation is to
        estimate it: the state's terms then bring a constant.
    dt, bandwidth, memory:
        Sample time in s, corner of the filter in rad/s, time of forgetting in s.

    Attributes
    ----------
    names:
        Parameters that it estimates, in the order of the columns, without the offset.
    """

    def __init__(
        self,
        model: Model,
        balance: Balance,
        offset: Mapping[str, str],
        dt: float,
        bandwidth: float,
        memory: float,
    ) -> None:
        self._model, self._balance, self._w = model, balance, bandwidth
        self._laws = [
            LawColumns(model, effect(key), balance.force)
            for key in model.effects
            if balance.force in effect(key).laws
        ]
        free = model.parameters
        self._free = [t for t in balance.terms if free[t.parameter].free]
        self._held = [t for t in balance.terms if not free[t.parameter].free]
        self._biased = [k for k, t in enumerate(self._free) if _offset_of(t, offset)]
        self._offset = _offset_of(self._free[self._biased[0]], offset) if self._biased else ''
        self._read = {state: RAW + state for state in offset}
        laws = [name for law in self._laws for name in law.names]
        self.names = (*(t.parameter for t in self._free), *laws)
        self._every = max(round(_STEP / (bandwidth * dt)), 1)
        self._block = max(round(max(_BLOCK / bandwidth, memory / 100) / dt / self._every), 2)
        self._forget = math.exp(-self._every * dt / memory)
        columns = len(balance.terms) + sum(len(law.names) + 1 for law in self._laws)
        self._filter = StateVariableFilter(1 + columns, bandwidth)
        self._row_of = self._reader((balance.drive, *self._held, *self._free))
        self._slopes = np.array(
            [0, *(1 + k for k, t in enumerate([*self._held, *self._free]) if t.derivative)]
        )[1:]
        self._regression: Regression | None = None
        self._prior: Mapping[str, float] = {}
        self._waiting, self._count = math.inf, 0

    def needs(self) -> set[str]:
        """Return the states and inputs that the equation reads."""
        terms = [self._balance.drive, *self._balance.terms]
        read = {signal for term in terms for signal in term.signals}
        return read.union(*(law.needs for law in self._laws))

    def restart(self, end: End) -> None:
        """Settle the filters at the present signals."""
        self._filter.start(self._row(end))
        self._waiting = _SETTLING / self._w

    def step(
        self, first: End, last: End, h: float, drive: float, prior: Mapping[str, float]
    ) -> None:
        """Take one sample.

        Parameters
        ----------
        first, last:
            Signals at its start and end.
        h:
            Its length in s.
        drive:
            Present estimate of the drive's parameter (1 if it has none).
        prior:
            Parameter name to standard deviation before any data.
        """
        self._filter.step(self._row(first), self._row(last), h)
        for law in self._laws:
            law.advance(last.tracked, h)
        self._waiting -= h
        self._count += 1
        if self._waiting > 0 or self._count % self._every:
            return
        filtered = self._filter.value.copy()
        filtered[self._slopes] = self._filter.slope[self._slopes]
        x, y = self._split(filtered, drive)
        self._ready(drive, prior).update(x, y)

    def _row(self, end: End) -> Array:
        """Return drive, held and free terms, and of each law the free part, then the held."""
        values = self._row_of(end.measured)
        if not self._laws:
            return np.array(values)
        return np.concatenate([values, *(law.values(end.tracked) for law in self._laws)])

    def _reader(self, terms: Sequence[Term]) -> Callable[[Mapping[str, float]], list[float]]:
        """Return what reads the values of the terms from the signals."""
        names = [tuple(self._read.get(name, name) for name in term.signals) for term in terms]
        factors = [math.prod(self._model[name] for name in term.factors) for term in terms]
        if all(len(read) == 1 for read in names) and all(f == 1.0 for f in factors):
            get = itemgetter(*(read[0] for read in names), names[0][0])
            return lambda signals: list(get(signals)[:-1])

        def read(signals: Mapping[str, float]) -> list[float]:
            pairs = zip(names, factors, strict=True)
            return [math.prod((signals[n] for n in given), start=f) for given, f in pairs]

        return read

    def _split(self, filtered: Array, drive: float) -> tuple[Array, float]:
        """Return the regressors and the known side, divided by the drive's parameter."""
        first = 1 + len(self._held)
        held = [self._model[t.parameter] for t in self._held]
        y = filtered[0] - float(filtered[1:first] @ np.array(held)) / drive
        at = first + len(self._free)
        columns = [filtered[first:at]]
        for law in self._laws:
            columns.append(-filtered[at : at + len(law.names)])
            y += filtered[at + len(law.names)] / drive
            at += len(law.names) + 1
        if self._offset:
            columns.append(np.ones(1))
        return np.concatenate(columns), float(y)

    def _ready(self, drive: float, prior: Mapping[str, float]) -> Regression:
        """Return the regression, made at the first sample and widened as priors grow."""
        if self._regression is not None and prior is self._prior:
            return self._regression
        self._prior = prior
        sigma = np.array([prior[name] for name in self.names]) / drive
        start = np.array([self._model[name] for name in self.names]) / drive
        if self._offset:
            lever = float(start[self._biased].sum())
            start = np.append(start, -lever * self._model[self._offset])
            sigma = np.append(sigma, lever * prior[self._offset])
        if self._regression is None:
            self._regression = Regression(start, sigma, self._forget, self._block)
        else:
            self._regression.widen(sigma)
        return self._regression

    def found(self, drive: Found) -> dict[str, tuple[float, float, float]]:
        """Return parameter name to (value, sigma, prior sigma), once there are data.

        Parameters
        ----------
        drive:
            Value and standard deviation of the drive's parameter.
        """
        regression = self._regression
        if regression is None:
            return {}
        c, covariance = regression.coefficients, regression.covariance()
        scale, spread = drive
        result = {}
        for k, name in enumerate(self.names):
            value = float(c[k] * scale)
            spreads = (scale * math.sqrt(covariance[k, k]), c[k] * spread, _EXACT * value)
            result[name] = (value, math.hypot(*spreads), float(regression.prior[k] * scale))
        if self._offset:
            result[self._offset] = self._found_offset(c, covariance, regression.prior)
        return result

    def _found_offset(
        self, c: Array, covariance: Array, prior: Array
    ) -> tuple[float, float, float]:
        """Return the offset: the constant over the coefficients that it acts through."""
        lever = float(c[self._biased].sum())
        lever = math.copysign(max(abs(lever), 1e-12), lever)
        value = -float(c[-1]) / lever
        slope = np.zeros(c.size)
        slope[-1] = -1.0 / lever
        slope[self._biased] = float(c[-1]) / lever**2
        sigma = math.sqrt(max(float(slope @ covariance @ slope), 0.0))
        return value, sigma, float(prior[-1]) / abs(lever)

    def covariance(self) -> Array:
        """Return the covariance of the coefficients, or an empty array before any data."""
        return self._regression.covariance() if self._regression else np.empty((0, 0))


def _offset_of(term: Term, offset: Mapping[str, str]) -> str:
    if term.derivative or len(term.signals) != 1:
        return ''
    return offset.get(term.signals[0], '')


def offsets(model: Model, balances: Sequence[Balance]) -> list[dict[str, str]]:
    """Return for each balance the offsets that it is to estimate: the first one with such a term.

    Returns
    -------
    State to parameter name, one mapping a balance.
    """
    open_ones = {
        o.state: o.bias for o in model.kind.outputs if o.bias and model.parameters[o.bias].free
    }
    chosen: list[dict[str, str]] = []
    for balance in balances:
        here = {
            state: bias
            for state, bias in open_ones.items()
            if any(_offset_of(t, {state: bias}) for t in balance.terms)
        }
        chosen.append(here)
        open_ones = {s: b for s, b in open_ones.items() if s not in here}
    return chosen
