"""A calibration: what complete-model runs of one motor have shown, and the thresholds from it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import hashlib
import math

import numpy as np

from motor_sysid.diagnosis.calibration.null import Chance, Plan
from motor_sysid.diagnosis.calibration.situation import Situation
from motor_sysid.diagnosis.calibration.tail import (
    Quantile,
    share_limits,
    shown_level,
    upper_quantile,
)
from motor_sysid.diagnosis.result.threshold import FLOOR, Threshold
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

SAME_MOTOR = 1.5
"""Factor within which half of the parameters of a motor must agree with a calibration's."""


@dataclass(frozen=True)
class Calibration:
    """What the runs have shown.

    Attributes
    ----------
    situation:
        Class of motor and excitation that it holds for.
    parameters:
        Positive parameters of the motor that it was made for, in SI.
    effects:
        Effects that the complete model has.
    evidence, passing:
        One value a run: see `motor_sysid.diagnosis.calibration.null.Chance`.
    catalogue:
        Effect to a digest of its file: what was looked for.
    provenance:
        How it was made: digest of the data, seed, controller, noise.
    """

    situation: Situation
    parameters: Mapping[str, float]
    effects: tuple[str, ...]
    evidence: tuple[float, ...]
    passing: tuple[float, ...]
    catalogue: Mapping[str, str]
    provenance: Mapping[str, str]

    def quantile(self, alpha: float) -> Quantile:
        """Return the evidence that noise alone exceeds in a share `alpha` of recordings."""
        return upper_quantile(np.array(self.evidence), alpha)

    def threshold(self, alpha: float, candidates: Sequence[str] = ()) -> Threshold:
        """Return what to ask of evidence for a false-alarm rate of at most `alpha`.

        Either the runs show directly, with 95 % confidence, that no more than that passes all
        gates; or the evidence itself, whatever the other gates say, stays below the quantile of
        its tail.  The lower of both counts, but never less than the floor.

        Parameters
        ----------
        alpha:
            Between 0 and 1.
        candidates:
            Keys of the effects that are looked for now; those that were not part of the
            calibration are noted.
        """
        found, runs = self.quantile(alpha), len(self.evidence)
        shown = shown_level(np.array(self.passing), alpha, FLOOR)
        by_tail = max(found.value, FLOOR)
        level = min(shown, by_tail)
        beyond = 1.0 / (alpha * runs) if by_tail < shown else 0.0
        new = [k for k in candidates if self.catalogue.get(k) != digest_of(k)]
        return Threshold(
            level,
            alpha,
            runs,
            (found.lower, found.upper),
            share_limits(int(np.sum(np.array(self.passing) >= level)), runs),
            beyond if beyond > 1.0 else 0.0,
            f'Not part of it, or changed since: {", ".join(new)}.' if new else '',
        )

    def is_for(self, model: Model, situation: Situation) -> bool:
        """Tell whether it holds for a model fitted in a situation: same class, like motor."""
        shared = [n for n in _positive(model) if self.parameters.get(n, 0.0) > 0.0]
        if situation != self.situation or not shared:
            return False
        now = _positive(model)
        off = [abs(math.log(now[n] / self.parameters[n])) for n in shared]
        return float(np.median(off)) <= math.log(SAME_MOTOR)


def concluded(plan: Plan, runs: Sequence[Chance], records: Sequence[Record]) -> Calibration:
    """Return the calibration that finished runs make, in the order of their numbers."""
    ordered = sorted(runs, key=lambda one: one.number)
    return Calibration(
        plan.situation,
        _positive(plan.model),
        plan.model.effects,
        tuple(one.evidence for one in ordered),
        tuple(one.passing for one in ordered),
        {key: digest_of(key) for key in plan.candidates},
        {
            'data': digest_of_data(records),
            'seed': str(plan.seed),
            'driven_by': '; '.join(plan.driven_by),
            'noise': '; '.join(plan.noise.words) or 'none',
            'noise_mismatch_db': f'{plan.noise.mismatch_db:.2g}',
        },
    )


def threshold_for(
    calibrations: Sequence[Calibration],
    model: Model,
    situation: Situation,
    alpha: float,
    candidates: Sequence[str],
) -> Threshold:
    """Return the threshold of the calibration that fits and has most runs; or the usual one."""
    fitting = [one for one in calibrations if one.is_for(model, situation)]
    if not fitting:
        return Threshold()
    return max(fitting, key=lambda one: len(one.evidence)).threshold(alpha, candidates)


def digest_of(key: str) -> str:
    """Return a digest of an effect's file."""
    return hashlib.sha256(effect(key).source.encode()).hexdigest()[:12]


def digest_of_data(records: Sequence[Record]) -> str:
    """Return a digest of the samples of records, whatever their files are called."""
    total = hashlib.sha256()
    for record in records:
        for name in sorted(record):
            total.update(name.encode())
            total.update(np.ascontiguousarray(record[name]).tobytes())
    return total.hexdigest()[:16]


def _positive(model: Model) -> dict[str, float]:
    """Return the free positive parameters of the motor itself."""
    return {p.name: p.value for p in model.parameters.free if p.logarithmic and '.' not in p.name}
