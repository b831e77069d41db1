"""The angle of the shaft where nothing but a speed is measured: its sum, less what it is off.

A sensor that shows a speed at standstill adds up to a turn that nobody made, and one that is late
to an angle that lags behind.  Waves over the angle would be lost in both.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.physics.drive import Drive
from motor_sysid.physics.effect import ARGUMENTS, arguments, Effect, SUM
from motor_sysid.physics.lanes import ROW_OF_FORCE
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.native import call_lanes, inlined, LANES
from motor_sysid.physics.readings import NOTHING
from motor_sysid.physics.vector import get, put, spread

Array = NDArray[np.float64]

SUMMED, SHOWN = ARGUMENTS.index('summed') * LANES, ARGUMENTS.index('shown') * LANES
TIME, BEYOND = ARGUMENTS.index('t') * LANES, ROW_OF_FORCE[SUM] * LANES


@inlined
def straightened(p, base, calls, lag, way, dt, begins):  # type: ignore[no-untyped-def]
    """Return the cubic of a sample without what the sum that it follows has beyond the angle.

    `calls` (K, 3) are the laws of that, and `lag` the row of the time constant of a filter that
    takes sample by sample, or negative; see `motor_sysid.physics.track` for the cubic.
    """
    here, step, bends, ends = way
    first = _beyond(p, base, calls, lag, here, (step - 0.5 * bends) / dt, dt, begins)
    last = _beyond(p, base, calls, lag, here + step, (step + 0.5 * ends) / dt, dt, begins + dt)
    return here - first, step - (last - first), bends, ends


@inlined
def _beyond(p, base, calls, lag, summed, shown, dt, time):  # type: ignore[no-untyped-def]
    put(p, SUMMED, summed)
    put(p, SHOWN, shown)
    put(p, TIME, time)
    put(p, BEYOND, spread(0.0))
    for k in range(calls.shape[0]):
        call_lanes(calls[k, 0], base, calls[k, 1], calls[k, 2])
    found = get(p, BEYOND)
    if lag >= 0:
        found = found - shown * kept_back(get(p, lag * LANES), dt)
    return found


@inlined
def kept_back(lag, dt):  # type: ignore[no-untyped-def]
    """Return how late (s) the sum is of what passes a filter sample by sample.

    The outputs y of ``y' = y + (1 - exp(-dt / lag)) (d - y)`` add up to the sum of the d less that
    time by the last y.
    """
    return dt / (np.exp(dt / (lag + NOTHING)) - 1.0)


def is_stepwise(one: Effect, sensor: SpeedSensor) -> bool:
    """Whether an effect is a filter that such a speed sensor takes sample by sample."""
    return one.filters_speed and sensor is not SpeedSensor.IDEAL


def summing(one: Effect, sensor: SpeedSensor) -> Effect:
    """Return an effect with its law of the sum only if it is such with that speed sensor."""
    return replace(one, speed_sum=None) if is_stepwise(one, sensor) else one


def seen_by(model: Model, drive: Drive) -> Drive:
    """Return a drive with the position that a model takes the measured one for.

    That is the measured one itself, or the sum of the speed as its speed sensor shows it.
    """
    told = drive.told_by(model.speed_sensor)
    if not drive.ahead.size:
        return told
    dt, size = drive.dt, len(told.position)
    shown = np.gradient(told.position, dt) if size > 1 else np.zeros(size)
    known = {'summed': told.position, 'shown': shown, 't': drive.start + dt * np.arange(size)}
    position = told.position
    with np.errstate(over='ignore'):  # what passes a filter of no time is late by nothing
        for one in map(model.effect, model.effects):
            own = {p.name: model[f'{one.key}.{p.name}'] for p in one.card.parameters}
            if is_stepwise(one, model.speed_sensor):
                position = position + shown * kept_back(own[one.card.filter], dt)
            elif one.speed_sum is not None:
                given = {**known, **model.parameters.values(), **own}
                position = position - one.speed_sum(*[given[n] for n in arguments(one.speed_sum)])
    return replace(told, position=position)
