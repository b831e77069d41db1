"""A candidate after its refit, what it is compared with, and whether it passes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from motor_sysid.diagnosis.candidates.left_noise import AR_ORDER
from motor_sysid.diagnosis.candidates.matched_filter import TOP_ORDER
from motor_sysid.diagnosis.candidates.score import Scored
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.gain import (
    Gain,
    gain_percent,
    is_certain,
    is_in_few,
    steadiness,
)
from motor_sysid.diagnosis.search.gates import (
    DEEP,
    DEEP_SHARE,
    gate_note,
    HALVED,
    IN_FEW,
    INEXACT,
    MENDED,
    MIN_FURTHER_SHARE,
    MIN_SHARE,
    misfit_of_laws,
    MORE,
    NO_EVIDENCE,
    SURE_GAIN,
    TORN,
    WORN,
)
from motor_sysid.diagnosis.search.rung import climb, profile_cost, Rung, slopes, SPOILED
from motor_sysid.diagnosis.search.sense import MOMENTS_APART
from motor_sysid.diagnosis.where.compare import likely
from motor_sysid.estimation.batch import Linearization, Weighting
from motor_sysid.estimation.batch.weighting import coloured
from motor_sysid.physics.effect import Effect, Scale

ONLY_NOISE = 1.02
"""Whitened variance, in units of the noise, up to which a model leaves nothing to look for."""

SURELY_MORE = 1.04
"""The same from which on a model leaves something for certain: a noise model is that much off."""

JUST = 0.1
"""Share of what is above noise that may be left, or taken beyond it, where that is less: what a
noise model has not right, no law takes away just so."""


@dataclass(frozen=True)
class Trial:
    """A candidate after its refit.

    Attributes
    ----------
    scored:
        The score that it was chosen by.
    rung:
        The fitted model.
    delta_bic:
        Gain in BIC under the noise model that the whole dictionary leaves.
    gain_percent:
        Relative decrease of the held-out error.
    steady:
        Steadiness of that decrease over held-out blocks, 0 to 1; see `MIN_STEADY`.
    note:
        Why it does not pass, or empty.
    excess:
        Whitened variance that the refit leaves, in units of the noise; 1 where only noise is left.
    """

    scored: Scored
    rung: Rung
    delta_bic: float
    gain_percent: float
    steady: float
    note: str
    excess: float

    @property
    def key(self) -> str:
        """Key of the effect."""
        return self.scored.variant.effect.key

    @property
    def passes(self) -> bool:
        """Whether every gate was passed."""
        return not self.note


@dataclass(frozen=True)
class Level:
    """What a refit is compared with: the model without the effect, under the same noise model.

    Attributes
    ----------
    rung:
        The fitted model.
    weighting:
        The noise model that the whole dictionary leaves on it.
    cost, rows:
        Least whitened sum of squares of the model under that noise model, and its rows.  The model
        was fitted under a noise model of its own, which more must not be counted for an effect.
    explained:
        Decrease of that sum of squares by the effects that the model has.
    """

    rung: Rung
    weighting: Weighting
    cost: float
    rows: int
    explained: float = 0.0

    @classmethod
    def of(
        cls, rung: Rung, bench: Bench, weighting: Weighting, base: Rung | None = None
    ) -> 'Level':
        """Take the level of a fitted model; `base` is the fit that had no effects yet."""
        near = slopes(rung, bench)
        again = climb(rung.model, bench, weighting, briefly=True, near=near)
        costs = [profile_cost(one, bench, weighting) for one in (rung, again)]
        cost = min(cost if np.isfinite(cost) else np.inf for cost, _ in costs)
        if base is None or base.model.effects == rung.model.effects:
            return cls(rung, weighting, cost, costs[0][1])
        before, _ = profile_cost(base, bench, weighting)
        return cls(rung, weighting, cost, costs[0][1], before - cost)

    @property
    def is_incomplete(self) -> bool:
        """Whether the model leaves more than noise for certain."""
        return self.cost > SURELY_MORE * self.rows

    def leaves(self, widens: bool, after: float) -> bool:
        """Whether the model leaves more than noise for certain, beside what leaves `after`.

        The whole dictionary knows the noise, and better than it does a law that `widens` one of
        the model and leaves less: no touch of each effect makes a law that is far from linear.
        Less is certain, too, where just that is taken away: then the noise is as it was told.
        """
        noise = min(float(self.rows), after) if widens else float(self.rows)
        just = abs(after - self.rows) < JUST * (self.cost - self.rows)
        told = just and self.cost > ONLY_NOISE * self.rows
        return self.cost > SURELY_MORE * noise or (told and not widens)

    def clears(self, after: float) -> bool:
        """Whether what leaves `after` leaves nothing but noise where there was more."""
        beyond = self.cost - self.rows
        torn = self.cost > TORN * self.rows or (
            self.cost > WORN * self.rows and self.cost - after > DEEP_SHARE * beyond
        )
        return torn and after < MENDED * self.rows

    def mends(self, after: float) -> bool:
        """Whether a wider law that leaves `after` does more than follow the narrow one's effect.

        It leaves nothing but noise where there was more, or adds much to what is explained.
        """
        return self.clears(after) or self.cost - after > MORE * self.explained > 0.0

    def gain(self, new: Rung, bench: Bench) -> float:
        """Return the gain in BIC of a fitted model with more parameters."""
        extra = len(new.model.parameters.free) - len(self.rung.model.parameters.free)
        after, _ = profile_cost(new, bench, self.weighting)
        return self.cost - after - extra * float(np.log(self.rows))


def judged(
    scored: Scored,
    new: Rung,
    level: Level,
    bench: Bench,
    near: Sequence[Linearization] = (),
) -> Trial:
    """Pass a refit through the gates; `near` if the refit does not hold its own."""
    rung = level.rung
    if not np.isfinite(new.result.cost + new.held.error_percent):
        return Trial(scored, rung, -np.inf, 0.0, 0.0, 'cannot be simulated', np.inf)
    kept = replace(new, near=tuple(near)) if near else new
    after, _ = profile_cost(kept, bench, level.weighting)
    gained = _gained(scored, kept, after, level, bench)
    note = gate_note(scored, new, rung, gained, bench.scales.duration)
    enough = gained.delta_bic > bench.threshold
    if note == NO_EVIDENCE and enough:
        note = INEXACT
    spoilt = new.held.error_percent > SPOILED * rung.held.error_percent
    if bench.shows(scored.variant.effect.key) and enough and not spoilt:
        note = ''
    if not note and new.model.kind.jumps and is_in_few(rung.held, new.held, level.weighting):
        note = IN_FEW
    excess = after / level.rows
    return Trial(scored, new, gained.delta_bic, gained.percent, gained.steady, note, excess)


def _gained(scored: Scored, new: Rung, after: float, level: Level, bench: Bench) -> Gain:
    """Return what a refit gains that leaves the whitened sum of squares `after`."""
    rung, rows, inherits = level.rung, level.rows, scored.variant.inherits
    delta, gain = level.gain(new, bench), gain_percent(rung.held, new.held)
    halved = new.training.error_percent < HALVED * rung.training.error_percent
    if delta < bench.threshold and halved and gain > SURE_GAIN:
        delta = max(delta, gain_of_likelihood(new, rung, bench))
    share = (level.cost - after) / max(level.cost - rows, 1e-300)
    small = share > (MIN_FURTHER_SHARE if rung.model.effects else MIN_SHARE)
    small = small and (not rung.model.effects or level.leaves(inherits, after))
    certain = small and is_certain(rung.held, new.held, level.weighting)
    far = level.cost > DEEP * rows or (level.clears(after) and not inherits)
    return Gain(
        delta_bic=delta - searching(scored.variant.effect, rows // len(bench.outputs)),
        threshold=max(bench.threshold, _inexactness(scored, level, bench)),
        asked=bench.threshold,
        percent=gain,
        steady=steadiness(rung.held, new.held),
        certain=certain,
        deep=certain and share > DEEP_SHARE and far,
        mends=level.mends(after),
    )


def _inexactness(scored: Scored, level: Level, bench: Bench) -> float:
    """Return the gain in BIC that what laws and integration have not right may make."""
    guessed, turn = level.rung.model, bench.scales.size(Scale.ANGLE)
    for key in filter(bench.shows, level.rung.model.effects):
        guessed = guessed.without_effect(key)  # its law was seen to be right
    laws = misfit_of_laws(scored, guessed, level.explained, bench.outputs, turn)
    return max(laws, bench.wrong * level.cost)


def gain_of_likelihood(new: Rung, old: Rung, bench: Bench) -> float:
    """Return the gain in BIC over a smaller model, each under the noise model of its own errors.

    The one that the whole dictionary leaves knows nothing where a sharp law is far from right: its
    jumps are all that it sees.  Both own noise models are of the same order and fitted alike; what
    that of the smaller model takes of an effect is not counted for it.
    """
    likelihood, fresh = [], bench.problem(new.model).fresh
    for rung in (new, old):
        errors = likely(slopes(rung, bench), bench.problem(rung.model))
        own = coloured(errors, AR_ORDER)
        own = replace(own, sigma=own.sigma / np.sqrt(fresh))
        squares = sum(float(np.sum(own.flat(e[:, :, np.newaxis]) ** 2)) for e in errors)
        count = sum(max(len(e) - own.order, 0) for e in errors)
        likelihood.append(squares + 2.0 * count * float(np.sum(fresh * np.log(own.sigma))))
    extra = len(new.model.parameters.free) - len(old.model.parameters.free)
    rows = count * float(np.sum(fresh))
    return likelihood[1] - likelihood[0] - extra * float(np.log(rows))


Ladder = list[tuple[Rung, list[Trial]]]
"""What was fitted, one effect after the other, each with what was tried on it."""


def searching(one: Effect, samples: int) -> float:
    """Return the price in BIC of a shape that was looked for everywhere: twice the log of where.

    Noise alone makes some wave stand out of thousands.
    """
    card = one.card
    places = TOP_ORDER if card.orders else 1
    places *= samples // 2 if card.frequency else MOMENTS_APART if card.moment else 1
    return 2.0 * float(np.log(places))
