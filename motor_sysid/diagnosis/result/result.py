"""What a diagnosis says: verdict, evidence, ladder of models, and where each model fails."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.curves import Curve, Map, Where
from motor_sysid.diagnosis.result.findings import (
    BlindSpot,
    Difference,
    Evidence,
    Rivalry,
    Unknown,
    WrongParameter,
)
from motor_sysid.diagnosis.result.threshold import Threshold
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]


class Verdict(Enum):
    """The five things that a diagnosis can say."""

    COMPLETE = 'complete'
    EFFECT_MISSING = 'effect_missing'
    AMBIGUOUS = 'ambiguous'
    UNKNOWN_EFFECT = 'unknown_effect'
    INSUFFICIENT_DATA = 'insufficient_data'


@dataclass(frozen=True)
class Candidate:
    """One effect, tried on top of one model.

    Attributes
    ----------
    effect, title, equation:
        Key, title and the place where it enters: mechanical, electrical, input or sensor.
    law:
        Its equation as text.
    delta_bic:
        Gain in BIC; positive speaks for the effect.
    train_error_percent, validation_error_percent:
        Errors after adding and refitting.
    parameters:
        Its parameters after the refit: name to (value, unit, sigma).
    confusable_with:
        Effects that these data cannot tell from it.
    passes:
        Whether it passed every gate.
    note:
        Why it did not, or what to know, in plain words (``unphysical sign``, ``not excited by
        this record``, ...); empty if nothing is to be said.
    curve:
        Its evidence, if it has an axis.
    model, predictions:
        The refitted model, and what it gives on each record; None and empty where not kept.
    """

    effect: str
    title: str
    equation: str
    law: str
    delta_bic: float
    train_error_percent: float
    validation_error_percent: float
    parameters: Mapping[str, tuple[float, str, float]]
    confusable_with: tuple[str, ...] = ()
    passes: bool = False
    note: str = ''
    curve: Curve | None = None
    model: Model | None = None
    predictions: tuple[Mapping[str, Array], ...] = ()


@dataclass(frozen=True)
class Step:
    """One rung of the ladder: a fitted model, its errors, and what was tried on top of it.

    Attributes
    ----------
    model:
        The fitted model with estimates and sigmas.
    train_error_percent, validation_error_percent:
        Combined errors.
    channel_errors:
        Output signal to its validation error in percent.
    predictions:
        One mapping for each record of `Diagnosis.records`: output signal to (N,) simulated values.
    where:
        Where this model fails.
    curves:
        Unexplained torque or voltage against speed, position, current and time.
    candidates:
        What was tried next, best first.
    maps:
        Errors and unexplained torque and voltage over speed and current.
    """

    model: Model
    train_error_percent: float
    validation_error_percent: float
    channel_errors: Mapping[str, float]
    predictions: tuple[Mapping[str, Array], ...]
    where: tuple[Where, ...] = ()
    curves: tuple[Curve, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    maps: tuple[Map, ...] = ()


@dataclass(frozen=True)
class Diagnosis:
    """The whole answer.

    Attributes
    ----------
    verdict:
        One of five.
    effects:
        Keys of what it would add, in order; empty when nothing is to be added.
    steps:
        The ladder: first the base model, then one effect more in each row.
    noise_floor_percent:
        Error that sensor noise alone leaves on the validation data.
    noise_sigma:
        Output signal to the standard deviation of its sensor noise, in the signal's unit.
    reasons:
        The verdict in plain words, most important first.
    records, roles:
        What was looked at, each ``train`` or ``validate``.
    experiment:
        What to record next, if that would help.
    seconds:
        Time taken.
    warnings:
        What the fit has to say.
    unknown:
        For each equation, what it lacks and on which axis, where something unknown remains.
    evidence, wrong_parameters:
        For each effect that was added, what speaks for it; and the base parameters that were wrong
        without them.
    blind_spots:
        What the excitation does not show.
    rivalries:
        Effects that the data cannot tell apart.
    differences:
        What is not the same in all records, where that matters; see
        `motor_sysid.diagnosis.own_values`.
    calibration:
        What was asked of evidence, and where that figure comes from; None if nobody asked.
    held_alone:
        How many times larger the last model's error is over held-out data than over training data,
        or than with other values of its parameters, if the training data show nothing that is
        missing; else 1.
    lent:
        Whether half of the held-out data were fitted as well; see `motor_sysid.diagnosis.lending`.
    searched:
        Training and validation records that were searched, each of them whole: prepared, brought
        to a common supply and zero, without those that were left out.
    """

    verdict: Verdict
    effects: tuple[str, ...]
    steps: tuple[Step, ...]
    noise_floor_percent: float
    noise_sigma: Mapping[str, float]
    reasons: tuple[str, ...]
    records: tuple[Record, ...]
    roles: tuple[str, ...]
    experiment: Mapping[str, str] | None = None
    seconds: float = 0.0
    warnings: tuple[str, ...] = field(default_factory=tuple)
    unknown: tuple[Unknown, ...] = ()
    evidence: tuple[Evidence, ...] = ()
    wrong_parameters: tuple[WrongParameter, ...] = ()
    blind_spots: tuple[BlindSpot, ...] = ()
    rivalries: tuple[Rivalry, ...] = ()
    differences: tuple[Difference, ...] = ()
    calibration: Threshold | None = None
    held_alone: float = 1.0
    lent: bool = False
    searched: tuple[tuple[Record, ...], tuple[Record, ...]] = ((), ())

    @property
    def model(self) -> Model:
        """The last model of the ladder."""
        return self.steps[-1].model
