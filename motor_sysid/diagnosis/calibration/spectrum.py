"""Read the noise of a recording from the spectrum of a fitted model's errors.

Every disturbance that is thought of (white and coloured errors of each sensor, random forces with
several memories) is simulated alone through the same model, cut and fitted like the data; so are
rounding and integration error, which are known.  `mixture` then finds those that make the
spectrum.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.calibration.mixture import parsimonious
from motor_sysid.diagnosis.calibration.noise import Noise, Source
from motor_sysid.diagnosis.calibration.twin import is_counted, Twin
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.estimation.batch import Chain, make_chain, sensors_of, Weighting
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.signals.lattice import lattice
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

SENSOR_MEMORIES = (0.0, 3.0, 30.0)
FORCE_MEMORIES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
"""Correlation times that are tried, in samples."""

LONGEST_MEMORY = 1 / 12
"""Of a stretch of data: a longer memory would bend the spectrum below its lowest frequency."""

DRAWS = 8
BANDS_PER_OCTAVE = 3
TAPER = 0.5
"""Independent values in a tapered periodogram, for each of its values."""

_SMALL = 0.01


def fit_noise(model: Model, bench: Bench, twins: Sequence[Twin], seed: int) -> Noise:
    """Fit the noise of training records.

    Parameters
    ----------
    model, bench:
        The fitted model and its data.
    twins:
        The training records in open loop, in the order in which they were given.
    seed:
        Of the simulations.
    """
    records = [twin.record for twin in twins]
    known = Noise((), _steps(model, records), all(is_counted(model, r) for r in records))
    bands = _Bands(model, bench, twins, seed)
    seen = bands.of_records(records)
    candidates = _sources(model, bench, known.counted)
    quiet = bands.simulated(known.only((), rounded=False))
    rounding = bands.simulated(known)
    alone = [
        np.maximum(bands.simulated(known.only((one,), rounded=False)) - quiet, 0.0)
        for one in candidates
    ]
    weights = TAPER * np.repeat(bands.counts, seen.shape[1])
    sizes = parsimonious(
        seen.ravel(), rounding.ravel(), np.column_stack([one.ravel() for one in alone]), weights
    )
    kept = [
        replace(one, sigma=float(one.sigma * np.sqrt(size)))
        for one, size in zip(candidates, sizes, strict=True)
        if size > 0.0
    ]
    noise = replace(known, sources=tuple(kept))
    off = 10 * np.log10(seen / bands.simulated(noise))
    return replace(
        noise, mismatch_db=float(np.sqrt(np.average(off.ravel() ** 2, weights=weights)))
    )


def _steps(model: Model, records: Sequence[Record]) -> dict[str, float]:
    """Return signal to the step that it comes in; for a counted speed that of the position."""
    steps = {}
    for output in model.kind.outputs:
        if all(output.signal in r for r in records):
            found = lattice(np.concatenate([r[output.signal] for r in records]))
            if found:
                steps[output.signal] = found.step
    if 'speed' in steps and all(is_counted(model, r) for r in records):
        speed = steps.pop('speed')
        steps.setdefault('position', speed * records[0].dt)
    return steps


def _sources(model: Model, bench: Bench, counted: bool) -> list[Source]:
    """Return what may disturb; a counted speed has no error but that of the position."""
    dt = bench.train[0][0].record.dt
    stretch = max(len(s.judged) for chain in bench.train for s in chain)
    memories = [n for n in FORCE_MEMORIES if n <= max(LONGEST_MEMORY * stretch, 1.0)]
    sources = []
    for j, signal in enumerate(bench.outputs):
        values = np.concatenate([s.judged[:, j] for chain in bench.train for s in chain])
        size = _SMALL * float(np.std(values))
        if signal != 'speed' or not counted:
            sources += [Source(signal, False, n * dt, size) for n in SENSOR_MEMORIES]
    if 'speed' in bench.outputs and model.speed_sensor is SpeedSensor.DIFFERENCE:
        sources.append(Source('position', False, 0.0, _SMALL * bench.scales.speed * dt))
    sizes = {'torque': bench.scales.torque, 'voltage': bench.scales.voltage}
    for force in model.kind.forces:
        size = _SMALL * sizes.get(force.name, 1.0)
        sources += [Source(force.name, True, n * dt, size) for n in memories]
    return sources


class _Bands:
    """Band powers of what a model leaves of records, beyond what its parameters can explain."""

    def __init__(self, model: Model, bench: Bench, twins: Sequence[Twin], seed: int) -> None:
        self.model, self.bench, self.twins, self.seed = model, bench, twins, seed
        problem = bench.problem(model)
        near = problem.linearize(problem.vector())
        self.weighting = Weighting(
            np.sqrt(np.mean(np.concatenate([one.residual for one in near]) ** 2, axis=0))
        )
        self.slope, _ = np.linalg.qr(self.weighting.flat(np.concatenate([n.slope for n in near])))
        dt = max(one.drive.dt for one in problem.stretches)
        longest = dt * max(len(one.residual) for one in near)
        count = int(np.log2(0.67 * longest / dt) * BANDS_PER_OCTAVE)
        self.edges = np.geomspace(0.75 / longest, 0.5 / dt * (1 + 1e-9), max(count, 2) + 1)
        self.counts, _ = self._power([one.residual for one in near], dt)
        self.filled = self.counts > 0
        self.counts = self.counts[self.filled]
        self.dt = dt

    def of_records(self, records: Sequence[Record]) -> Array:
        """Return (bands, n_y) mean power of the errors on records."""
        problem = replace(self.bench, train=self._cut_up(records)).problem(self.model)
        near = problem.linearize(problem.vector(), parameters=False)
        parts = [problem.settled(one, self.weighting) for one in near]
        flat = self.weighting.flat(np.concatenate(parts)[:, :, np.newaxis])
        flat = flat - self.slope @ (self.slope.T @ flat)
        joined = flat.reshape(-1, self.weighting.sigma.size) * self.weighting.sigma
        sizes = np.cumsum([len(part) for part in parts])[:-1]
        return self._power(np.split(joined, sizes), self.dt)[1][self.filled]

    def _cut_up(self, records: Sequence[Record]) -> tuple[Chain, ...]:
        """Cut records where the real ones are cut: what noise does to that is no difference."""
        bench, sensors = self.bench, sensors_of(records, self.bench.kind)
        chains = (
            make_chain(
                record.slice(0, rows), bench.kind, bench.outputs, horizon=bench.horizon,
                train_fraction=share, scored='train', sensors=sensors,
            )
            for record, (rows, share) in zip(records, bench.cuts, strict=False)
        )  # fmt: skip
        return tuple(chain for chain in chains if chain)

    def simulated(self, noise: Noise) -> Array:
        """Return the mean band power of a few simulations."""
        rng = np.random.default_rng(self.seed)
        draws = DRAWS if noise.sources or noise.steps else 1
        return np.asarray(
            np.mean(
                [
                    self.of_records([twin.make(noise, rng) for twin in self.twins])
                    for _ in range(draws)
                ],
                axis=0,
            )
        )

    def _power(self, parts: Sequence[Array], dt: float) -> tuple[Array, Array]:
        """Return frequencies in each band, and the mean power (bands, n_y)."""
        counts = np.zeros(self.edges.size - 1)
        power = np.zeros((counts.size, parts[0].shape[1]))
        for part in parts:
            window = np.hanning(len(part) + 2)[1:-1]
            spectrum = np.abs(np.fft.rfft(part * window[:, np.newaxis], axis=0)) ** 2
            spectrum *= dt / np.sum(window**2)
            place = np.digitize(np.fft.rfftfreq(len(part), dt), self.edges) - 1
            for k in range(counts.size):
                inside = place == k
                counts[k] += np.sum(inside)
                power[k] += np.sum(spectrum[inside], axis=0)
        return counts, power / np.maximum(counts, 1)[:, np.newaxis]
