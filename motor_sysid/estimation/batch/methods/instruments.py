"""Rows of a free run of the model: what the signals are without their noise."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.methods.reference import moving_references, noise_free_input
from motor_sysid.estimation.batch.methods.rows import kept
from motor_sysid.estimation.online.equation import offsets
from motor_sysid.estimation.online.regressions import filter_bandwidth
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]


def simulated(record: Record, model: Model, outputs: Sequence[str], *, reference: bool) -> Record:
    """Return the record with simulated outputs.

    With `reference` the input is what the reference alone explains of it: the recorded one of a
    closed loop carries the noise of the sensors.
    """
    driven = noise_free_input(record, model.kind) if reference else record
    run = simulate(model, driven, follow_position=False).outputs
    for name in outputs:
        driven = driven.with_signal(name, run[name], record.units[name])
    return driven


def instrument_rows(
    model: Model, k: int, records: Sequence[Record], outputs: Sequence[str]
) -> tuple[Array, Array]:
    """Return (K, d) regressors and (K,) values of balance k in the free run of a model."""
    closed = all(moving_references(record) for record in records)
    clean = [simulated(r, model, outputs, reference=closed) for r in records]
    balance = model.kind.balances[k]
    offset = offsets(model, model.kind.balances)[k]
    width = filter_bandwidth(model, records[0].dt)
    return kept(model, balance, offset, clean, outputs, width)[1].data
