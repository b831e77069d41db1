"""Output error of a model over records, as a function of a scaled vector: what a fit minimizes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, groupby, pairwise

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.steps import difference_steps
from motor_sysid.estimation.batch.weighting import Weighting
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import Motor
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.physics.parameters import Parameter
from motor_sysid.physics.rollout import Program
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

_REST_TIME = 0.02
_WIDE_OPEN = 1e6
_START_SPAN = 21
_PIECE = 500
_WINDOW, _RUN_IN = 1500, 100
_WORTH_THINNING = 1.5


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
    open_states:
        Indices of the states whose initial value is uncertain; the best ones are used.
    state_size:
        (n,) size of a small change of each state.
    scored_from:
        First row whose error counts; its length, where the stretch is run only for its memory.
    """

    record: Record
    drive: Drive
    measured: Array
    state: Array
    open_states: tuple[int, ...]
    state_size: Array
    scored_from: int = 0

    @property
    def scored(self) -> bool:
        """Whether any of its error counts."""
        return self.scored_from < len(self.record)

    @property
    def judged(self) -> Array:
        """The (K, n_y) measured outputs whose error counts."""
        return self.measured[self.scored_from :]


Chain = tuple[Stretch, ...]
"""Stretches that follow each other in time: the memory of effects carries on."""


@dataclass(frozen=True)
class Linearization:
    """One scored stretch at one vector.

    Attributes
    ----------
    residual:
        (N, n_y) measured minus simulated.
    slope:
        (N, n_y, d) derivative of the simulated outputs by the vector.
    start:
        (N, n_y, m) derivative by the open initial states.
    """

    residual: Array
    slope: Array
    start: Array


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
) -> Chain:
    """Cut a record into stretches.

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
    """
    even = record.uniform()
    cut = round(train_fraction * len(even))
    if horizon is None:
        last = cut if scored == 'train' else len(even)
        return (_stretch(even, 0, last, kind, outputs, cut if scored == 'validate' else 0),)
    parts = [(0, cut, scored != 'validate'), (cut, len(even), scored != 'train')]
    chain: list[Stretch] = []
    for first, last, counts in parts:
        if last - first < 2 or (first > 0 and scored == 'train'):
            continue
        pieces = max(round((last - first) / max(int(horizon / even.dt), 20)), 1)
        edges = np.linspace(first, last, pieces + 1).astype(int)
        chain += [
            _stretch(even, int(a), int(b), kind, outputs, 0 if counts else int(b - a))
            for a, b in pairwise(edges)
        ]
    return tuple(chain)


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
            windows += [
                (_window(stretch, int(a), int(a) + width, kind, outputs),) for a in starts
            ]
    return tuple(windows)


def _window(
    stretch: Stretch, first: int, last: int, kind: Motor, outputs: Sequence[str]
) -> Stretch:
    """Cut rows first to last out of a stretch, run in from a little earlier."""
    begin = max(first - _RUN_IN, 0)
    cut = _stretch(stretch.record, begin, last, kind, outputs, first - begin)
    drive = stretch.drive
    return replace(
        cut,
        drive=Drive(
            drive.inputs[begin:last],
            drive.dt,
            drive.start + begin * drive.dt,
            drive.position[begin:last],
        ),
    )


def _stretch(
    even: Record, first: int, last: int, kind: Motor, outputs: Sequence[str], scored_from: int
) -> Stretch:
    """Prepare rows first to last; a stretch that begins at rest starts from rest."""
    record = even.slice(first, last)
    drive = replace(Drive.of(record, kind), start=float(record.time[0] - even.time[0]))
    measured = np.column_stack([record[name] for name in outputs])
    speed = measured_speed(even)
    top = float(np.max(np.abs(speed), initial=1e-12))
    head = speed[first : first + max(int(_REST_TIME / even.dt), 3)]
    at_rest = bool(np.all(np.abs(head) <= 1e-3 * top))
    state, size = np.zeros(len(kind.states)), np.ones(len(kind.states))
    still_open: list[int] = []
    for j, name in enumerate(kind.states):
        if name == 'omega' and not at_rest:
            state[j], size[j] = _value_at(speed, first), 1e-3 * top
            still_open.append(j)
        elif name == 'theta' and 'position' in record:
            state[j] = _value_at(even['position'], first)
            if 'position' in outputs:
                size[j] = 1e-3 * float(np.std(even['position'])) + 1e-12
                still_open.append(j)
        elif name == 'i' and 'current' in record and not at_rest:
            state[j] = _value_at(even['current'], first)
    return Stretch(record, drive, measured, state, tuple(still_open), size, scored_from)


def _value_at(values: Array, index: int) -> float:
    """Value of a smooth noisy signal at a sample: a parabola through its surroundings."""
    first = max(index - _START_SPAN // 2, 0)
    around = values[first : first + _START_SPAN]
    degree = 2 if around.size > 8 else 1
    fitted = np.polynomial.Polynomial.fit(np.arange(first, first + around.size), around, degree)
    return float(fitted(index))


class Problem:
    """Free parameters of a model against chains of stretches.

    Parameters
    ----------
    model:
        The model; its free parameters are sought, from their values.
    chains:
        Data; the errors of their scored stretches count.
    outputs:
        Signals that the error is taken of.
    substeps:
        Integration steps per sample.
    threads:
        Blocks of 32 simulations that may run at the same time.

    Notes
    -----
    The vector ``z`` holds the free parameters: the logarithm where the box is positive, otherwise
    the value over its size.  Uncertain initial states are not part of it: their best values are
    found by projection (Golub and Pereyra 1973), at the price of two simulations for each state.
    """

    def __init__(
        self,
        model: Model,
        chains: Sequence[Chain],
        outputs: Sequence[str],
        *,
        substeps: int = 1,
        threads: int = 2,
    ) -> None:
        self.model, self.chains, self.outputs = model, tuple(chains), tuple(outputs)
        self.substeps, self.threads = substeps, threads
        self.program = Program.of(model, outputs)
        self.free = model.parameters.free
        self.size = np.array([_size(p) for p in self.free])
        self.dimension = len(self.free)
        self.stretches = [s for chain in self.chains for s in chain if s.scored]
        self._open = sorted({j for s in self.stretches for j in s.open_states})

    def vector(self) -> Array:
        """Return z of the model as it is."""
        return np.array(
            [np.log(p.value) if p.logarithmic else p.value / size for p, size in self._sized()]
        )

    def box(self) -> tuple[Array, Array]:
        """Return the lower and upper bounds of z."""
        lower = [np.log(p.lower) if p.logarithmic else p.lower / s for p, s in self._sized()]
        upper = [np.log(p.upper) if p.logarithmic else p.upper / s for p, s in self._sized()]
        return np.array(lower), np.array(upper)

    def reach(self) -> Array:
        """Return (d,) largest step of one iteration: a factor of 7 for positive parameters."""
        return np.array([2.0 if p.logarithmic else np.inf for p in self.free])

    def values(self, z: Array) -> dict[str, Array]:
        """Return every parameter name to (P,) values for (P, d) vectors."""
        table = {p.name: np.full(len(z), p.value) for p in self.model.parameters}
        for column, (p, size) in enumerate(self._sized()):
            moved = np.exp(z[:, column]) if p.logarithmic else z[:, column] * size
            table[p.name] = np.clip(moved, p.lower, p.upper)
        return table

    def slope(self, z: Array) -> Array:
        """Return (d,) derivative of each free parameter by its coordinate."""
        now = self.values(z[np.newaxis, :])
        return np.array([now[p.name][0] if p.logarithmic else s for p, s in self._sized()])

    def model_at(self, z: Array) -> Model:
        """Return the model with the parameters of one vector."""
        return self.model.with_values(
            {name: float(v[0]) for name, v in self.values(z[np.newaxis, :]).items()}
        )

    def simulate(self, z: Array, shifts: Array | None = None) -> list[Array]:
        """Return for each scored stretch the judged outputs (N, n_y, P) of (P, d) vectors.

        Parameters
        ----------
        z:
            (P, d) vectors.
        shifts:
            (P, n) changes of the initial state in units of the stretch's state size.
        """
        table, results = self.values(z), []
        if not table or len(z) == 0:
            return []
        for _, group in groupby(self.chains, key=lambda chain: chain[0].drive.dt):
            chains = list(group)
            stretches = [stretch for chain in chains for stretch in chain]
            runs = self.program.run_chain(
                table,
                [s.drive for s in stretches],
                [s.state if shifts is None else s.state + shifts * s.state_size
                 for s in stretches],
                restarts=list(accumulate(len(chain) for chain in chains)),
                substeps=self.substeps,
                threads=self.threads,
            )  # fmt: skip
            results += [
                run[stretch.scored_from :]
                for run, stretch in zip(runs, stretches, strict=True)
                if stretch.scored
            ]
        return results

    def linearize(self, z: Array, *, parameters: bool = True) -> list[Linearization]:
        """Return residuals and derivatives of each scored stretch at one vector.

        Parameters
        ----------
        z:
            (d,) vector.
        parameters:
            Whether derivatives by the vector are wanted; without, ``slope`` is empty.
        """
        d = self.dimension if parameters else 0
        m = len(self._open)
        count = 1 + 2 * d + 2 * m
        cloud = np.repeat(z[np.newaxis, :], count, axis=0)
        shifts = np.zeros((count, len(self.model.kind.states)))
        lower, upper = self.box()
        step = self.steps()
        up, down = np.minimum(z + step, upper)[:d], np.maximum(z - step, lower)[:d]
        for k in range(d):
            cloud[1 + k, k] = up[k]
            cloud[1 + d + k, k] = down[k]
        for k, state in enumerate(self._open):
            shifts[1 + 2 * d + 2 * k, state] = 1.0
            shifts[2 + 2 * d + 2 * k, state] = -1.0
        found = []
        for stretch, run in zip(self.stretches, self.simulate(cloud, shifts), strict=True):
            slope = (run[:, :, 1 : 1 + d] - run[:, :, 1 + d : 1 + 2 * d]) / (up - down)
            if not np.all(np.isfinite(slope)):  # a step into what is no motor
                slope = np.where(np.isfinite(slope), slope, 0.0)
            tail = run[:, :, 1 + 2 * d :]
            wanted = [k for k, state in enumerate(self._open) if state in stretch.open_states]
            start = 0.5 * (tail[:, :, 0::2] - tail[:, :, 1::2])[:, :, wanted]
            found.append(Linearization(stretch.judged - run[:, :, 0], slope, start))
        return found

    def steps(self) -> Array:
        """Return (d,) step of the central differences."""
        drives = [stretch.drive for stretch in self.stretches]
        end = max(d.start + d.dt * len(d.inputs) for d in drives)
        longest = max(d.dt for d in drives)
        return difference_steps(self._sized(), self.program.effects, longest, end)

    def costs(self, z: Array, weighting: Weighting, at: Sequence[Linearization]) -> Array:
        """Return (P,) weighted sums of squares of (P, d) vectors; infinite where not a number.

        `at` is a linearization near by, whose initial-state directions are used.
        """
        total = np.zeros(len(z))
        for stretch, near, run in zip(self.stretches, at, self.simulate(z), strict=True):
            with np.errstate(over='ignore', invalid='ignore'):
                total += _costs(stretch.judged, run, near.start, weighting)
        return np.where(np.isfinite(total), total, np.inf)

    def residuals(self, z: Array, weighting: Weighting) -> list[Array]:
        """Return for each scored stretch (N, n_y) measured minus simulated, best initial state."""
        return [self.settled(near, weighting) for near in self.linearize(z, parameters=False)]

    @staticmethod
    def settled(near: Linearization, weighting: Weighting) -> Array:
        """Return (N, n_y) residual after the open initial states are set to their best values."""
        if near.start.shape[2] == 0:
            return near.residual
        change = np.linalg.lstsq(
            weighting.flat(near.start), weighting.flat(near.residual[:, :, np.newaxis]), rcond=None
        )[0]
        rest: Array = near.residual - near.start @ change[:, 0]
        return rest

    def _sized(self) -> list[tuple[Parameter, float]]:
        return list(zip(self.free, self.size.tolist(), strict=True))


def _costs(measured: Array, run: Array, start: Array, weighting: Weighting) -> Array:
    """Return (P,) sums of squares of what the (N, n_y, m) directions `start` cannot explain.

    White errors are summed in pieces that stay in the processor's cache.
    """
    basis = weighting.basis(start) if start.shape[2] else np.empty((0, 0))
    total, along = np.zeros(run.shape[2]), np.zeros((basis.shape[1], run.shape[2]))
    length, width = run.shape[:2]
    piece = length if weighting.whiteners else _PIECE
    for a in range(0, length, piece):
        error = weighting.flat(measured[a : a + piece, :, np.newaxis] - run[a : a + piece])
        total += np.einsum('tk,tk->k', error, error)
        if basis.size:
            along += basis[a * width : a * width + len(error)].T @ error
    return np.asarray(total - np.einsum('mk,mk->k', along, along))


def _size(parameter: Parameter) -> float:
    """Return the size of a coordinate step: the value, or a thousandth of a box that means it."""
    if parameter.logarithmic:
        return 1.0
    reach = 1e-3 * (parameter.upper - parameter.lower)
    if reach > _WIDE_OPEN:
        return abs(parameter.value) or 1.0
    return max(abs(parameter.value), min(reach, 1.0))
