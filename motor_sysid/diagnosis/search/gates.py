"""Whether what an effect gains is real: the gates that it must pass."""

from collections.abc import Sequence

import numpy as np

from motor_sysid.diagnosis.candidates.score import Scored
from motor_sysid.diagnosis.search.gain import Gain, gain_percent, MIN_STEADY
from motor_sysid.diagnosis.search.rung import certainty, Rung, SPOILED
from motor_sysid.diagnosis.search.sense import (
    is_impossible,
    is_vague,
    narrowed,
    senseless,
    TOLD,
)
from motor_sysid.physics.effect import Effect
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

MIN_GAIN_PERCENT = 1.0
MIN_FURTHER_GAIN_PERCENT = 5.0
"""Relative decrease of the held-out error that an effect must bring to matter: the first one, and
every further one, for what the first does not fit to the last detail looks like a second one."""

MIN_CERTAIN_GAIN_PERCENT = 0.5
"""The same for a further effect whose gain is beyond doubt: no law is exact to the last detail,
and enough data show it."""

LEAST_GAIN_PERCENT, LEAST_DROP_PERCENT = 0.1, 0.2
"""Relative decrease of the held-out error, and the size of what goes from it in percent of the
signal, one of which what is certain must bring all the same: below, any neighbour does as well,
and nobody would add it."""

MIN_WIDER_GAIN_PERCENT = 2.0
"""The same where the effect widens one that the model has: two extra parameters of a friction
law first of all make up for what the narrower law has not right to the last detail."""

TORN, WORN, MENDED = 1.3, 1.05, 1.04
"""Whitened variance, in units of the noise, that a law must leave (the smaller where a wider one
takes away nearly all of that), and that a wider one may leave, so that it is believed like any
further effect: nothing is then left for another to explain."""

MORE = 0.2
"""Part of what the effects of a model explain, which no wider law adds to it by making up for what
they have not right."""

BLURRED = np.pi
"""Radians of a wave over a turn that pass within a sample at the usual speed, from which on it is
seen near standstill alone, where no law of dry friction is right to the last detail."""

UNPHYSICAL = 'unphysical sign'
NO_EVIDENCE = 'no evidence'
UNCERTAIN = 'its size cannot be told from nothing'
TRIFLE = 'lowers the error by next to nothing'
INEXACT = 'could be what laws and integration of the model have not right to the last detail'
TOO_LITTLE = 'lowers the held-out error by'
UNSTEADY = 'helps in some of the held-out data and harms in other'
IN_FEW = 'lowers the held-out error in few samples only'
TAKES_OVER = 'would be nothing with it'
"""How the note ends of an effect that takes the place of a parameter of the motor."""

HELD_BACK = (TOO_LITTLE, UNSTEADY)
"""How notes begin that keep an effect out which the training data speak for."""

NOTHING_LEFT, NEXT_TO_NOTHING = 1e-3, 1e-2
"""Parameter of the motor over what it was, below which it is nothing; beside effects that were
there before also if it cannot be told from nothing then."""

ALL_BUT_A_TRIFLE = 0.99
"""Share of the squared held-out error that effects must explain with which a friction of the motor
turns out to be nothing: a law may take in a little of it, and wrong ones do not explain so much
together."""

WILD_PERCENT = 50.0
"""Held-out error from which on a model knows nothing, whatever its standard errors."""

KNOWN = 0.3
"""Relative standard error of a motor's parameter below which it is known to be there."""

LEAST_CERTAINTY = 9.0
"""Squared number of honest standard errors that an amplitude must be from zero: where errors come
in bursts, evidence alone counts more than there is."""

SURE, SURE_GAIN = 50.0, 10.0
"""Evidence in units of what noise asks for, and fall of the held-out error in percent, with which
an effect is there even if its amplitude cannot be told from nothing together with all the others:
a combination of it and the motor's own parameters may be all that the data see."""

HALVED = 0.5
"""Error over the training data, in units of that before, below which what an effect acts on may be
rare in the held-out data: their error need not fall steadily, nor by as much for an effect to be
there for sure."""

MIN_SHARE, MIN_FURTHER_SHARE = 0.1, 0.5
"""Share of all that the whole dictionary could still explain, which such a small effect must
explain alone: the first one, and further ones, which may be the misfit of the first."""

DEEP, DEEP_SHARE = 2.0, 0.8
"""Whitened variance, in units of the noise, that no misfit of a law leaves, and the share of what
is beyond the noise that an effect takes away, for it to be believed however little it lowers an
error that is nearly all noise; so is what takes away as much of less and leaves only noise, if it
is no wider form of what the model has."""

ALIKE = 0.9999
"""Share of an effect that base parameters mimic, above which they are called alike."""


def gone(new: Model, old: Model) -> str:
    """Return a parameter of the motor that was well known and is now nothing, or nothing.

    Friction may turn out to be of another kind, and an inductance may be too small to be seen;
    back-EMF, resistance and inertia are always there.
    """
    before = {p.name: p for p in old.parameters}
    for p in new.parameters.free:
        was = before.get(p.name)
        if was is None or was.on_bound or was.sigma is None:
            continue
        if '.' in p.name or p.unit == 'H':
            continue
        untold = bool(old.effects) and p.sigma is not None and p.sigma > p.value
        left = NEXT_TO_NOTHING if untold else NOTHING_LEFT
        nothing = p.on_bound or p.value < left * was.value
        if p.logarithmic and nothing and was.sigma < KNOWN * was.value:
            return f'{p.name} ({p.description})'
    return ''


def is_wild(rung: Rung) -> bool:
    """Whether a model is so far off that it knows nothing of its parameters."""
    return rung.held.error_percent > WILD_PERCENT


def _missed(new: Rung, old: Rung) -> str:
    """Return what is `gone`, or nothing where a wild model found its way out without it."""
    left = new.held.error_percent**2 / max(old.held.error_percent**2, 1e-300)
    if is_wild(old) and left < 1 - ALL_BUT_A_TRIFLE:
        return ''
    return gone(new.model, old.model)


def is_told(model: Model, key: str) -> bool:
    """Whether an amplitude of an effect is told from zero, by data or its box."""
    own = [model.parameters[f'{key}.{a.name}'] for a in effect(key).card.amplitudes]
    boxed = any(p.lower > 0.0 for p in own)
    return boxed or any(not p.on_bound and abs(p.value) >= TOLD * (p.sigma or 0.0) for p in own)


def is_doubted(model: Model, key: str) -> bool:
    """Whether an effect is not told from zero, or from a special case of it."""
    wider = any(is_vague(model, key, special) for special in effect(key).card.generalises)
    return wider or bool(narrowed(model, key)) or not is_told(model, key)


def why_idle(rung: Rung, without: Rung, key: str, duration: float) -> str:
    """Return why an effect of the last fit may as well be left out, or nothing.

    In the last fit signs are sharper and noise is taken as it is.  What does next to nothing then
    may be nothing: where a shape of a law is at the end of what the data show, and its amplitude
    with it, the law may stand for any other, the more so where no amplitude is seen but in
    combination.  A further effect that is told, but lowers no error to speak of, has had its
    chance: while models are climbed to, what lowers an error by little may lead far down.  Nor may
    it have come to what makes no sense within the `duration` of a record, s, nor in the end leave
    nothing of a parameter of the motor that was well known, for a gain that is no large one.
    """
    if why := senseless(rung.model, key, duration):
        return why
    gain = gain_percent(without.held, rung.held)
    further = bool(without.model.effects)
    if further and gain < SURE_GAIN and (lost := gone(rung.model, without.model)):
        return f'{lost} {TAKES_OVER}'
    much = further or not is_seen(rung.model, key)
    least = MIN_FURTHER_GAIN_PERCENT if much else MIN_GAIN_PERCENT
    if gain < least and not is_told(rung.model, key):
        return UNCERTAIN
    trifle = further and not is_usual(effect(key), rung.model)
    return TRIFLE if trifle and not is_worth_it(rung, without, gain) else ''


def is_seen(model: Model, key: str) -> bool:
    """Whether the data see some amplitude of an effect by itself."""
    own = [model.parameters[f'{key}.{a.name}'] for a in effect(key).card.amplitudes]
    return any(np.isfinite(p.sigma or 0.0) for p in own)


def is_usual(one: Effect, model: Model) -> bool | None:
    """Whether what every motor of the kind has is of usual size; None for any other effect."""
    if not one.card.inherent:
        return None
    return model[f'{one.key}.{one.card.amplitudes[0].name}'] <= one.card.inherent


def misfit_of_laws(
    scored: Scored, model: Model, explained: float, outputs: Sequence[str], turn: float
) -> float:
    """Return the gain that the misfit of a model's laws may make of a further effect.

    What takes the place of one of them mends its law, and what is a function of something else
    can make up for none; nor can what pushes another equation, if each has an output that tells of
    it.  Of what comes in time, only a law that reads the clock is one of time.  What depends on
    nothing, as an offset, is right to the last detail.  `turn` is the angle that a motor of the
    usual speed makes within a sample, rad: a wave that is `BLURRED` is alike to dry friction.
    The share of an effect that its law may miss stands on its card.
    """
    forces = {force.name for force in model.kind.forces}
    mine = scored.variant.effect
    order = f'{mine.key}.{mine.card.orders}'
    blurred = bool(mine.card.orders) and scored.variant.model[order] * turn > BLURRED

    def argument(one: Effect) -> tuple[str, bool]:
        return one.card.axis, 't' in one.needs()

    def alike(one: Effect) -> bool:
        ours, theirs = forces & set(mine.laws), forces & set(one.laws)
        apart = len(outputs) >= len(forces) and ours and theirs and not ours & theirs
        return (argument(one) == argument(mine) or (blurred and _is_dry(one))) and not apart

    laws = [one for one in map(effect, model.effects) if one.needs() or not one.laws]
    misfits = [one.card.misfit for one in laws if alike(one) and not scored.variant.inherits]
    return max(misfits, default=0.0) ** 2 * explained


def _is_dry(one: Effect) -> bool:
    """Whether a law, or one that it is a wider form of, has a sign of the speed."""
    return any('omega_eps' in each.needs() for each in (one, *map(effect, one.card.generalises)))


def is_worth_it(new: Rung, old: Rung, gain: float) -> bool:
    """Whether an effect lowers the held-out error by more than next to nothing.

    A further one may lower the training error instead: not every record shows it.  `gain` is the
    relative fall in percent, each channel in units of its error before.
    """
    drop = old.held.error_percent**2 - new.held.error_percent**2
    if old.model.effects:
        drop = max(drop, old.training.error_percent**2 - new.training.error_percent**2)
    return gain > LEAST_GAIN_PERCENT or drop > LEAST_DROP_PERCENT**2


def gate_note(scored: Scored, new: Rung, old: Rung, gained: Gain, duration: float) -> str:
    """Return why a refit does not pass, in plain words; empty where it does.

    What every motor has need not lower the held-out error, if there is evidence of it and it does
    no harm there: not every record shows it.

    Parameters
    ----------
    scored:
        The score that it was chosen by.
    new, old:
        The refit, and the fit without the effect.
    gained:
        What the refit gains.
    duration:
        Time of the longest record, s.
    """
    key, gain = scored.variant.effect.key, gained.percent
    if is_impossible(new.model, key, duration):
        return UNPHYSICAL
    if not np.isfinite(gained.delta_bic):
        return 'cannot be simulated'
    if special := narrowed(new.model, key):
        return f'is nothing but {special} here'
    if gained.delta_bic < gained.threshold:
        alike = scored.overlap > ALIKE
        return 'these data cannot tell it from what the model has' if alike else NO_EVIDENCE
    halved = new.training.error_percent < HALVED * old.training.error_percent
    steady = gained.steady >= MIN_STEADY
    falls = steady and (gain > SURE_GAIN or (halved and gain > MIN_GAIN_PERCENT))
    sure = gained.delta_bic > SURE * gained.asked and falls
    if not sure and certainty(new, key) < LEAST_CERTAINTY:
        return UNCERTAIN
    if why := senseless(new.model, key, duration):
        return why
    if lost := _missed(new, old):
        return f'{lost} {TAKES_OVER}'
    further = bool(old.model.effects)
    least = MIN_CERTAIN_GAIN_PERCENT if further and not gained.deep else -MIN_GAIN_PERCENT
    least = MIN_WIDER_GAIN_PERCENT if scored.variant.inherits and not gained.mends else least
    if is_usual(scored.variant.effect, new.model) and gain > -MIN_GAIN_PERCENT:
        return ''
    if new.held.error_percent > SPOILED * old.held.error_percent:
        return f'{TOO_LITTLE} nothing'
    if gained.certain and gain > least and (further or is_worth_it(new, old, gain)):
        return ''
    if gain < (MIN_FURTHER_GAIN_PERCENT if further else MIN_GAIN_PERCENT):
        return f'{TOO_LITTLE} ' + (f'{gain:.1f} % only' if gain > 0.0 else 'nothing')
    return '' if steady or halved else UNSTEADY
