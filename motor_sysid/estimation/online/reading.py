"""What sensors show beside their states and offsets: the sensor laws of a model's effects."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.online.laws import evaluate_columns, LawColumns
from motor_sysid.machine_code import kept
from motor_sysid.physics.lanes import FIRST_PARAMETER_ROW
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Table = tuple[Array, int, Integers, Integers, Integers, Array]

_AT, _CHANNEL = 0, 1
_ROW, _SIGNAL = 0, 1
_STEP = 1e-4


def readings(
    model: Model, outputs: Sequence[str], index: Mapping[str, int], own: Sequence[str] = ()
) -> Table:
    """Return the sensor laws of some outputs, as `add_shown` takes them.

    A sensor with a memory, such as a filter, takes part where its state is among the signals.

    Parameters
    ----------
    model:
        The model.
    outputs:
        Measured signals.
    index:
        Where estimated parameters lie in the state of the filter.
    own:
        Own states of effects that follow those of the motor among the signals.

    Returns
    -------
    The table of the laws (see `LawColumns`); (2, C) where the factor of each column lies in the
    filter's state (-1: nowhere) and the output that it belongs to; (C,) factors that are held.
    """
    sensors = [f'{signal}_sensor' for signal in outputs]
    laws = LawColumns(model, sensors, (*model.kind.states, *own), memory=False)
    at = [index.get(c.name, -1) for c in laws.columns]
    channel = [sensors.index(c.target) for c in laws.columns]
    factors = [model[c.name] if c.name else 1.0 for c in laws.columns]
    return *laws.table, np.array([at, channel], dtype=np.int64), np.array(factors, dtype=float)


def sensor_lags(model: Model, outputs: Sequence[str]) -> dict[str, float]:
    """Return the time constants (s) of filters of sensors, by the state that the sensor shows.

    Raises
    ------
    UserError
        If a sensor has another memory: what it shows cannot be undone.
    """
    lags: dict[str, float] = {}
    for one in map(model.effect, model.effects):
        shown = [o.state for o in model.kind.outputs
                 if o.signal in outputs and f'{o.signal}_sensor' in one.laws]  # fmt: skip
        if shown and one.card.states and not one.card.filter:
            raise UserError(
                f'regressions cannot undo what the sensor does by `{one.key}`, which has a '
                'memory; use `ekf`, `ukf` or `mhe`, or in batch `least_squares`'
            )
        if one.card.filter:
            lags |= dict.fromkeys(shown, model[f'{one.key}.{one.card.filter}'])
    return lags


@kept(error_model='numpy')
def add_shown(buffer, base, calls, reads, columns, factors, signals, x, out):  # type: ignore[no-untyped-def]
    """Add to `out` (n_y,) what the laws show, with factors from the filter's state `x` (d,).

    `signals` begin with the states of the motor.
    """
    if factors.size == 0:
        return
    values = np.empty(factors.size)
    evaluate_columns(buffer, base, calls, reads, signals, values)
    for c in range(factors.size):
        at = columns[_AT, c]
        factor = x[at] if at >= 0 else factors[c]
        out[columns[_CHANNEL, c]] += values[c] * factor


@kept(error_model='numpy')
def shown_slopes(buffer, base, calls, reads, columns, factors, x, state, shown, slopes):  # type: ignore[no-untyped-def]
    """Set what the laws show, (n_y,), and its slopes, (n_y, d), at a filter's state `x` (d,).

    `state` (n_y,) is the state that each output shows; the slopes by it and by own states of
    effects are forward differences.
    """
    shown[:] = 0.0
    slopes[:] = 0.0
    if factors.size == 0:
        return
    values, ahead, moved = np.empty(factors.size), np.empty(shown.size), x.copy()
    add_shown(buffer, base, calls, reads, columns, factors, x, x, shown)
    for j in range(shown.size):
        step = _STEP * (1.0 + abs(x[state[j]]))
        moved[state[j]] = x[state[j]] + step
        ahead[:] = 0.0
        add_shown(buffer, base, calls, reads, columns, factors, moved, moved, ahead)
        moved[state[j]] = x[state[j]]
        slopes[j, state[j]] = (ahead[j] - shown[j]) / step
    for r in range(reads.shape[0]):
        if reads[r, _ROW] < FIRST_PARAMETER_ROW:
            continue
        own = reads[r, _SIGNAL]
        step = _STEP * (1.0 + abs(x[own]))
        moved[own] = x[own] + step
        ahead[:] = 0.0
        add_shown(buffer, base, calls, reads, columns, factors, moved, moved, ahead)
        moved[own] = x[own]
        for j in range(shown.size):
            slopes[j, own] = (ahead[j] - shown[j]) / step
    evaluate_columns(buffer, base, calls, reads, x, values)
    for c in range(factors.size):
        if columns[_AT, c] >= 0:
            slopes[columns[_CHANNEL, c], columns[_AT, c]] += values[c]
