"""Gains of a speed loop for the node `pid`, and how far the loop is from swinging.

The margins are those of the sampled loop: the linear motor with the input held, one sample from
measurement to command, what delays and filters the model has, and the controller as it runs.  They
are told at the model's values and at the worst of some hundred motors drawn from the standard
errors of the parameters.  (Astrom and Hagglund, Advanced PID Control, 2006, section 4.6.)
"""

from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray
import yaml

from motor_sysid.control.loop import SAMPLES, SETTLED, SLOWEST
from motor_sysid.control.pid import PidGains
from motor_sysid.control.tuning import current_pi, reduce_to_speed, speed_pi, torque_constant
from motor_sysid.errors import UserError
from motor_sysid.export import words
from motor_sysid.export.linear import DIFFERENCED, linear_plant
from motor_sysid.export.loads import stiff
from motor_sysid.export.rigid import Drive, drive
from motor_sysid.export.settings import Settings
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model, SpeedSensor

Array = NDArray[np.float64]

TITLE = 'gains of a speed loop with its margins (parameters of the node `pid`)'
SUFFIX = '.yaml'
USES = ('gear', 'supply', 'rate', 'closed_loop_time')

DRAWS, SEED = 200, 1
"""Motors drawn for the worst margins."""

_BELOW, _PER_DECADE = 1e-2, 1000
"""Lowest frequency looked at, over the crossover that is asked for; frequencies in a decade."""

_DELAYS = 4.0
"""Least time constant of the loop in delays of the input."""


@dataclass(frozen=True)
class Margins:
    """How far a loop is from swinging.

    Attributes
    ----------
    gain:
        Factor on the gain that makes it swing; infinite where none does.
    phase:
        Lag in degrees that makes it swing.
    crossover:
        The highest frequency where its gain falls below one, rad/s; half of the sample rate, with
        no phase left, where it never does.
    """

    gain: float
    phase: float
    crossover: float


def write(model: Model, settings: Settings) -> tuple[str, tuple[str, ...]]:
    """Return the text, and what is left out.

    Raises
    ------
    UserError
        If there is no rate, or the loop would swing.
    """
    if settings.rate is None:
        raise UserError('a controller runs in steps: give their number per second, --rate')
    dt, driven = 1.0 / settings.rate, drive(model)
    time = settings.closed_loop_time or _usual_time(model, dt)
    limit = settings.supply or math.inf
    gains = _gains(model, time, limit)
    own, worst = margins(model, gains, dt, time), worst_margins(model, gains, dt, time)
    if own.phase <= 0 or own.gain <= 1:
        raise UserError(
            f'a speed loop with a time constant of {time:.4g} s would swing at {settings.rate:g} '
            f'Hz (phase margin {own.phase:.0f} degrees, gain margin {own.gain:.3g}); give a '
            'longer --closed-loop-time or a higher --rate'
        )
    known = _command(driven, settings.supply)
    told = [
        *words.heading(model),
        *([] if known else ['the node `pid` commands no torque: these are for a loop of yours']),
        f'closed-loop time constant {time:.4g} s at {settings.rate:g} Hz; '
        f'command: {driven.signal} [{driven.unit}]',
        f'phase margin {own.phase:.0f} degrees, gain margin {own.gain:.3g}, '
        f'crossover {own.crossover:.4g} rad/s',
        f'worst of {DRAWS} motors within the standard errors: {worst.phase:.0f} degrees, '
        f'{worst.gain:.3g}',
        'pid_controller of ros2_controllers: p = kp, i = ki, d = kd',
    ]
    content = {
        'kp': settings.gear * gains.kp, 'ki': settings.gear * gains.ki, 'kd': gains.kd,
        **known,
    }  # fmt: skip
    text = ''.join(f'# {line}\n' for line in told)
    tree = {'/**': {'ros__parameters': content}}
    notes = (*linear_plant(_driven(model)).left_out, *_lost(model))
    notes = tuple(note for note in notes if note != DIFFERENCED)
    text += ''.join(f'# {line}\n' for line in words.left_out(notes))
    return text + yaml.safe_dump(tree, sort_keys=False), notes


def _command(driven: Drive, supply: float | None) -> dict[str, str | float]:
    """Return how the node `pid` is told what to command; it knows voltages and currents alone."""
    signal = driven.signal.partition('_')[0]
    if signal not in ('voltage', 'current'):
        return {}
    limit = {} if supply is None else {f'{signal}_limit': supply}
    return {'command': signal, **limit}


def margins(model: Model, gains: PidGains, dt: float, time: float = 1.0) -> Margins:
    """Return the margins of the loop that the gains make with a motor.

    Parameters
    ----------
    dt, time:
        Time of a sample, and wanted time constant of the loop, s.
    """
    top = math.pi / dt
    least = min(1e-4 * top, _BELOW / time)
    w = np.geomspace(least, top, math.ceil(_PER_DECADE * math.log10(top / least)))
    z = np.exp(1j * w * dt)
    loop = _plant(model, z, dt) * (gains.kp + gains.ki * dt * z / (z - 1.0)) / z
    size, turned = np.abs(loop), np.unwrap(np.angle(loop))
    turned -= 2 * math.pi * round(float(turned[0]) / (2 * math.pi) + 0.25)
    swings = np.flatnonzero(np.diff(np.floor((turned + math.pi) / (2 * math.pi))) < 0)
    gain = 1.0 / float(np.max(size[swings])) if swings.size else math.inf
    crossing = np.flatnonzero((size[:-1] >= 1) & (size[1:] < 1))
    if not crossing.size:
        return Margins(gain, 0.0, math.pi / dt)
    phases = 180.0 + np.degrees(turned[crossing])
    return Margins(gain, float(np.min(phases)), float(w[crossing[-1]]))


def worst_margins(model: Model, gains: PidGains, dt: float, time: float = 1.0) -> Margins:
    """Return the smallest margins among motors drawn from the standard errors."""
    random = np.random.default_rng(SEED)
    known = [p for p in model.parameters if p.free and p.sigma and math.isfinite(p.sigma)]
    found = [margins(model, gains, dt, time)]
    for _ in range(DRAWS if known else 0):
        drawn = {p.name: random.normal(p.value, p.sigma or 0.0) for p in known}
        inside = {p.name: min(max(drawn[p.name], p.lower), p.upper) for p in known}
        found.append(margins(model.with_values(inside), gains, dt, time))
    return Margins(
        min(one.gain for one in found), min(one.phase for one in found),
        max(one.crossover for one in found),
    )  # fmt: skip


def _usual_time(model: Model, dt: float) -> float:
    """Return a time constant that the motor follows without strain."""
    least = max(SAMPLES * dt, _DELAYS * linear_plant(_driven(model)).delay)
    if _by_current(model):
        return least
    reduced = reduce_to_speed(stiff(model))
    return max(min(reduced.time_constant, SLOWEST), SETTLED * reduced.neglected, least)


def _gains(model: Model, time: float, limit: float) -> PidGains:
    if _by_current(model):
        return current_pi(stiff(model)['J'], drive(model).torque, 1.0 / time, limit)
    return speed_pi(stiff(model), time, limit)


def _by_current(model: Model) -> bool:
    return len(model.kind.arguments) > 1


def _driven(model: Model) -> Model:
    """Return the model that has the command as input: with three phases, the axis behind it."""
    if not _by_current(model):
        return model
    values = {'J': model['J'], 'b': model['b'], 'gain': torque_constant(model)}
    axis = Model.base('mechanical_axis', values, speed_sensor=model.speed_sensor)
    for key in model.effects:
        if axis.admits(effect(key)):
            names = [p.name for p in effect(key).card.parameters]
            axis = axis.with_effect(key, {name: model[f'{key}.{name}'] for name in names})
    return axis


def _lost(model: Model) -> tuple[str, ...]:
    """Return what lies within the loop of the current, which is taken as settled."""
    axis = _driven(model)
    titles = [effect(key).card.title for key in model.effects if key not in axis.effects]
    return tuple(f'{title}: the loop of the current is taken as settled' for title in titles)


def _plant(model: Model, z: NDArray[np.complex128], dt: float) -> NDArray[np.complex128]:
    """Return what the speed sensor shows of the command, at points on the unit circle."""
    plant = linear_plant(_driven(model))
    row = plant.c[[name for name, _ in plant.outputs].index('speed')]
    still = [j for j, (name, _) in enumerate(plant.states) if name != 'theta']
    a, b = plant.held(dt)
    a, b, row = a[np.ix_(still, still)], b[still, 0], row[still]
    inverse = np.linalg.solve(z[:, None, None] * np.eye(len(still)) - a, b[None, :, None])
    found: NDArray[np.complex128] = inverse[:, :, 0] @ row
    if model.speed_sensor is SpeedSensor.DIFFERENCE:
        found *= 0.5 * (1.0 + 1.0 / z)  # the mean over the last sample, by the trapezoid
    return found * np.exp(-np.log(z) * plant.delay / dt)
