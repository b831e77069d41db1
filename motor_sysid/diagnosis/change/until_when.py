"""Say until when a model held: the errors of a fit to one end of a record, over the whole of it.

A fit to the whole record spreads a change of the motor over all of it.  So the model is fitted to
the first two fifths and run over everything, and again with the last two fifths: wherever the
change lies, one of the two saw only one side of it.  Where the error then changes its size for
good, the record is cut and each side is fitted by itself; only if that explains the data much
better than one fit (Chow's test, by BIC) has the motor changed, and the parameters that differ say
how.  (Chow, Econometrica 28, 1960, 591-605.)

What comes at once is often a brake, a seal or a bearing that binds: dry friction, which a model
without any would tell as a viscous one many times as large.  So both sides are fitted with it too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.change.change_point import change_point
from motor_sysid.diagnosis.search.bench import look_ahead
from motor_sysid.diagnosis.where.compare import compare
from motor_sysid.estimation.batch import Chain, fit, FitResult, make_chain, Problem
from motor_sysid.estimation.batch.chains import observed_outputs
from motor_sysid.estimation.batch.weighting import coloured, Weighting
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import scales_of
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

END = 0.4
"""Share of the record at either end that a fit looks at."""

ORDER = 12
MIN_SAMPLES = 500
MIN_RATIO = 1.3
"""The error must grow by this factor, or fall."""

MIN_GAIN = 0.05
MIN_DELTA_BIC = 20.0
"""What two fits must gain over one: relative decrease of the error, and BIC."""

CERTAIN, WORTH, LEAST = 4.0, 0.03, 0.1
"""A parameter has changed if it moved by so many standard deviations, by that share of its value,
and at least a tenth as certainly as the one that changed most certainly."""

DRY = 'coulomb_friction'
"""What both sides are fitted with besides, where the model has no dry friction."""

NEW = 0.05
"""Share of an amplitude that was there before, below which its effect has come (or gone)."""


@dataclass(frozen=True)
class Held:
    """When a model stopped holding.

    Attributes
    ----------
    time:
        The moment, in the record's time, s.
    ratio:
        Error of the model of one side on the other side, over that on its own.
    delta_bic:
        Gain of two fits over one.
    changed:
        Parameter to its values before and after, most certain first; empty if no single one can
        be named.
    model:
        The model after it, with dry friction if that is what came or went; None if not known.
    """

    time: float
    ratio: float
    delta_bic: float
    changed: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    model: Model | None = None


def held_until(
    model: Model, record: Record, *, alpha: float = 0.01, rng: np.random.Generator | None = None
) -> Held | None:
    """Return when a fitted model stopped holding, or None if it held throughout.

    Parameters
    ----------
    model:
        A model that was fitted to the record, effects included.  One whose effects depend on time
        is not examined: it says itself when something changed.
    record:
        The data.
    alpha:
        False-alarm rate of the search (the fits that follow lower it further).
    rng:
        For the threshold of the search; by default a fixed one.
    """
    even = record.uniform()
    if len(even) < MIN_SAMPLES or any('t' in effect(key).needs() for key in model.effects):
        return None
    bench = _Bench(model, even)
    chance = rng or np.random.default_rng(0)
    places = [bench.search(first, alpha / 2, chance) for first in (True, False)]
    found = [held for place in places if place and (held := bench.confirmed(*place))]
    return max(found, key=lambda one: one.delta_bic, default=None)


class _Bench:
    """One record, and fits to parts of it."""

    def __init__(self, model: Model, record: Record) -> None:
        self.model, self.record = model, record
        self.outputs = observed_outputs(model.kind, [record])
        values = model.parameters.values()
        self._horizon = look_ahead(model.kind, values, [record], self.outputs)
        self._whole: FitResult | None = None

    def _chain(self, first: int, last: int) -> Chain:
        part = self.record.slice(first, last)
        return make_chain(part, self.model.kind, self.outputs, horizon=self._horizon)

    def _fit(self, first: int, last: int, model: Model | None = None) -> FitResult:
        problem = Problem(model or self.model, [self._chain(first, last)], self.outputs)
        return fit(problem, reweight=1, iterations=15)

    def _errors(self, model: Model) -> Array:
        """Return (N, n_y) errors over the whole record."""
        chain = [self._chain(0, len(self.record))]
        return np.concatenate(compare(model, chain, self.outputs).residuals)

    def search(
        self, early: bool, alpha: float, rng: np.random.Generator
    ) -> tuple[int, float] | None:
        """Look for the sample after which the fit to one end no longer holds.

        Returns
        -------
        The sample, and how much larger the error is beyond it.
        """
        count = len(self.record)
        size = int(END * count)
        own = slice(0, size) if early else slice(count - size, count)
        errors = self._errors(self._fit(own.start, own.stop).model)
        white = coloured([errors[own]], ORDER)
        flat = white.flat(errors[:, :, np.newaxis]).reshape(-1, errors.shape[1])
        found = change_point(flat, alpha, rng)
        if found is None:
            return None
        ratio = found.ratio if early else 1 / found.ratio
        return (found.index + ORDER, ratio) if ratio > MIN_RATIO else None

    def _sides(self, place: int, model: Model | None = None) -> tuple[FitResult, FitResult]:
        return self._fit(0, place, model), self._fit(place, len(self.record), model)

    def _border(self, before: FitResult, after: FitResult) -> int:
        """Return the sample from which on the one model is better than the other."""
        size = np.sqrt(np.mean(np.concatenate([*before.residuals, *after.residuals]) ** 2, axis=0))
        first, second = (
            np.sum((self._errors(side.model) / size) ** 2, axis=1) for side in (before, after)
        )
        return int(np.argmin(np.cumsum(np.append(0.0, first - second))))

    def confirmed(self, place: int, ratio: float) -> Held | None:
        """Cut the record there and fit both sides; None if that gains too little."""
        count = len(self.record)
        if min(place, count - place) < MIN_SAMPLES // 2:
            return None
        whole = self._whole = self._whole or self._fit(0, count)
        sides = self._sides(place)
        other = self._border(*sides)
        if min(other, count - other) >= MIN_SAMPLES // 2 and other != place:
            both = {place: sides, other: self._sides(other)}
            place = min(both, key=lambda cut: _left(both[cut]))
            sides = both[place]
        parts = [np.concatenate(side.residuals) for side in sides]
        errors = np.concatenate(whole.residuals)
        weighting = coloured(parts, ORDER)
        one, two = _cost([errors], weighting), _cost(parts, weighting)
        rows = errors.size
        gain = 1 - np.sqrt(np.sum(_scaled(parts, errors)) / errors.shape[1])
        delta = one - two - len(self.model.parameters.free) * np.log(rows)
        if not (np.isfinite(delta) and delta > MIN_DELTA_BIC and gain > MIN_GAIN):
            return None
        place, sides = self._with_friction(place, sides, weighting)
        time = float(self.record.time[place] - self.record.time[0])
        return Held(time, ratio, float(delta), _changed(*sides), sides[1].model)

    def _with_friction(
        self, place: int, sides: tuple[FitResult, FitResult], weighting: Weighting
    ) -> tuple[int, tuple[FitResult, FitResult]]:
        """Return place and fits of both sides, with dry friction if that came or went there."""
        dry, count = effect(DRY), len(self.record)
        has_it = any('omega_eps' in effect(key).needs() for key in self.model.effects)
        if has_it or not self.model.admits(dry):
            return place, sides
        values = self.model.parameters.values()
        scales = scales_of(self.model.motor, values, [self.record])
        model = self.model.with_effect(DRY, scales=scales)
        found = self._sides(place, model)
        costs = [
            _cost([np.concatenate(side.residuals) for side in pair], weighting)
            for pair in (sides, found)
        ]
        better = costs[0] - costs[1] - 2 * np.log(count * len(self.outputs)) > MIN_DELTA_BIC
        if not better or f'{DRY}.{dry.card.amplitudes[0].name}' not in _changed(*found):
            return place, sides
        border = int(np.clip(self._border(*found), MIN_SAMPLES // 2, count - MIN_SAMPLES // 2))
        return border, self._sides(border, model)


def _cost(parts: Sequence[Array], weighting: Weighting) -> float:
    return float(sum(np.sum(weighting.flat(part[:, :, np.newaxis]) ** 2) for part in parts))


def _left(sides: Sequence[FitResult]) -> float:
    """Return the squared error that the sides leave: the product over the outputs, as a log."""
    errors = np.concatenate([e for side in sides for e in side.residuals])
    return float(np.sum(np.log(np.sum(errors**2, axis=0))))


def _scaled(parts: Sequence[Array], whole: Array) -> Array:
    """Return (n_y,) squared error of the parts over that of the whole."""
    share: Array = np.sum(np.concatenate(parts) ** 2, axis=0) / np.sum(whole**2, axis=0)
    return share


def _changed(before: FitResult, after: FitResult) -> dict[str, tuple[float, float]]:
    """Return the parameters that differ for certain, most certain first."""
    sure: dict[str, float] = {}
    for p in before.model.parameters.free:
        q = after.model.parameters[p.name]
        spread = np.hypot(p.sigma or 0.0, q.sigma or 0.0)
        if not np.isfinite(spread) or spread <= 0:
            continue
        certain = abs(q.value - p.value) / spread
        if certain > CERTAIN and abs(q.value - p.value) > WORTH * abs(p.value):
            sure[p.name] = float(certain)
    top = max(sure.values(), default=0.0)
    names = sorted((n for n in sure if sure[n] > LEAST * top), key=lambda name: -sure[name])
    return {n: (before.model[n], after.model[n]) for n in names}


def change_in_words(model: Model, held: Held | None, offset: float = 0.0) -> str:
    """Say until when the model held and what changed then; empty if nothing did.

    Parameters
    ----------
    model:
        The fitted model; an effect of it that sets in at a moment says what changed.
    held:
        What was found for a model without such an effect.
    offset:
        Added to times, s.
    """
    moments = [(key, name) for key in model.effects if (name := effect(key).card.moment)]
    if moments:
        key, name = min(moments, key=lambda pair: model[f'{pair[0]}.{pair[1]}'])
        when, what = model[f'{key}.{name}'] + offset, effect(key).card.title
        return f'The model held until {when:.1f} s, then {what}{_size(model, key)}.'
    if held is None:
        return ''
    after = held.model or model
    ways = [_way(after, name, *pair) for name, pair in held.changed.items()]
    what = ', '.join(ways) or f'the error was {held.ratio:.2g} times as large'
    return f'The model held until {held.time + offset:.1f} s, then {what}.'


def _size(model: Model, key: str) -> str:
    first = effect(key).card.amplitudes[0]
    p = model.parameters[f'{key}.{first.name}']
    if p.unit == '1':
        return f' {100 * p.value:+.3g} %'
    return f' ({first.name} = {p.value:.3g} {p.unit})'


def _way(model: Model, name: str, before: float, after: float) -> str:
    p = model.parameters[name]
    if name.startswith(f'{DRY}.') and min(before, after) < NEW * max(before, after):
        came, what = after > before, effect(DRY).card.title
        shown = f'{name.removeprefix(DRY)[1:]} = {max(before, after):.3g} {p.unit}'
        return f'{what} came ({shown})' if came else f'{what} went ({shown} before)'
    if p.logarithmic:
        return f'{name} ({p.description}) {100 * (after / before - 1):+.3g} %'
    return f'{name} ({p.description}) from {before:.3g} to {after:.3g} {p.unit}'
