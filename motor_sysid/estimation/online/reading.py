"""What a sensor shows beside its state and offset: the sensor laws of a model's effects."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.online.laws import LawColumns
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

_STEP = 1e-4


class Reading:
    """The laws of one sensor that have no state of their own; filters in sensors are not undone.

    Parameters
    ----------
    model:
        The model.
    signal, state:
        Output signal, and the state that it shows.
    index:
        Where estimated parameters lie in the state of the filter.
    """

    def __init__(
        self, model: Model, signal: str, state: str, index: Mapping[str, int]
    ) -> None:
        law = f'{signal}_sensor'
        self._laws = [
            LawColumns(model, effect(key), law)
            for key in model.effects
            if law in effect(key).laws and not effect(key).card.states
        ]
        self._state, self._index = state, index
        names = [name for one in self._laws for name in one.names]
        self._values = {name: model[name] for name in names}

    def __bool__(self) -> bool:
        """Tell whether there is any law."""
        return bool(self._laws)

    def shown(self, signals: Mapping[str, float], x: Array) -> float:
        """Return what the laws add to the signal, with parameters from the filter's state `x`."""
        total = 0.0
        for law in self._laws:
            columns = law.values(signals)
            total += float(columns[-1])
            for name, column in zip(law.names, columns.tolist(), strict=False):
                at = self._index.get(name)
                total += column * (self._values[name] if at is None else float(x[at]))
        return total

    def slopes(self, signals: Mapping[str, float], x: Array) -> tuple[float, dict[int, float]]:
        """Return the derivative by the state shown, and by estimated parameters (index: value)."""
        step = _STEP * (1.0 + abs(signals[self._state]))
        ahead = self.shown({**signals, self._state: signals[self._state] + step}, x)
        by_state = (ahead - self.shown(signals, x)) / step
        by_parameter = {
            self._index[name]: float(column)
            for law in self._laws
            for name, column in zip(law.names, law.values(signals), strict=False)
            if name in self._index
        }
        return by_state, by_parameter
