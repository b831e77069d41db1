"""Records cut into what is simulated in one go: stretches, and chains of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import dropwhile, pairwise

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.sampling import Linear, Sampling
from motor_sysid.estimation.batch.sensors import Sensors, sensors_of
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.motors.base import Motor
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.signals.record import Record
from motor_sysid.signals.slow_updates import with_news_between, with_news_held

Array = NDArray[np.float64]

_REST_TIME = 0.02
_COARSE = 0.015
"""Sample time, s, from which on a motor may settle from one sample to the next."""
_START_SPANS, _NEAR, _SURELY = (21, 11, 5), 1000, 20.0
"""Samples that a parabola goes through where a run starts; samples on either side that noise is
read from; and how many times the noise the parabola may be off."""
_BROKEN = 0.05
"""How far it may be off where samples are not coarse, as a share of how the signal varies: that is
a step within the samples, or the current that answers to one."""
_EXACTLY = 1.5
"""How many times the noise it may be off where it must be as near as that."""
_WINDOW, _RUN_IN, _MEMORY = 1500, 100, 500
_WORTH_THINNING = 1.5
PIECE, _PAIRS = 500, 4
"""Fewest samples of a piece of held-back data where every other one is lent to training, and most
pairs of pieces of a record."""


@dataclass(frozen=True)
class Stretch:
    """One uninterrupted piece of data that the model is run over from a fresh core state.

    Attributes
    ----------
    record:
        Uniformly sampled record.
    drive:
        What drives the model.
    measured:
        (N, n_y) measured outputs.
    state:
        (n,) initial state read from the data.
    rate:
        (n,) how fast what was read changes there, per s; zero of what was not read, or is broken
        by a step.
    open_states:
        Indices of the states whose initial value is uncertain; the best ones are used.
    state_size:
        (n,) size of a small change of each state.
    scored_from:
        First row whose error counts; its length, where the stretch is run only for its memory.
    limits:
        (2, n_y) smallest and largest value that the sensor of each output can show; None where
        none of them is known.
    sampling:
        When each output was sampled; None of those that are new in every row.
    """

    record: Record
    drive: Drive
    measured: Array
    state: Array
    rate: Array
    open_states: tuple[int, ...]
    state_size: Array
    scored_from: int = 0
    limits: Array | None = None
    sampling: tuple[Sampling | None, ...] = ()

    @property
    def scored(self) -> bool:
        """Whether any of its error counts."""
        return self.scored_from < len(self.record)

    @property
    def judged(self) -> Array:
        """The (K, n_y) measured outputs whose error counts."""
        return self.measured[self.scored_from :]

    @property
    def fresh(self) -> tuple[float, ...]:
        """Share of the rows in which each output is new."""
        every = self.sampling or (None,) * self.measured.shape[1]
        return tuple(one.fresh if one else 1.0 for one in every)

    def shown(self, run: Array, linear: Linear) -> Array:
        """Return what sensors show where they count, of outputs of simulations.

        Parameters
        ----------
        run:
            (N, n_y, P) outputs.
        linear:
            The linear motor of each; it tells what lies between the rows.
        """
        if any(self.sampling):
            run = np.stack([self._sampled(run[:, j], j, linear) for j in range(run.shape[1])], 1)
        counts = run[self.scored_from :]
        if self.limits is None:
            return counts
        low, high = self.limits[:, :, np.newaxis]
        return np.clip(counts, low, high)

    def _sampled(self, run: Array, output: int, linear: Linear) -> Array:
        one = self.sampling[output]
        if one is None:
            return run
        inputs, dt = self.drive.inputs, self.drive.dt
        return one.of(run, linear.alone(output, inputs, dt) if one.is_between else None)

    def moved(self, change: Array) -> 'Stretch':
        """Return the stretch with a (K, n_y) change added to what is judged."""
        unscored = self.measured[: self.scored_from]
        return replace(self, measured=np.concatenate((unscored, self.judged + change)))


Chain = tuple[Stretch, ...]
"""Stretches that follow each other in time: the memory of effects carries on."""


def observed_outputs(kind: Motor, records: Sequence[Record]) -> tuple[str, ...]:
    """Return the outputs that the error is taken of.

    These are the signals of the motor kind that every record has; position only where there is no
    speed, for a speed is mostly its derivative.

    Raises
    ------
    UserError
        If there is none.
    """
    have = [o.signal for o in kind.outputs if all(o.signal in r for r in records)]
    if 'speed' in have and 'position' in have:
        have.remove('position')
    if not have:
        wanted = ', '.join(o.signal for o in kind.outputs)
        raise UserError(f'a {kind.title} needs one of {wanted}; name the topic or column for it')
    return tuple(have)


def make_chain(
    record: Record,
    kind: Motor,
    outputs: Sequence[str],
    *,
    horizon: float | None = None,
    train_fraction: float = 1.0,
    scored: str = 'all',
    lent: bool = False,
    sensors: Sensors | None = None,
) -> Chain:
    """Cut a record into stretches; none where nothing of it counts.

    Parameters
    ----------
    record:
        The record; resampled if not uniform.
    kind, outputs:
        Motor kind and the outputs that the error is taken of.
    horizon:
        Length of a stretch in s: the model is run that far ahead of the measured state; None runs
        it freely over the whole.
    train_fraction:
        Where the held-back part begins, as a fraction of the record.
    scored:
        ``all``; or ``train`` or ``validate``: the part before or after `train_fraction` counts.
        A free run is never restarted: it reaches the held-back part from the start of the record.
    lent:
        Whether the held-back part is cut into pieces, each run from the measured state, of which
        every other one, the first included, counts as training data.
    sensors:
        What all records of the motor tell of its sensors; else what this one shows itself.
    """
    even = with_news_held(record.uniform(), kind.driving)
    drive, known = Drive.of(with_news_between(even), kind), sensors or sensors_of([even], kind)
    shown = known.limits_of(even, kind, outputs), known.sampling_of(even, outputs)
    cut = round(train_fraction * len(even))
    if horizon is None and not lent and scored != 'train' and cut < len(even):
        judged = cut if scored == 'validate' else 0
        return (_stretch(even, drive, 0, len(even), kind, outputs, judged, *shown),)
    parts = [
        (first, last, scored in ('all', role))
        for first, last, role in _roles(len(even), cut, lent=lent)
    ]
    end = max((last for _, last, counts in parts if counts), default=0)
    chain: list[Stretch] = []
    for first, last, counts in parts:
        if last > end:
            break
        ahead = last - first if horizon is None else max(int(horizon / even.dt), 20)
        pieces = max(round((last - first) / ahead), 1)
        edges = np.linspace(first, last, pieces + 1).astype(int)
        for a, b in pairwise(edges.tolist()):
            unscored = 0 if counts else b - a
            chain.append(_stretch(even, drive, a, b, kind, outputs, unscored, *shown))
    return tuple(chain)


def _roles(rows: int, cut: int, *, lent: bool) -> Iterator[tuple[int, int, str]]:
    """Yield first and last row of each part of a record, and its role: train or validate."""
    if cut > 1:
        yield 0, cut, 'train'
    if rows - cut < 2:
        return
    pairs = int(np.clip((rows - cut) // (2 * PIECE), 1, _PAIRS))
    roles = ('train', 'validate') * pairs if lent else ('validate',)
    edges = np.linspace(cut, rows, len(roles) + 1).astype(int)
    for (first, last), role in zip(pairwise(edges), roles, strict=True):
        yield int(first), int(last), role


def thinned(
    chains: Sequence[Chain], kind: Motor, outputs: Sequence[str], rows: int
) -> tuple[Chain, ...]:
    """Return windows of about `rows` rows in all, spread evenly over the scored data.

    Each is a chain by itself, begins in motion at the measured state, and is not judged by its
    first rows.  Data that are not much longer are returned as they are.
    """
    total = sum(len(stretch.judged) for chain in chains for stretch in chain if stretch.scored)
    if total <= _WORTH_THINNING * rows:
        return tuple(chains)
    windows: list[Chain] = []
    for chain in chains:
        for stretch in chain:
            if not stretch.scored:
                continue
            first, length = stretch.scored_from, len(stretch.judged)
            share = rows * length / total
            count = max(round(share / _WINDOW), 1)
            width = max(int(share / count), 20)
            starts = first + (np.arange(count) + 0.5) * (length - width) / count
            windows += [_window(stretch, int(a), int(a) + width, kind, outputs) for a in starts]
    return tuple(windows)


def without_memory(chains: Sequence[Chain]) -> tuple[Chain, ...]:
    """Return chains without what is run first for its memory alone."""
    return tuple(tuple(dropwhile(lambda one: not one.scored, chain)) for chain in chains)


def _window(
    stretch: Stretch, first: int, last: int, kind: Motor, outputs: Sequence[str]
) -> Chain:
    """Cut rows first to last out of a stretch, run in from a little earlier.

    What comes before that is run for its memory alone.
    """
    begin = max(first - _RUN_IN, 0)
    early = max(begin - _MEMORY, 0)

    def part(a: int, b: int, unscored: int) -> Stretch:
        return _stretch(
            stretch.record, stretch.drive, a, b, kind, outputs, unscored, stretch.limits,
            stretch.sampling,
        )  # fmt: skip

    window = part(begin, last, first - begin)
    return (part(early, begin, begin - early), window) if begin - early > 1 else (window,)


def _stretch(
    even: Record, drive: Drive, first: int, last: int, kind: Motor, outputs: Sequence[str],
    scored_from: int, limits: Array | None, sampling: tuple[Sampling | None, ...],
) -> Stretch:  # fmt: skip
    """Prepare rows first to last; a stretch that begins at rest starts from rest.

    Within a record, counts that stay for a moment do not tell rest from a slow turn.  Of many
    short runs the current at the start is read more exactly: it may be about to jump.
    """
    record = even.slice(first, last)
    measured = np.column_stack([record[name] for name in outputs])
    even = with_news_between(even)
    speed = measured_speed(even)
    top = float(np.max(np.abs(speed), initial=1e-12))
    head = speed[first : first + max(int(_REST_TIME / even.dt), 3)]
    told = first == 0 or 'speed' in even
    at_rest = told and bool(np.all(np.abs(head) <= 1e-3 * top))
    (state, slope), size = np.zeros((2, len(kind.states))), np.ones(len(kind.states))
    still_open: list[int] = []
    coarse = 'speed' in record and even.dt > _COARSE
    shown = {o.state: o.signal for o in kind.outputs if o.state in kind.currents}
    for j, name in enumerate(kind.states):
        if name == 'omega' and not at_rest:
            state[j], slope[j] = _value_at(speed, first, coarse=coarse)
            size[j] = 1e-3 * top
            still_open.append(j)
        elif name == 'theta' and 'position' in record:
            state[j], slope[j] = _value_at(even['position'], first, coarse=coarse)
            if 'position' in outputs:
                size[j] = 1e-3 * float(np.std(even['position'])) + 1e-12
                still_open.append(j)
        elif name in shown and shown[name] in record and not at_rest:
            state[j], slope[j] = _value_at(
                even[shown[name]], first, coarse=coarse, exactly='position' in outputs
            )
    mine = drive.part(first, last)
    own = tuple(one and one.part(first, last) for one in sampling)
    return Stretch(
        record, mine, measured, state, slope / even.dt, tuple(still_open), size, scored_from,
        limits, own,
    )


def _value_at(
    values: Array, index: int, *, coarse: bool, exactly: bool = False
) -> tuple[float, float]:
    """Value of a noisy signal at a sample and its slope: of a parabola through its surroundings.

    Through as many of them as one fits; if none does, it is the sample itself, and no slope.  Of a
    speed that was sampled so `coarse` that a motor may settle from one sample to the next, one
    fits that is as near as the noise; of others, one that is not broken by a step.  Where the
    value must be known `exactly`, one fits that is no further off than noise is.
    """
    near = values[max(index - _NEAR, 0) : index + _NEAR]
    noise = _noise_of(near)
    limit = _SURELY * noise if coarse else max(_SURELY * noise, _BROKEN * float(np.std(near)))
    limit = _EXACTLY * noise if exactly else limit
    for span in _START_SPANS:
        first = max(index - span // 2, 0)
        around = values[first : first + span]
        degree = 2 if around.size > 8 else 1
        rows = np.arange(first, first + around.size)
        fitted = np.polynomial.Polynomial.fit(rows, around, degree)
        left = float(np.sum((around - fitted(rows)) ** 2)) / max(around.size - degree - 1, 1)
        if left <= limit**2:
            return float(fitted(index)), float(fitted.deriv()(index))
    return float(values[index]), 0.0


def _noise_of(values: Array) -> float:
    """Return the standard deviation of white noise in a signal that moves smoothly mostly.

    Third differences hold noise sqrt(20)-fold and a parabola not at all; half of those of noise
    lie within 0.67 standard deviations.
    """
    if values.size < _START_SPANS[0]:
        return np.inf
    return float(np.median(np.abs(np.diff(values, 3))) / (0.6745 * np.sqrt(20.0)))
