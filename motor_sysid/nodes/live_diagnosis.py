"""A diagnosis of the last samples, as a job for the worker."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
import time
from typing import TYPE_CHECKING

from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.recording.rows import gap_limit
from motor_sysid.signals.record import Record

if TYPE_CHECKING:
    from motor_sysid.diagnosis import Candidate, Diagnosis

SECOND = 1_000_000_000

NOTICED = 0.1
"""Time by which the window begins later than the first sample, s, from which on it is told."""


@dataclass(frozen=True)
class Rung:
    """One fitted model of the ladder: its combined errors in percent."""

    model: Model
    train_error_percent: float
    validation_error_percent: float


@dataclass(frozen=True)
class DiagnosisOutcome:
    """What a diagnosis said of a window, without the signals.

    Attributes
    ----------
    verdict:
        One of ``complete``, ``effect_missing``, ``ambiguous``, ``unknown_effect`` and
        ``insufficient_data``.
    effects:
        What is missing, in order.
    had:
        Effects that the model had already.
    reasons:
        The verdict in plain words, most important first.
    rungs:
        The ladder: the model as it is, fitted, then one effect more in each row.
    candidates:
        Every effect that was tried, with its strongest evidence, best first.
    held_until:
        Stamp (ns) until which the model held, if something changed in the window; else None.
    first_stamp, last_stamp:
        Of what was looked at, ns.
    noise_floor_percent:
        Error that sensor noise alone makes.
    experiment, warnings:
        What to record next, and what to know of the fit.
    seconds:
        Time taken.
    """

    verdict: str
    effects: tuple[str, ...]
    had: tuple[str, ...]
    reasons: tuple[str, ...]
    rungs: tuple[Rung, ...]
    candidates: 'tuple[Candidate, ...]'
    held_until: int | None
    first_stamp: int
    last_stamp: int
    noise_floor_percent: float
    experiment: Mapping[str, str]
    warnings: tuple[str, ...]
    seconds: float

    @property
    def summary(self) -> str:
        """The verdict in one line."""
        names = ', '.join(self.effects)
        first = next((c for c in self.candidates if c.effect in self.effects), None)
        evidence = f' (dBIC {first.delta_bic:.3g})' if first else ''
        if self.verdict == 'ambiguous' and first:
            return f'{names} or {" or ".join(first.confusable_with) or "another"}{evidence}'
        return f'{names} missing{evidence}' if names else self.verdict.replace('_', ' ')

    def model_with(self, effects: tuple[str, ...]) -> Model | None:
        """Return the fitted model that has exactly these effects, if there is one."""
        fitted = [rung.model for rung in self.rungs if set(rung.model.effects) == set(effects)]
        return fitted[-1] if fitted else None

    def values_of(self, key: str) -> dict[str, float]:
        """Return the fitted parameters of an effect by symbol; none if it was not tried."""
        for rung in reversed(self.rungs):
            if key in rung.model.effects:
                start = f'{key}.'
                values = rung.model.parameters.values()
                return {n.removeprefix(start): v for n, v in values.items() if n.startswith(start)}
        for one in self.candidates:
            if one.effect == key:
                return {name: value for name, (value, _, _) in one.parameters.items()}
        return {}


@dataclass(frozen=True)
class DiagnosisJob:
    """What to diagnose.

    Attributes
    ----------
    model:
        The present model, with the present estimates.
    record:
        The window; it may have gaps, and is cut there as a bag is.
    first_stamp:
        Of the window, ns.
    offset:
        Time from the identifier's first sample to that of the window, s.
    alpha:
        False-alarm rate that evidence is held to, where the user's calibrations tell.
    """

    model: Model
    record: Record
    first_stamp: int
    offset: float
    alpha: float = 0.01

    def work(self) -> DiagnosisOutcome:
        """Diagnose; see `motor_sysid.diagnosis`.

        Raises
        ------
        UserError
            If no stretch without a gap is long enough.
        """
        from motor_sysid.diagnosis import diagnose, Settings
        from motor_sysid.diagnosis.calibration.store import load_calibrations
        from motor_sysid.diagnosis.change.until_when import change_in_words, held_until

        begin, model, pieces = time.perf_counter(), self.model, _pieces(self.record)
        unread: list[str] = []
        calibrations = tuple(load_calibrations(complain=unread.append))
        settings = Settings(alpha=self.alpha, calibrations=calibrations)
        if model.effects:
            found = diagnose(pieces, model=model, settings=settings)
        else:
            values = model.parameters.values()
            found = diagnose(pieces, motor=model.motor, nominal=values, settings=settings)
        found = replace(found, warnings=(*found.warnings, *unread))
        held = held_until(found.model, pieces[-1])
        moment = _moment(found.model, held.time if held else None)
        start = _start(pieces, moment)
        later = self.offset + start
        words = change_in_words(found.model, held, later)
        reasons = (found.reasons[0], words, *found.reasons[1:]) if words else found.reasons
        if words and later >= NOTICED:
            other = f'All other times count from {later:.1f} s, where the diagnosed samples begin.'
            reasons = (*reasons, other)
        changed = None if moment is None else self._stamp(start + moment)
        outcome = self._outcome(found, reasons, pieces, changed)
        return replace(outcome, seconds=time.perf_counter() - begin)

    def _stamp(self, time: float) -> int:
        """Return the stamp (ns) of a time of the window, s."""
        return self.first_stamp + round(time * SECOND)

    def _outcome(
        self,
        found: 'Diagnosis',
        reasons: tuple[str, ...],
        pieces: Sequence[Record],
        changed: int | None,
    ) -> DiagnosisOutcome:
        return DiagnosisOutcome(
            verdict=found.verdict.value,
            effects=found.effects,
            had=self.model.effects,
            reasons=reasons,
            rungs=tuple(
                Rung(s.model, s.train_error_percent, s.validation_error_percent)
                for s in found.steps
            ),
            candidates=_candidates(found),
            held_until=changed,
            first_stamp=self._stamp(pieces[0].time[0]),
            last_stamp=self._stamp(pieces[-1].time[-1]),
            noise_floor_percent=found.noise_floor_percent,
            experiment=dict(found.experiment or {}),
            warnings=found.warnings,
            seconds=0.0,
        )


def _pieces(record: Record) -> list[Record]:
    """Cut a window at its gaps; what is too short for a diagnosis goes."""
    from motor_sysid.diagnosis.search.refusals import MIN_SAMPLES

    pieces = record.segments(gap_limit(record.time))
    long = [piece for piece in pieces if len(piece) >= MIN_SAMPLES]
    if not long:
        longest = max(map(len, pieces), default=1)
        raise UserError(
            f'the longest stretch without a gap has {longest} samples; a diagnosis needs at '
            f'least {MIN_SAMPLES}, better 5000: let the motor run on, or raise `diagnose_window`'
        )
    return long


def _start(pieces: Sequence[Record], moment: float | None) -> float:
    """Return where in the window (s) the piece begins that a moment counts from.

    Moments count from the start of every piece; it is the last one that lasts so long.
    """
    lasting = [piece for piece in pieces if piece.duration >= (moment or 0.0)]
    return float((lasting or pieces)[-1].time[0])


def _moment(model: Model, held: float | None) -> float | None:
    """Return the moment of the first change, s from the start of a piece."""
    from motor_sysid.physics.effects import effect

    names = [f'{key}.{name}' for key in model.effects if (name := effect(key).card.moment)]
    return min((model[name] for name in names), default=held)


def _candidates(found: 'Diagnosis') -> 'tuple[Candidate, ...]':
    """Return every effect once, where its evidence was strongest, without its curve."""
    best: dict[str, Candidate] = {}
    for step in found.steps:
        for one in step.candidates:
            known = best.get(one.effect)
            if known is None or (one.passes, one.delta_bic) > (known.passes, known.delta_bic):
                best[one.effect] = replace(one, curve=None)
    return tuple(sorted(best.values(), key=lambda c: (not c.passes, -c.delta_bic)))
