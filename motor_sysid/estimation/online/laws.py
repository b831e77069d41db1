"""The columns that the effects of a model add to one of its equations.

A law is linear in its amplitudes: its regressors are its values with one amplitude at one and the
others at zero.
"""

from collections.abc import Mapping
import inspect

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.effect import Effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]


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
        Its free amplitudes, as parameters of the model.
    needs:
        States and inputs that its laws read.
    """

    def __init__(self, model: Model, effect: Effect, force: str) -> None:
        self._law, self._rates = effect.laws[force], effect.rates
        self._memory = dict.fromkeys(effect.card.states, 0.0)
        parameters = model.parameters
        own = [p.name for p in effect.card.parameters]
        amplitudes = [p.name for p in effect.card.amplitudes]
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
        everything = {**self._known, **self._memory, **signals}
        found = self._law(*(everything[name] for name in self._arguments))
        return np.broadcast_to(np.asarray(found, dtype=np.float64), (len(self.names) + 1,))

    def advance(self, signals: Mapping[str, float], h: float) -> None:
        """Carry the effect's own states on by `h` s."""
        everything = {**self._known, **self._memory, **signals}
        for state, rate in self._rates.items():
            slope = rate(*(everything[name] for name in self._rate_arguments[state]))
            self._memory[state] += h * float(np.max(slope))
