"""One balance of a motor as a recursive regression on filtered signals.

The equation ``s drive + laws = sum of p term`` is divided by the parameter ``s`` of its drive,
which another equation gives; what is held goes to the known side.
"""

from collections.abc import Mapping, Sequence
from itertools import count
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.filters import advance, StateVariableFilter
from motor_sysid.estimation.online.laws import evaluate_columns, LawColumns
from motor_sysid.estimation.online.learners.base import Learner
from motor_sysid.estimation.online.regressors import RAW, signal_names
from motor_sysid.machine_code import kept
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import Balance, Term

Array = NDArray[np.float64]
Found = tuple[float, float]

_SETTLING = 8.0
_BLOCK = 6.0
_STEP = 0.5
_EXACT = 3e-3
"""What straight lines between samples and noise in the regressors leave, relative: a bias, which
no amount of data takes away and no error of the equation shows."""


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
    learner:
        The rule by which it learns.

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
        learner: type[Learner],
    ) -> None:
        self._model, self._balance, self._learner = model, balance, learner
        signals = signal_names(model.kind)
        self._laws = LawColumns(model, [balance.force], signals)
        free = model.parameters
        self._free = [t for t in balance.terms if free[t.parameter].free]
        held = [t for t in balance.terms if not free[t.parameter].free]
        held += balance.given
        self._biased = [k for k, t in enumerate(self._free) if _offset_of(t, offset)]
        self._offset = _offset_of(self._free[self._biased[0]], offset) if self._biased else ''
        laws = [c.name for c in self._laws.columns if c.name]
        self.names = (*(t.parameter for t in self._free), *laws)
        self._every = max(round(_STEP / (bandwidth * dt)), 1)
        self._block = max(round(max(_BLOCK / bandwidth, memory / 100) / dt / self._every), 2)
        self._forget = math.exp(-self._every * dt / memory)
        terms = (balance.drive, *held, *self._free)
        factors = [math.prod((t.sign, *(model[name] for name in t.factors))) for t in terms]
        self._given = {1 + k: t.parameter for k, t in enumerate(held) if t in balance.given}
        self._terms = signal_places(terms, signals, offset), np.array(factors)
        self._roles, self._weights = self._columns(held)
        self._filter = StateVariableFilter(self._weights.size, bandwidth)
        self._regression: Learner | None = None
        self._prior: Mapping[str, float] = {}
        self._waiting, self._count = math.inf, 0
        self._compile()

    def _compile(self) -> None:
        """Compile what is not called before the filters have settled."""
        size = len(self.names) + bool(self._offset)
        scratch = self._learner(np.zeros(size), np.ones(size), 0.5, 2)
        ones = np.ones_like(self._weights)
        self._x = np.ones(size)
        scratch.update(self._x, _sort(ones, ones, self._roles, self._weights, 1.0, self._x))
        scratch.covariance()

    def _columns(self, held: Sequence[Term]) -> tuple[NDArray[np.int64], Array]:
        """Return the roles and weights of the filtered signals; see `_sort`."""
        number, laws = count(), self._laws.columns
        places = [-1] * (1 + len(held)) + [next(number) for _ in self._free]
        places += [next(number) if column.name else -1 for column in laws]
        derivatives = [False, *(t.derivative for t in (*held, *self._free))]
        derivatives += [False] * len(laws)
        weights = [1.0, *(-self._model[t.parameter] for t in held), *(1.0 for _ in self._free)]
        weights += [-1.0 if column.name else 1.0 for column in laws]
        return np.array([places, derivatives], dtype=np.int64), np.array(weights)

    def give(self, values: Mapping[str, float]) -> None:
        """Set parameters that other equations find."""
        for place, name in self._given.items():
            self._weights[place] = -values.get(name, self._model[name])
        self._laws.give(values)

    def needs(self) -> set[str]:
        """Return the states, inputs and derived signals that the equation reads."""
        terms = [self._balance.drive, *self._balance.terms, *self._balance.given]
        return {signal for term in terms for signal in term.signals} | self._laws.needs

    def restart(self, measured: Array, tracked: Array) -> None:
        """Settle the filters at the present signals (S,)."""
        self._laws.begin(tracked)
        row = np.empty(self._filter.value.size)
        fill_row(*self._terms, *self._laws.table, measured, tracked, row)
        self._filter.start(row)
        self._waiting = _SETTLING / self._filter.bandwidth

    def step(
        self,
        measured: Array,
        tracked: Array,
        h: float,
        drive: float,
        prior: Mapping[str, float],
    ) -> None:
        """Take one sample.

        Parameters
        ----------
        measured, tracked:
            (2, S) signals at its start and end; see `Regressors`.
        h:
            Its length in s.
        drive:
            Present estimate of the drive's parameter (1 if it has none).
        prior:
            Parameter name to standard deviation before any data.
        """
        f = self._filter
        _advance_filters(
            *self._terms, *self._laws.table, measured, tracked, f.value, f.slope, f.gains,
            f.bandwidth, h,
        )  # fmt: skip
        self._laws.advance(h)
        self._waiting -= h
        self._count += 1
        if self._waiting > 0 or self._count % self._every:
            return
        regression = self.learner(drive, prior)
        y = _sort(f.value, f.slope, self._roles, self._weights, drive, self._x)
        regression.update(self._x, y)

    def learner(self, drive: float, prior: Mapping[str, float]) -> Learner:
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
            self._regression = self._learner(start, sigma, self._forget, self._block)
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


def signal_places(
    terms: Sequence[Term], signals: Sequence[str], offset: Mapping[str, str]
) -> NDArray[np.int64]:
    """Return (T, M) where the signals of each term are, -1 where it has fewer."""
    width = max(len(term.signals) for term in terms)
    table = np.full((len(terms), width), -1, dtype=np.int64)
    for row, term in zip(table, terms, strict=True):
        read = [RAW + name if name in offset else name for name in term.signals]
        row[: len(read)] = [signals.index(name) for name in read]
    return table


@kept(error_model='numpy')
def fill_row(  # type: ignore[no-untyped-def]
    places, factors, buffer, base, calls, reads, measured, tracked, row
):
    """Write drive, held and free terms, and the columns of the laws (C,) at signals (S,)."""
    for t in range(factors.size):
        value = factors[t]
        for k in range(places.shape[1]):
            if places[t, k] >= 0:
                value *= measured[places[t, k]]
        row[t] = value
    evaluate_columns(buffer, base, calls, reads, tracked, row[factors.size :])


@kept(error_model='numpy')
def _advance_filters(  # type: ignore[no-untyped-def]
    places, factors, buffer, base, calls, reads, measured, tracked, value, slope, gains,
    bandwidth, h,
):  # fmt: skip
    """Take both ends (2, S) of a sample through the filters of all columns, in place."""
    first, last = np.empty(value.size), np.empty(value.size)
    laws = (buffer, base, calls, reads)
    fill_row(places, factors, *laws, measured[0], tracked[0], first)
    fill_row(places, factors, *laws, measured[1], tracked[1], last)
    advance(value, slope, gains, bandwidth, first, last, h)


@kept(error_model='numpy')
def _sort(value, slope, roles, weights, drive, x):  # type: ignore[no-untyped-def]
    """Return the known side, divided by the drive's parameter; set the regressors ``x`` (d,).

    Parameters
    ----------
    value, slope:
        (C,) filtered signals and their derivatives; the first is the drive.
    roles, weights:
        (2, C) place among the regressors (-1: on the known side) and whether the derivative is
        meant; (C,) factors.  A last regressor that no signal belongs to is a constant.
    """
    x[:] = 1.0
    y = value[0]
    for c in range(1, value.size):
        term = weights[c] * (slope[c] if roles[1, c] else value[c])
        if roles[0, c] >= 0:
            x[roles[0, c]] = term
        else:
            y += term / drive
    return y
