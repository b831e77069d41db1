"""Output error of a model over records, as a function of a scaled vector: what a fit minimizes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, groupby

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch.chains import Chain
from motor_sysid.estimation.batch.prior import Prior
from motor_sysid.estimation.batch.sampling import linear_of
from motor_sysid.estimation.batch.starts import starts_of
from motor_sysid.estimation.batch.steps import difference_steps
from motor_sysid.estimation.batch.weighting import Weighting
from motor_sysid.physics.model import Model
from motor_sysid.physics.parameters import Parameter
from motor_sysid.physics.rollout import Program

Array = NDArray[np.float64]

_WIDE_OPEN = 1e6
_PIECE = 500
_RUNAWAY, _CERTAIN = 1e100, 1e-9


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
        (N, n_y, m) derivative by the open initial states, and last, where a delay reaches back
        beyond the record, by the share of its first input that was missing before it.
    size:
        (d,) size of each coordinate of the vector, in units of its parameter; 1 for a logarithm.
    """

    residual: Array
    slope: Array
    start: Array
    size: Array


def weighed(near: Sequence[Linearization], weighting: Weighting) -> list[Array]:
    """Return (K, d + 1) slopes and residuals of each, weighed, initial states at their best."""
    both = [
        np.concatenate((one.slope, one.residual[:, :, np.newaxis]), axis=2) for one in near
    ]
    return weighting.removed(both, [one.start for one in near])


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
    prior:
        What is believed of the parameters; its weighted square is added to every cost.
    one_sided:
        Whether derivatives by the parameters are one-sided differences: half the simulations, and
        errors of some ten-thousandths, good enough for a rough fit.

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
        prior: Prior | None = None,
        one_sided: bool = False,
    ) -> None:
        self.one_sided = one_sided
        self.model, self.chains, self.outputs = model, tuple(chains), tuple(outputs)
        self.substeps, self.threads = substeps, threads
        self.program = Program.of(model, outputs)
        self.free = model.parameters.free
        self.size = np.array([_size(p) for p in self.free])
        self.dimension = len(self.free)
        self.stretches = [s for chain in self.chains for s in chain if s.scored]
        self._open = sorted({j for s in self.stretches for j in s.open_states})
        self.prior = prior
        nothing = Prior((), np.empty(0), np.empty((0, 0)))
        self.believed, self.precision = (prior or nothing).placed(self.free, self.size)

    @cached_property
    def fresh(self) -> Array:
        """Share of the rows in which each output is new, (n_y,): the others tell nothing more."""
        rows = np.array([len(s.judged) for s in self.stretches], dtype=np.float64)
        shares = np.array([s.fresh for s in self.stretches])
        return np.asarray(rows @ shares / rows.sum())

    @property
    def _begins_driven(self) -> bool:
        """Whether some data begin with an input, and nothing tells what there was before it."""
        drives = [stretch.drive for chain in self.chains for stretch in chain]
        return any(d.before is None and bool(np.any(d.inputs[:1])) for d in drives)

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

    def simulate(
        self, z: Array, shifts: Array | None = None, *, from_nothing: bool = False
    ) -> list[Array]:
        """Return for each scored stretch the judged outputs (N, n_y, P) of (P, d) vectors.

        Parameters
        ----------
        z:
            (P, d) vectors.
        shifts:
            (P, n) changes of the initial state in units of the stretch's state size.
        from_nothing:
            Whether there was no input before a record; else it was the first one.
        """
        table, results = self.values(z), []
        if not table or len(z) == 0:
            return []
        linear = linear_of(self.model, table, self.outputs)
        for _, group in groupby(self.chains, key=lambda chain: chain[0].drive.dt):
            chains = list(group)
            stretches = [stretch for chain in chains for stretch in chain]
            runs = self.program.run_chain(
                table,
                [s.drive.from_nothing() if from_nothing else s.drive for s in stretches],
                starts_of(self.model, table, stretches, shifts),
                restarts=list(accumulate(len(chain) for chain in chains)),
                substeps=self.substeps,
                threads=self.threads,
            )  # fmt: skip
            pairs = zip(runs, stretches, strict=True)
            results += [stretch.shown(run, linear) for run, stretch in pairs if stretch.scored]
        return results

    def in_steps(self, substeps: int, z: Array) -> 'Problem':
        """Return this problem in fewer steps of the integration, as right at a vector (d,).

        What these steps do wrong there is taken out of the data: residuals at the vector are those
        of this problem, and near it they differ by what a small move changes of a small error.
        With no fewer `substeps` a sample it is this problem itself.
        """
        if substeps >= self.substeps:
            return self

        def coarse(chains: Sequence[Chain]) -> Problem:
            return Problem(
                self.model, chains, self.outputs, substeps=substeps, threads=self.threads,
                prior=self.prior, one_sided=self.one_sided,
            )  # fmt: skip

        right, wrong = (one.simulate(z[np.newaxis]) for one in (self, coarse(self.chains)))
        wrongs = iter([b[:, :, 0] - a[:, :, 0] for a, b in zip(right, wrong, strict=True)])
        return coarse([
            tuple(one.moved(next(wrongs)) if one.scored else one for one in chain)
            for chain in self.chains
        ])

    @np.errstate(over='ignore', invalid='ignore')  # parameters on the way may be no motor
    def linearize(
        self, z: Array, *, parameters: bool = True, stride: float | None = None
    ) -> list[Linearization]:
        """Return residuals and derivatives of each scored stretch at one vector.

        Parameters
        ----------
        z:
            (d,) vector.
        parameters:
            Whether derivatives by the vector are wanted; without, ``slope`` is empty.
        stride:
            Step of the differences, where outputs are rough on a finer scale.
        """
        points, apart = self._cloud(z, stride) if parameters else (z[np.newaxis], np.empty(0))
        d, first = apart.size, len(points)
        cloud = np.concatenate((points, np.repeat(z[np.newaxis], 2 * len(self._open), axis=0)))
        shifts = np.zeros((len(cloud), len(self.model.kind.states)))
        for k, state in enumerate(self._open):
            shifts[first + 2 * k, state] = 1.0
            shifts[first + 2 * k + 1, state] = -1.0
        late = bool(self.program.delays) and self._begins_driven
        found, runs = [], self.simulate(cloud, shifts)
        without = self.simulate(z[np.newaxis], from_nothing=True) if late else runs
        for stretch, run, silent in zip(self.stretches, runs, without, strict=True):
            others = run[:, :, :1] if self.one_sided else run[:, :, 1 + d : first]
            slope = (run[:, :, 1 : 1 + d] - others) / apart
            tail = run[:, :, first:]
            wanted = [k for k, state in enumerate(self._open) if state in stretch.open_states]
            start = 0.5 * (tail[:, :, 0::2] - tail[:, :, 1::2])[:, :, wanted]
            if late and np.any(missing := silent - run[:, :, :1]):
                start = np.concatenate((start, missing), axis=2)
            found.append(
                Linearization(
                    stretch.judged - run[:, :, 0], _sane(slope), _sane(start), self.size[:d]
                )
            )
        return found

    def adopt(self, near: Sequence[Linearization]) -> tuple[Linearization, ...]:
        """Return what another problem with the same parameters gave, in coordinates of this one.

        The size of a coordinate is that of the value which its problem began with.
        """
        return tuple(
            one if np.array_equal(one.size, self.size)
            else replace(one, slope=one.slope * (self.size / one.size), size=self.size)
            for one in near
        )  # fmt: skip

    def _cloud(self, z: Array, stride: float | None) -> tuple[Array, Array]:
        """Return (P, d) vectors, z first and then its neighbours, and their (d,) distances."""
        lower, upper = self.box()
        step, each = self.steps(z, stride), np.eye(z.size, dtype=bool)
        up, down = np.minimum(z + step, upper), np.maximum(z - step, lower)
        if self.one_sided:
            ends = np.where(up > z, up, down)
            return np.concatenate((z[np.newaxis], np.where(each, ends, z))), ends - z
        both = (z[np.newaxis], np.where(each, up, z), np.where(each, down, z))
        return np.concatenate(both), up - down

    def steps(self, z: Array, stride: float | None = None) -> Array:
        """Return (d,) step of the differences at a vector, most of them a `stride` if given."""
        drives = [stretch.drive for stretch in self.stretches]
        end = max(d.start + d.dt * len(d.inputs) for d in drives)
        longest = max(d.dt for d in drives)
        values = {name: float(v[0]) for name, v in self.values(z[np.newaxis, :]).items()}
        return difference_steps(
            self._sized(), self.program.effects, values, longest, end, stride
        )

    def costs(self, z: Array, weighting: Weighting, at: Sequence[Linearization]) -> Array:
        """Return (P,) weighted sums of squares of (P, d) vectors; infinite where not a number.

        `at` is a linearization near by, whose initial-state directions are used.
        """
        total = self.surprise(z)
        free = weighting.bases([near.start for near in at])
        for stretch, basis, run in zip(self.stretches, free, self.simulate(z), strict=True):
            with np.errstate(over='ignore', invalid='ignore'):
                total += _costs(stretch.judged, run, basis, weighting)
        return np.where(np.isfinite(total), total, np.inf)

    def surprise(self, z: Array) -> Array:
        """Return (P,) weighted squares of the distance of (P, d) vectors from the prior."""
        if self.prior is None:
            return np.zeros(len(z))
        away = z - self.believed
        return np.asarray(np.einsum('pi,ij,pj->p', away, self.precision, away))

    def residuals(self, z: Array, weighting: Weighting) -> list[Array]:
        """Return for each scored stretch (N, n_y) measured minus simulated, best initial state."""
        return [self.settled(near, weighting) for near in self.linearize(z, parameters=False)]

    @staticmethod
    def settled(
        near: Linearization, weighting: Weighting, spread: Array | None = None
    ) -> Array:
        """Return (N, n_y) residual after the open initial states are set to their best values.

        Where their (m,) standard deviations are known, to the most likely ones.
        """
        if near.start.shape[2] == 0:
            return near.residual
        start = weighting.flat(near.start)
        error = weighting.flat(near.residual[:, :, np.newaxis])
        largest = np.maximum(np.max(np.abs(start)), np.max(np.abs(error)))
        if not largest < _RUNAWAY:  # or not a number
            return near.residual
        if spread is not None:
            start = np.concatenate((start, np.diag(1.0 / np.maximum(spread, _CERTAIN))))
            error = np.concatenate((error, np.zeros((spread.size, 1))))
        change = np.linalg.lstsq(start, error, rcond=None)[0]
        rest: Array = near.residual - near.start @ change[:, 0]
        return rest

    def _sized(self) -> list[tuple[Parameter, float]]:
        return list(zip(self.free, self.size.tolist(), strict=True))


def _costs(measured: Array, run: Array, basis: Array, weighting: Weighting) -> Array:
    """Return (P,) sums of squares of what the (K, m) `basis` of initial states cannot explain.

    White errors are summed in pieces that stay in the processor's cache.
    """
    total, along = np.zeros(run.shape[2]), np.zeros((basis.shape[1], run.shape[2]))
    length, width = run.shape[:2]
    piece = length if weighting.whiteners else _PIECE
    for a in range(0, length, piece):
        error = weighting.flat(measured[a : a + piece, :, np.newaxis] - run[a : a + piece])
        total += np.einsum('tk,tk->k', error, error)
        if basis.size:
            along += basis[a * width : a * width + len(error)].T @ error
    return np.asarray(total - np.einsum('mk,mk->k', along, along))


def _sane(slope: Array) -> Array:
    """Return derivatives, none where the step led to what is no motor or runs away."""
    sane = np.abs(slope) < _RUNAWAY
    return slope if np.all(sane) else np.where(sane, slope, 0.0)


def _size(parameter: Parameter) -> float:
    """Return the size of a coordinate step: the value, or a thousandth of a box that means it."""
    if parameter.logarithmic:
        return 1.0
    reach = 1e-3 * (parameter.upper - parameter.lower)
    if reach > _WIDE_OPEN:
        return abs(parameter.value) or 1.0
    return max(abs(parameter.value), min(reach, 1.0))
