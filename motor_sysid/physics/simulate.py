"""A model run freely over a record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.drive import Drive
from motor_sysid.physics.model import Model
from motor_sysid.physics.rollout import Program
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trajectory:
    """A simulated run: (N,) time in s and output signal to (N,) values, free of noise."""

    time: Array
    outputs: Mapping[str, Array]


def simulate(
    model: Model,
    record: Record,
    outputs: Sequence[str] | None = None,
    *,
    initial: Mapping[str, float] | None = None,
    follow_position: bool = True,
    substeps: int = 1,
) -> Trajectory:
    """Run a model freely from the recorded input.

    Parameters
    ----------
    model:
        The model.
    record:
        Inputs, and the measured position if laws are to follow it; resampled if not uniform.
    outputs:
        Signals to predict; by default all that the motor kind can.
    initial:
        State name to initial value; by default rest at the recorded position.
    follow_position:
        Whether laws see the measured position (default) or the simulated one.
    substeps:
        Integration steps per sample, shorter at its start; a three-phase motor takes more of them
        by itself where it turns fast.
    """
    even = record.uniform()
    signals = tuple(outputs or (o.signal for o in model.kind.outputs))
    program = Program.of(model, signals)
    drive = Drive.of(even, model.kind, follow_position=follow_position)
    start = {'theta': even['position'][0]} if 'position' in even else {}
    start.update(initial or {})
    state = np.array([start.get(name, 0.0) for name in model.kind.states])
    values = {name: np.array([value]) for name, value in model.parameters.values().items()}
    run = program.run(values, drive, state, substeps=substeps)
    return Trajectory(even.time, {s: run[:, j, 0] for j, s in enumerate(signals)})
