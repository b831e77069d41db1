"""The columns that the effects of a model add to one of its equations.

A law is linear in its amplitudes: its regressors are its values with one amplitude at one and the
others at zero.  (An amplitude that comes with values to try is not linear: it is held.)
"""

from collections.abc import Mapping
import inspect

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.effect import Effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

_ABSURD = 1e12


class LawColumns:
    """Regressors of one effect in one equation.

    Parameters
    ----------
    model, effect:
        The model, and one of its effects.
    force:
        Name of the equation that the effect has a law for.

    Attributes
    ----------
    names:
        Its free amplitudes in which it is linear, as parameters of the model.
    needs:
        States and inputs that its laws read.
    """

    def __init__(self, model: Model, effect: Effect, force: str) -> None:
        self._law, self._rates = effect.laws[force], effect.rates
        self._memory = dict.fromkeys(effect.card.states, 0.0)
        parameters = model.parameters
        own = [p.name for p in effect.card.parameters]
        amplitudes = [p.name for p in effect.card.amplitudes if not p.trials]
        free = [name for name in amplitudes if parameters[f'{effect.key}.{name}'].free]
        self.names = tuple(f'{effect.key}.{name}' for name in free)
        values = parameters.values()
        self._known: dict[str, float | Array] = {**values}
        for name in own:
            column = np.zeros(len(free) + 1)
            if name in free:
                column[free.index(name)] = 1.0
            else:
                column[-1] = values[f'{effect.key}.{name}']
            self._known[name] = column if name in amplitudes else values[f'{effect.key}.{name}']
        self._arguments = tuple(inspect.signature(self._law).parameters)
        self._rate_arguments = {
            state: tuple(inspect.signature(rate).parameters) for state, rate in self._rates.items()
        }
        self.needs = effect.needs() - set(values) - {'t'}

    def values(self, signals: Mapping[str, float]) -> Array:
        """Return the value of each free amplitude's column, and of what is held, (m + 1,)."""
        found = self._law(
            *(signals[n] if n in signals else self._own(n) for n in self._arguments)
        )
        column = np.asarray(found, dtype=np.float64)
        return column if column.ndim else np.full(len(self.names) + 1, found)

    def _own(self, name: str) -> float | Array:
        return self._memory[name] if name in self._memory else self._known[name]

    def advance(self, signals: Mapping[str, float], h: float) -> None:
        """Carry the effect's own states on by `h` s under held signals (Runge-Kutta 4)."""
        if not self._rates:
            return
        now = np.array(list(self._memory.values()))
        k1 = self._slope(now, signals)
        k2 = self._slope(now + 0.5 * h * k1, signals)
        k3 = self._slope(now + 0.5 * h * k2, signals)
        k4 = self._slope(now + h * k3, signals)
        after = now + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        if not np.all(np.abs(after) < _ABSURD):
            after = np.zeros_like(after)
        self._memory = dict(zip(self._memory, after.tolist(), strict=True))

    def _slope(self, memory: Array, signals: Mapping[str, float]) -> Array:
        own = dict(zip(self._memory, memory.tolist(), strict=True))
        everything = {**self._known, **own, **signals}
        rates = [
            rate(*(everything[name] for name in self._rate_arguments[state]))
            for state, rate in self._rates.items()
        ]
        return np.array([float(np.max(rate)) for rate in rates])
