"""Have compiled code on disk before a node needs it: numba keeps what it has compiled."""

from collections.abc import Sequence

import numpy as np

from motor_sysid.estimation.batch import refit
from motor_sysid.estimation.online import OnlineIdentifier
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.physics.stepper import Stepper
from motor_sysid.signals.record import Record

_ROWS = 60


def compile_nodes(
    model: Model, estimators: Sequence[str], dt: float, hidden: Sequence[str]
) -> None:
    """Compile what identifier and simulated motor call.

    Parameters
    ----------
    model:
        Where the identifier starts.
    estimators:
        Keys of the online estimators.
    dt:
        Sample time in s.
    hidden:
        Effects that the simulated motor has and the model lacks.
    """
    outputs = tuple(output.signal for output in model.kind.outputs)
    for key in estimators:
        OnlineIdentifier(model, key, dt, model.kind.inputs[0], outputs).estimate()
    for key in hidden:
        model = model.with_effect(key)
    Stepper(model, dt).step([0.0] * len(model.kind.arguments))


def compile_refits(model: Model, dt: float) -> None:
    """Compile what a refit calls, by one of some samples."""
    time = dt * np.arange(_ROWS, dtype=np.float64)
    wave = np.sin(time / (10 * dt))
    units = {'voltage': 'V', 'force': 'N', 'torque': 'N m'}
    inputs = model.kind.inputs[0]
    named = {name: units[name.split('_')[0]] for name in inputs}
    record = Record(time, dict.fromkeys(inputs, wave), named)
    for signal, values in simulate(model, record, follow_position=False).outputs.items():
        unit = {'speed': 'rad/s', 'position': 'rad'}.get(signal, 'A')
        record = record.with_signal(signal, values, unit)
    refit(model, record, 'least_squares')
