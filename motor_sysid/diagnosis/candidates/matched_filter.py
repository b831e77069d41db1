"""Waves in the unexplained error: a matched filter for every order over angle, every frequency.

What a small force does to the outputs is linear: it passes the motor and, to be compared with the
residual, the filter that whitens this.  Passing the residual back through both gives one number
for each sample and equation, the correlation of the error with a pulse of force there.  The sum of
these numbers along a wave, squared and divided by the energy of what the wave does to the outputs,
is what the wave explains; all waves together cost one pass over the data.  (It is the gradient by
the adjoint method; a spectrum of the torque, which is differentiated, loses most of the signal.)

The linear motor stands for the model: friction that sticks or a backlash in it make the search a
little blunter, not wrong, for what stands out is simulated with the whole model afterwards.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from motor_sysid.diagnosis.candidates.columns import Path, paths_of, scored_paths
from motor_sysid.diagnosis.candidates.reference_rhythm import LOBE, REACH
from motor_sysid.diagnosis.candidates.turns import add_energy, add_waves, by_length
from motor_sysid.diagnosis.where.equation_errors import surroundings
from motor_sysid.estimation.batch import coloured, Linearization, Problem, white
from motor_sysid.estimation.batch.weighting import Weighting
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.effect import arguments, Effect
from motor_sysid.physics.rollout import Program
from motor_sysid.physics.scales import Scales, scales_of

Array = NDArray[np.float64]

TOP_ORDER = 400
"""Most waves per turn that are looked for."""

HIGHEST = 0.4
"""Highest frequency that is looked for, in units of the sampling rate."""

STANDS_OUT = 4.0
"""How much more than its neighbours a number of waves per turn must explain to be believed."""

CLEAR = 30.0
"""The same for a frequency: of 40 loads that wander at random the clearest line had 28."""

SEEN = 50.0
"""Whitened sum of squares that waves which go with the current must explain to be believed: white
noise makes that of the best of 400 orders in one motor of 1e8 (chi-squared, two degrees).  Seen:
21 at most in five complete motors, 160 where a ripple of 2 % is missing."""

_LEAST_TURN = 0.95 * 2 * np.pi
"""Angle (rad) that must have been turned: a map of one turn may end a step short of it."""

_CYCLES = 1.5
_NOISE_ORDER = 12
_BESIDE = 12
_PULSE = 1e-3
_MEMORY = 4096
_BINS = 1024


@dataclass(frozen=True)
class _Stretch:
    """One scored stretch.

    Attributes
    ----------
    path:
        What laws see, (N,) each.
    pull:
        (m, N) correlation of the error with a pulse of each force.
    """

    path: Path
    pull: Array


class Matched:
    """A fitted model's residual, passed back through the motor.

    Parameters
    ----------
    problem:
        The fitted model and the data.
    near:
        Its residuals and derivatives, one for each scored stretch.
    plain:
        Whether the residual is taken as it is: a noise model of what is left whitens a wave, too,
        that makes up most of it and comes at a steady pace.
    """

    def __init__(
        self, problem: Problem, near: Sequence[Linearization], *, plain: bool = False
    ) -> None:
        self._problem = problem
        self._forces = [force.name for force in problem.model.kind.forces]
        weighting = white([one.residual for one in near]) if plain else _noise(near)
        pulses = _pulses(problem)
        self._power = _power(pulses, weighting)
        self._gains: dict[tuple[str, str], Array] = {}
        scored = scored_paths(problem, paths_of(problem))
        errors = _errors(near, weighting)
        self._stretches = [
            _Stretch({k: v[first:] for k, v in path.items()}, _back(error, weighting, pulses))
            for (path, first), error in zip(scored, errors, strict=True)
        ]

    def orders(
        self, one: Effect | None = None, count: int = 5, *, contrast: float = 0.0
    ) -> tuple[int, ...]:
        """Return the waves per turn at which an effect would explain most, best first.

        Parameters
        ----------
        one:
            The effect; its first amplitude is that of a cosine, its second that of the sine.
            Without it: a plain wave of torque.
        count:
            Most that are returned.
        contrast:
            Least ratio of what an order explains to what its neighbours do (their median).
        """
        lowest = 1 if one is None else fewest(one)
        return highest(self.order_gains(one), lowest, contrast)[:count]

    def clearest(self, one: Effect) -> tuple[int, ...]:
        """Return the waves per turn that stand out most of their neighbours, if any do by much.

        Where waves pass within a few samples, many a wrong order explains something of what a true
        one leaves, and the best of hundreds of those may explain more than that one.
        """
        gains = self.order_gains(one)
        peaks = highest(np.where(gains < SEEN, 0.0, gains), fewest(one), STANDS_OUT)
        apart = gains / np.maximum(surroundings(gains, _BESIDE), 1e-300)
        return (max(peaks, key=lambda n: apart[n]),) if peaks else ()

    def led_orders(self, by: str = 'i', count: int = 2) -> tuple[int, ...]:
        """Return the waves per turn of a torque in proportion to what laws see, best first.

        They stand out of their neighbours, and of noise; none where laws do not see it.
        """
        gains = self.order_gains(by=by)
        gains[gains < SEEN] = 0.0
        return highest(gains, 2, STANDS_OUT)[:count]

    def order_gains(self, one: Effect | None = None, *, by: str = '') -> Array:
        """Return (`TOP_ORDER` + 1,) the decrease of the whitened sum of squares by each order.

        The wave of an effect, or of a torque; in proportion to what laws see by that name, if any.
        """
        place = (one.key if one else '', by)
        if place not in self._gains:
            self._gains[place] = self._order_gains(one, by)
        return self._gains[place].copy()

    def _order_gains(self, one: Effect | None, by: str) -> Array:
        """Return the same, in a pass over the data."""
        total, energy = np.zeros(TOP_ORDER + 1, complex), np.zeros(TOP_ORDER + 1)
        turned = 0.0
        count = max(one.drive.count for one in self._problem.stretches)
        seen = np.arange(TOP_ORDER + 1) * count <= np.pi  # others look like slower ones
        for stretch in self._stretches:
            path = stretch.path
            if 'theta' not in path or (by and by not in path):
                return np.zeros(TOP_ORDER + 1)
            if not all(np.all(np.isfinite(values)) for values in path.values()):
                return np.zeros(TOP_ORDER + 1)  # the model has run away
            turned += float(np.ptp(path['theta']))
            carriers = np.stack([self._carrier(one, force, path) for force in self._forces])
            carriers = carriers * path[by] if by else carriers
            step = np.abs(path['turn'])
            add_waves(path['theta'], step, np.sum(carriers * stretch.pull, axis=0), total)
            for carrier, power in zip(carriers, self._power, strict=True):
                add_energy(*by_length(step, carrier**2), power, energy)
        if turned < _LEAST_TURN:
            return np.zeros(TOP_ORDER + 1)
        gains: Array = np.where(seen, np.abs(total) ** 2 / np.maximum(energy, 1e-300), 0.0)
        return gains

    def frequencies(self, force: str, count: int = 3) -> tuple[float, ...]:
        """Return the frequencies in Hz at which a force would explain most, best first.

        Each stands out of its surroundings like a line: a load that wanders explains something at
        all of them.
        """
        row = self._forces.index(force)
        dt = self._problem.stretches[0].drive.dt
        end = max(float(s.path['t'][-1]) for s in self._stretches)
        samples = sum(s.path['t'].size for s in self._stretches)
        size = int(2 ** np.ceil(np.log2(2 * end / dt + 2)))
        row_of_time = np.zeros(size)
        for stretch in self._stretches:
            at = np.rint(stretch.path['t'] / dt).astype(np.int64)
            np.add.at(row_of_time, np.clip(at, 0, size - 1), stretch.pull[row])
        spectrum = np.abs(np.fft.rfft(row_of_time)) ** 2
        frequency = np.fft.rfftfreq(size, dt)
        bins = np.minimum(np.rint(2 * frequency * dt * _BINS), _BINS).astype(np.int64)
        gains = spectrum / np.maximum(0.5 * samples * self._power[row, bins], 1e-300)
        gains[(frequency < _CYCLES / end) | (frequency > HIGHEST / dt)] = 0.0
        peaks = _peaks(gains)
        best = [k for k in np.argsort(-gains)[: 40 * count].tolist() if peaks[k]]
        apart: list[int] = []
        step = float(frequency[1])
        line = step * end
        for k in best:
            if all(abs(k - j) * line > 1.0 for j in apart) and _is_line(gains, k, line):
                apart.append(k)
        return tuple(_summit(gains, k) * step for k in apart[:count])

    def _carrier(self, one: Effect | None, force: str, path: Path) -> Array:
        """Return (N,) what an effect's cosine is multiplied by."""
        size = path['t'].size
        if one is None:
            return np.full(size, float(force == 'torque'))
        if force not in one.laws:
            return np.zeros(size)
        values = self._problem.model.parameters.values()
        known: dict[str, Array | float] = {**values, **path}
        carrier = carrier_of(one, force, known, self._scales, size)
        return np.zeros(size) if carrier is None else carrier

    @cached_property
    def _scales(self) -> Scales:
        model = self._problem.model
        records = [stretch.record for stretch in self._problem.stretches]
        return scales_of(model.motor, model.parameters.values(), records)


def fewest(one: Effect) -> int:
    """Return the fewest waves per turn that an effect may have."""
    lower = next(s.lower for s in one.card.shapes if s.name == one.card.orders)
    return max(round(lower), 1)


def carrier_of(
    one: Effect, force: str, known: Mapping[str, Array | float], scales: Scales, size: int
) -> Array | None:
    """Return (N,) what an effect's cosine is multiplied by: its law at no waves per turn.

    None where the law asks for more than is known; see `law_along`.
    """
    chosen = {one.card.amplitudes[0].name: 1.0, one.card.orders: 0.0}
    return law_along(one, force, known, scales, chosen, size)


def law_along(
    one: Effect,
    force: str,
    known: Mapping[str, Array | float],
    scales: Scales,
    chosen: Mapping[str, float],
    size: int,
) -> Array | None:
    """Return (N,) one of an effect's laws; None where it asks for more than is known.

    Of its own parameters some are `chosen`; other amplitudes are zero, and other shapes as they
    start.  The states of its own are not known.
    """
    card, law = one.card, one.laws[force]
    own: dict[str, float] = {a.name: 0.0 for a in card.amplitudes}
    own |= {s.name: s.starts[0] * scales.size(s.scale) for s in card.shapes if s.starts}
    given = {**known, **own, **chosen}
    if not set(arguments(law)) <= given.keys():
        return None
    found = law(*[given[name] for name in arguments(law)])
    return np.broadcast_to(np.asarray(found, dtype=float), (size,))


def _noise(near: Sequence[Linearization]) -> Weighting:
    """Return the noise model of what base parameters leave."""
    flat = white([one.residual for one in near])
    slope = np.concatenate([flat.flat(one.slope) for one in near])
    error = np.concatenate([flat.flat(one.residual[:, :, np.newaxis]) for one in near])[:, 0]
    change = np.linalg.lstsq(slope, error, rcond=1e-10)[0] if slope.shape[1] else np.zeros(0)
    return coloured([one.residual - one.slope @ change for one in near], _NOISE_ORDER)


def _errors(near: Sequence[Linearization], weighting: Weighting) -> list[Array]:
    """Return for each stretch the whitened residual (K, n_y) beside the base parameters."""
    slopes = [weighting.flat(one.slope) for one in near]
    errors = [weighting.flat(one.residual[:, :, np.newaxis])[:, 0] for one in near]
    if slopes[0].shape[1]:
        slope = np.concatenate(slopes)
        size = np.linalg.norm(slope, axis=0) + 1e-300
        change = np.linalg.lstsq(slope / size, np.concatenate(errors), rcond=1e-10)[0] / size
        errors = [e - s @ change for e, s in zip(errors, slopes, strict=True)]
    outputs = near[0].residual.shape[1]
    return [error.reshape(-1, outputs) for error in errors]


def _pulses(problem: Problem) -> Array:
    """Return (m, M, n_y) the answer of the linear motor's outputs to a pulse of each force.

    The pulse is a triangle over two samples: forces are straight between samples.
    """
    model = problem.model
    program = Program(model.kind, [], problem.outputs, model.speed_sensor)
    values = model.parameters.values()
    count = len(model.kind.forces)
    longest = max(len(stretch.drive.inputs) for stretch in problem.stretches)
    length = min(longest, _MEMORY) + 1
    dt = problem.stretches[0].drive.dt
    drive = Drive(np.zeros((length, problem.stretches[0].drive.inputs.shape[1])), dt)
    push = np.zeros((length, 2, count, count + 1))
    for j in range(count):
        push[0, 1, j, j + 1] = push[1, 0, j, j + 1] = _PULSE
    table = {name: np.full(count + 1, values[name]) for name in program.names}
    still = np.zeros(len(model.kind.states))
    run = program.run_chain(table, [drive], [still], pushes=[push])[0][1:]
    answer = (run[:, :, 1:] - run[:, :, :1]) / _PULSE
    return np.nan_to_num(answer).transpose(2, 0, 1)


def _power(pulses: Array, weighting: Weighting) -> Array:
    """Return (m, `_BINS` + 1) energy of the whitened outputs per energy of a sine of each force.

    The bins are even from zero to half the sampling rate.
    """
    length = 2 * _BINS
    blocks = -(-pulses.shape[1] // length)
    padded = np.zeros((pulses.shape[0], blocks * length, pulses.shape[2]))
    padded[:, : pulses.shape[1]] = pulses
    filtered = np.fft.rfft(padded.reshape(-1, blocks, length, pulses.shape[2]).sum(axis=1), axis=1)
    whitener = np.fft.rfft(weighting.taps, length, axis=1).T
    power: Array = np.sum(np.abs(filtered * whitener) ** 2, axis=2)
    return power


def _back(error: Array, weighting: Weighting, pulses: Array) -> Array:
    """Return (m, N) the whitened errors (K, n_y), passed back through filter and motor."""
    taps = weighting.taps
    pull = np.zeros((pulses.shape[0], len(error) + weighting.order))
    for y in range(error.shape[1]):
        late = fftconvolve(error[:, y], taps[y, ::-1])[::-1]
        for j, pulse in enumerate(pulses):
            pull[j] += fftconvolve(late, pulse[:, y])[: late.size][::-1]
    return pull


def _peaks(gains: Array) -> NDArray[np.bool_]:
    """Return which entries are no smaller than their neighbours, and not zero."""
    padded = np.concatenate(([0.0], gains, [0.0]))
    return (gains > 0.0) & (gains >= padded[:-2]) & (gains >= padded[2:])


def highest(gains: Array, lowest: int, contrast: float) -> tuple[int, ...]:
    """Return where gains have peaks that stand out, from a place on, the highest first."""
    above = gains > contrast * surroundings(gains, _BESIDE)
    above[:lowest] = False
    peaks = _peaks(np.where(np.arange(gains.size) < lowest, 0.0, gains)) & above
    return tuple(n for n in np.argsort(-gains).tolist() if peaks[n])


def _is_line(gains: Array, k: int, width: float) -> bool:
    """Whether (M,) gains stand out at one place; places are `width` apart, in lines."""
    first = max(k - int(REACH / width), 0)
    around = gains[first : k + int(REACH / width) + 1]
    away = width * np.abs(np.arange(first, first + around.size) - k)
    near = around[(away > LOBE) & (away < REACH) & (around > 0.0)]
    return bool(near.size == 0 or gains[k] > CLEAR * np.median(near))


def clearest_line(values: Array, dt: float) -> tuple[float, ...]:
    """Return the frequency in Hz of the line of (N,) values that stands out most, if one does."""
    size = values.size
    gains = np.abs(np.fft.rfft((values - np.mean(values)) * np.hanning(size), 2 * size)) ** 2
    gains[: round(2 * _CYCLES)] = gains[round(2 * size * HIGHEST) :] = 0.0
    proud = np.where(_peaks(gains), gains / np.maximum(surroundings(gains, _BESIDE), 1e-300), 0.0)
    k = int(np.argmax(proud))
    return (_summit(gains, k) / (2 * size * dt),) if _is_line(gains, k, 0.5) else ()


def _summit(gains: Array, k: int) -> float:
    """Return the place of the peak of a parabola through the logarithms around `k`."""
    left, middle, right = np.log(gains[k - 1 : k + 2] + 1e-300)
    bend = left - 2 * middle + right
    return float(k + (0.5 * (left - right) / bend if bend < 0 else 0.0))
