"""A diagnosis laid out for the page: what all of its models have in common."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.result import Diagnosis
from motor_sysid.errors import UserError
from motor_sysid.signals.metrics import sizes_of
from motor_sysid.workbench.axis import lay_out, Stretch
from motor_sysid.workbench.channels import Channel, channels_of, primary_of
from motor_sysid.workbench.regimes import Bins, Grid, grid_of, regimes_of
from motor_sysid.workbench.words import effect_titles

Array = NDArray[np.float64]

TRACE_BYTES = 400_000
"""Base64 text that all traces of a page may take together."""

POINTS = (1_000, 6_000)
"""Fewest and most points of a trace."""

SMALLEST = 1e-300
"""A mean square that nothing is divided by less of."""


@dataclass(frozen=True)
class Bench:
    """A diagnosis with all that its steps have in common.

    Attributes
    ----------
    primary:
        Output whose error is mapped; empty if there is none.
    sigma:
        Standard deviation of its sensor noise; 0 if unknown.
    held:
        Indices of the records that errors are judged on.
    regimes, grid:
        Conditions at each sample, None where the records do not tell.
    titles:
        Effect key to title.
    parents:
        For each step the index of the one that it was made from, -1 for none.
    last:
        Index of the step that the verdict is about.

    Raises
    ------
    UserError
        From `of`, if the diagnosis has no record or no model.
    """

    diagnosis: Diagnosis
    stretches: tuple[Stretch, ...]
    channels: tuple[Channel, ...]
    primary: str
    sigma: float
    held: tuple[int, ...]
    regimes: tuple[Bins, ...] | None
    grid: Grid | None
    titles: dict[str, str]
    parents: tuple[int, ...]
    last: int

    @classmethod
    def of(
        cls, diagnosis: Diagnosis, parents: Sequence[int] | None = None, last: int | None = None
    ) -> 'Bench':
        """Lay a diagnosis out on one time axis and find the conditions of each sample."""
        if not diagnosis.records or not diagnosis.steps:
            raise UserError('nothing to show: the diagnosis has no record or no model')
        records, roles, sigmas = diagnosis.records, diagnosis.roles, diagnosis.noise_sigma
        channels = channels_of(diagnosis)
        primary = primary_of(channels)
        every = tuple(range(len(records)))
        held = tuple(k for k in every if roles[k] == 'validate') or every
        return cls(
            diagnosis=diagnosis,
            stretches=lay_out(records, roles, _points(diagnosis, channels)),
            channels=channels,
            primary=primary,
            sigma=sigmas.get(primary, 0.0),
            held=held,
            regimes=regimes_of(records, sigmas.get('speed', 0.0)),
            grid=grid_of(records, sum(len(records[k]) for k in held)),
            titles=effect_titles(diagnosis),
            parents=tuple(range(-1, len(diagnosis.steps) - 1) if parents is None else parents),
            last=len(diagnosis.steps) - 1 if last is None else last,
        )

    def error(self, step: int, record: int, name: str) -> Array | None:
        """Return (N,) measured minus model, or None where either is missing."""
        prediction = self.diagnosis.steps[step].predictions[record].get(name)
        if prediction is None or name not in self.diagnosis.records[record]:
            return None
        error: Array = self.diagnosis.records[record][name] - prediction
        return error

    def held_errors(self, step: int, name: str) -> Array:
        """Return the errors of output `name` on all held-out samples, NaN where missing."""
        errors = [self.error(step, k, name) for k in self.held]
        return np.concatenate(
            [
                np.full(len(self.diagnosis.records[k]), np.nan) if error is None else error
                for k, error in zip(self.held, errors, strict=True)
            ]
        )

    @np.errstate(over='ignore')  # a model that ran away
    def held_sizes(self, step: int) -> Array:
        """Return the size of the error of each held-out sample, 1 is as large as the signal.

        All outputs that are judged count alike; the RMS of it is the error that the ladder shows.
        """
        percents = self.diagnosis.steps[step].channel_errors
        found = {n: self.held_errors(step, n) for n, p in percents.items() if not np.isnan(p)}
        errors = {name: error for name, error in found.items() if np.isfinite(error).any()}
        good = np.all([np.isfinite(error) for error in errors.values()], axis=0)
        if not errors or not good.any():
            return np.full(sum(len(self.diagnosis.records[k]) for k in self.held), np.nan)
        records = [self.diagnosis.records[k] for k in self.held]
        signals = [
            np.concatenate([r.signals.get(name, np.zeros(len(r))) for r in records])[good]
            for name in errors
        ]
        sizes = np.maximum(sizes_of(list(errors), [np.column_stack(signals)]), SMALLEST)
        mean: Array = np.mean((np.column_stack(list(errors.values())) / sizes) ** 2, axis=1)
        return np.sqrt(mean)

    def held_counts(self) -> Bins:
        """Return the number of held-out samples in each cell of the map."""
        assert self.grid is not None
        rows, columns = self.grid.shape
        cells = np.concatenate([self.grid.cells[k] for k in self.held])
        return np.bincount(cells[cells >= 0], minlength=rows * columns)


def _points(diagnosis: Diagnosis, channels: Sequence[Channel]) -> int:
    """Return how many points each trace may have so that the page stays small."""
    outputs = sum(channel.kind == 'output' for channel in channels)
    traces = 1 + len(channels) + 2 * outputs * len(diagnosis.steps)
    return int(np.clip(TRACE_BYTES * 3 / 16 / traces, *POINTS))
