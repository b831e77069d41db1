"""How the parameters of one model spread over many motors, and which motors are odd in them."""

from collections.abc import Mapping
from dataclasses import dataclass
import math

import numpy as np

from motor_sysid.diagnosis.result.figures import with_unit
from motor_sysid.fleet.odd import mean_and_scatter, odd_ones
from motor_sysid.physics.model import Model
from motor_sysid.physics.parameters import Parameter

ALPHA = 0.01
"""Chance of any odd parameter in a fleet whose motors are alike."""


@dataclass(frozen=True)
class Strange:
    """A motor whose parameter lies where those of the others do not.

    Attributes
    ----------
    name:
        Of the motor.
    value, sigma:
        Of its parameter.
    p_value:
        Chance of any so distant one among as many motors that are alike.
    """

    name: str
    value: float
    sigma: float
    p_value: float


@dataclass(frozen=True)
class Spread:
    """One parameter over the fleet.

    Attributes
    ----------
    parameter, unit, description:
        Its name, SI unit and meaning.
    mean:
        Of the motors that are not odd: the geometric one where `relative`.
    scatter:
        Standard deviation from motor to motor, beyond the standard errors; of the logarithm where
        `relative`.
    relative:
        Whether motors are compared by ratio: positive parameters are.
    values:
        Motor to value and standard error, for those of which the data tell it.
    odd:
        The odd ones, most distant first.
    """

    parameter: str
    unit: str
    description: str
    mean: float
    scatter: float
    relative: bool
    values: Mapping[str, tuple[float, float]]
    odd: tuple[Strange, ...]

    def words(self, one: Strange) -> str:
        """Return in words how far an odd one is off."""
        value, usual = with_unit(one.value, self.unit), with_unit(self.mean, self.unit)
        times = f', {one.value / self.mean:.3g} times as much' if self.relative else ''
        scatter = f'{100 * self.scatter:.2g} %' if self.relative else f'{self.scatter:.2g}'
        return (
            f'{self.description} ({self.parameter}) is {value}{times}; the others have {usual} '
            f'± {scatter} (p = {one.p_value:.1g})'
        )


def spreads(models: Mapping[str, Model], alpha: float = ALPHA) -> list[Spread]:
    """Return how each parameter spreads over the fleet, and which motors are odd in it.

    Parameters
    ----------
    models:
        Motor to its model; all have one structure.
    alpha:
        Chance that any motor is called odd in any parameter though all are alike.
    """
    names = dict.fromkeys(p.name for model in models.values() for p in model.parameters if p.free)
    told = {name: _told(models, name) for name in names}
    told = {name: found for name, found in told.items() if len(found) > 1}
    return [_spread(name, found, alpha / len(told)) for name, found in told.items()]


def _told(models: Mapping[str, Model], name: str) -> dict[str, Parameter]:
    """Return the parameter of each motor whose data tell it."""
    found = {m: model.parameters[name] for m, model in models.items() if name in model.parameters}
    return {m: p for m, p in found.items() if p.sigma is not None and math.isfinite(p.sigma)}


def _spread(name: str, found: Mapping[str, Parameter], level: float) -> Spread:
    motors, first = list(found), next(iter(found.values()))
    value = np.array([found[m].value for m in motors])
    sigma = np.array([found[m].sigma or 0.0 for m in motors])
    relative = first.logarithmic or bool(np.all(value > 0) and first.lower >= 0)
    x, s = (np.log(value), sigma / value) if relative else (value, sigma)
    odd = odd_ones(x.tolist(), s.tolist(), level)
    usual = [j for j in range(len(motors)) if j not in {one.index for one in odd}]
    mean, scatter = mean_and_scatter(x[usual], s[usual])
    strange = [Strange(motors[o.index], *_of(found[motors[o.index]]), o.p_value) for o in odd]
    return Spread(
        name, first.unit, first.description, math.exp(mean) if relative else mean, scatter,
        relative, {m: _of(p) for m, p in found.items()}, tuple(strange),
    )  # fmt: skip


def _of(parameter: Parameter) -> tuple[float, float]:
    return parameter.value, parameter.sigma or 0.0
