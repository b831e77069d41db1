"""What models of sister motors say of a motor of the same kind before it was measured."""

from collections.abc import Mapping, Sequence

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.prior import coordinate, coordinate_sigma, Prior
from motor_sysid.physics.effect import Enters
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.parameters import Parameter

SPREAD = 0.1
"""Relative standard deviation of a motor's parameters about those of its type."""

STATED = 3.0
"""Motors that the stated spread counts for, beside the spread that a fleet shows."""


def believed(
    sisters: Sequence[Model], spread: float = SPREAD, spreads: Mapping[str, float] | None = None
) -> tuple[Model, Prior]:
    """Return the mean of sister models, and the prior of a further motor of their type.

    A parameter is normally distributed about the mean of its type (its logarithm, if it is
    positive).  With m sisters the next motor differs from their mean with the variance
    ``(1 + 1/m) s^2``; ``s^2`` is the conjugate estimate from the stated spread, worth `STATED`
    motors, and from what the sisters show (Gelman et al., Bayesian Data Analysis, 2013,
    section 3.3).  The sisters' own standard errors come on top.  What is no property of the motor
    (see `of_the_motor`) has no prior, and neither has what a sister's data did not tell.

    Parameters
    ----------
    sisters:
        Models of one kind with the same effects.
    spread:
        Relative standard deviation of a motor about its type.
    spreads:
        The same for single parameters by name.

    Raises
    ------
    UserError
        If the models differ in kind or effects, or a spread is none.
    """
    first, own = _alike(sisters), dict(spreads or {})
    for name, value in {'spread': spread, **own}.items():
        if name != 'spread':
            first.parameters[name]
        if not 0.0 < value < 10.0:
            raise UserError(f'a spread of {value:g} ({name}) is none; give 0.1 for 10 %')
    means: dict[str, float] = {}
    variances: dict[str, float] = {}
    for p in of_the_motor(first):
        found = [m.parameters[p.name] for m in sisters]
        told = [q for q in found if q.sigma is None or np.isfinite(q.sigma)]
        if not told:
            continue
        mean, variance = _next(p, told, own.get(p.name, spread))
        if variance > 0:
            means[p.name], variances[p.name] = mean, variance
    boxes = {name: first.parameters[name] for name in means}
    values = {n: np.exp(v) if boxes[n].logarithmic else v for n, v in means.items()}
    model = first.with_values({n: float(v) for n, v in values.items()})
    precision = np.diag(1.0 / np.array(list(variances.values())))
    return model, Prior(tuple(means), np.array(list(means.values())), precision)


def of_the_motor(model: Model) -> tuple[Parameter, ...]:
    """Return the free parameters that belong to the motor, not to sensors or their mounting.

    Of the motor's own parameters those that may be negative are offsets; effects say where they
    enter.
    """
    sensors = [key for key in model.effects if effect(key).card.enters is Enters.SENSOR]
    own = {p.name for p in model.kind.parameters}
    return tuple(
        p
        for p in model.parameters.free
        if (p.logarithmic or p.name not in own) and p.name.split('.')[0] not in sensors
    )


def _alike(sisters: Sequence[Model]) -> Model:
    """Return the first of models that have the same parameters."""
    if not sisters:
        raise UserError('no sister model; give at least one')
    first = sisters[0]
    for other in sisters[1:]:
        if other.motor != first.motor or set(other.effects) != set(first.effects):
            names = [' + '.join([m.motor, *m.effects]) for m in (first, other)]
            raise UserError(
                f'sisters must be of one kind with the same effects; these are {names[0]} and '
                f'{names[1]}: fit both with the same `--effect`'
            )
    return first


def _next(p: Parameter, told: Sequence[Parameter], spread: float) -> tuple[float, float]:
    """Return mean and variance of the coordinate of a further motor's parameter."""
    places = np.array([coordinate(q, q.value) for q in told])
    stated = spread if p.logarithmic else spread * float(np.max(np.abs(places)))
    count = places.size
    shown = float(np.sum((places - places.mean()) ** 2))
    square = (STATED * stated**2 + shown) / (STATED + count - 1)
    own = float(np.mean([coordinate_sigma(q) ** 2 for q in told])) / count
    return float(places.mean()), (1 + 1 / count) * square + own
