"""What may not be the same in all records: parameters, the strength of the input, offsets.

The search for what differs asks how the outputs of each record change with it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.where.other_values import slopes_by_input
from motor_sysid.estimation.batch import Linearization, Problem
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import Motor
from motor_sysid.physics.parameters import Parameter
from motor_sysid.physics.scales import Scales

Array = NDArray[np.float64]

INPUT = 'input'
"""In place of a parameter's name: what all inputs are multiplied by."""

OF_THE_DAY = 'constant_load_torque', 'speed_sensor_offset'
"""Effects that may come with a record, though no model has them: what hangs on the shaft that
day, and where a tachometer's zero is."""

FARTHEST = 2.0
"""Largest step in the logarithm of a value."""


@dataclass(frozen=True)
class Direction:
    """Something that may have a value of its own in each record.

    Attributes
    ----------
    name:
        Of a parameter, or `INPUT`.
    columns:
        (N, n_y) derivatives of the outputs by its coordinate, one for each scored stretch.
    value, unit:
        In the model, and the derivative of the value by its coordinate there.
    logarithmic:
        Whether the coordinate is the logarithm of the value.
    common:
        Number of the coordinate that moves it in all records; None where the model has none.
    joins:
        Whether it has to be given a coordinate for all records: the model does not know of it.
    """

    name: str
    columns: Sequence[Array]
    value: float
    unit: float
    logarithmic: bool
    common: int | None = None
    joins: bool = False

    def values(self, steps: Array) -> Array:
        """Return the values that steps of the coordinate lead to."""
        if self.logarithmic:
            return np.asarray(self.value * np.exp(np.clip(steps, -FARTHEST, FARTHEST)))
        return np.asarray(self.value + self.unit * steps)


def directions(
    problem: Problem, near: Sequence[Linearization], scales: Scales | None
) -> Iterator[Direction]:
    """Yield all that may differ between the records of a fitted problem.

    Parameters
    ----------
    problem, near:
        The fitted model with all records, and its derivatives.
    scales:
        Sizes of the signals.
    """
    inputs = [slope[..., 0] for slope in slopes_by_input(problem)]
    yield Direction(INPUT, inputs, 1.0, 1.0, logarithmic=True)
    units = problem.slope(problem.vector())
    for k, one in enumerate(problem.free):
        if is_own(one, problem.model):
            columns = [part.slope[..., k] for part in near]
            yield Direction(
                one.name, columns, one.value, float(units[k]), one.logarithmic, common=k
            )
    for key in OF_THE_DAY:
        if key not in problem.model.effects and problem.model.admits(effect(key)):
            yield _of_the_day(problem, key, scales)


def is_own(parameter: Parameter, model: Model) -> bool:
    """Whether a parameter is the motor's own, or the size of an effect: shapes do not differ."""
    key, _, name = parameter.name.partition('.')
    if not name:
        return True
    return name in {amplitude.name for amplitude in effect(key).card.amplitudes}


def shown_by(name: str, kind: Motor) -> str:
    """Return the signal that a parameter is the offset of; nothing if it is none."""
    own = {output.bias: output.signal for output in kind.outputs if output.bias}
    return {**own, 'speed_sensor_offset.o': 'speed'}.get(name, '')


def with_own(model: Model, name: str, scales: Scales | None) -> Model:
    """Return a model that has a parameter, at zero if it had none, and no other one free."""
    key, _, parameter = name.partition('.')
    if parameter and key not in model.effects:
        model = model.with_effect(key, scales=scales)
    model = model.with_free([p.name for p in model.parameters.free], free=False)
    return model.with_free([name])


def _of_the_day(problem: Problem, key: str, scales: Scales | None) -> Direction:
    """Return the direction of an effect that the model does not have."""
    (amplitude,) = effect(key).card.amplitudes
    name = f'{key}.{amplitude.name}'
    model = with_own(problem.model, name, scales)
    alone = Problem(model, problem.chains, problem.outputs, substeps=problem.substeps)
    z = alone.vector()
    columns = [part.slope[..., 0] for part in alone.linearize(z)]
    return Direction(
        name, columns, 0.0, float(alone.slope(z)[0]), logarithmic=False, joins=True
    )
