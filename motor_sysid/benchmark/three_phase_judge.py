"""Diagnose a case of a three-phase motor and judge what is said."""

from dataclasses import replace
import time

from motor_sysid.benchmark.judge import outcome
from motor_sysid.benchmark.outcome import Result
from motor_sysid.benchmark.scenarios import Category, Scenario
from motor_sysid.benchmark.three_phase_cases import draw, KINDS, ThreePhaseCase
from motor_sysid.benchmark.three_phase_rig import DT
from motor_sysid.diagnosis import diagnose
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.diagnosis.result.result import Diagnosis


def owns(name: str) -> bool:
    """Whether the name of a case is that of a three-phase motor."""
    return name.partition('/')[0] in KINDS


def described(name: str) -> Result:
    """Return the part of a result that the name tells."""
    _, effect, *rest = name.split('/')
    hidden = () if effect == 'complete' else (effect,)
    category = Category.SINGLE if hidden else Category.COMPLETE
    size = float(rest[0]) / 100 if hidden else 0.0
    return Result(name, category.value, hidden, size, known=True)


def one_case(name: str, seed: int) -> Result:
    """Draw, diagnose and judge one case; a diagnosis that raises is a result, too."""
    case = draw(name, seed)
    result = replace(
        described(name), motor=case.sheet.name, profiles=case.profiles, closed=case.closed,
        dt=DT, position=True,
    )  # fmt: skip
    begun = time.perf_counter()
    try:
        found = diagnose(case.train, case.valid, motor=case.motor, nominal=case.nominal)
    except Exception as error:  # noqa: BLE001 - whatever it raises is what the benchmark reports
        seconds = time.perf_counter() - begun
        return replace(result, seconds=seconds, error=f'{type(error).__name__}: {error}')
    return _judged(result, case, found, time.perf_counter() - begun)


def _judged(result: Result, case: ThreePhaseCase, found: Diagnosis, seconds: float) -> Result:
    first, last = found.steps[0], found.steps[-1]
    rivals = {r for step in found.steps for c in step.candidates for r in c.confusable_with}
    return replace(
        result,
        outcome=outcome(
            Scenario(result.effects, case.size), found.verdict, found.effects, rivals
        ),
        verdict=found.verdict.value,
        named=found.effects,
        first=first.candidates[0].effect if first.candidates else '',
        rivals=tuple(sorted(rivals)),
        before=first.validation_error_percent,
        after=last.validation_error_percent,
        floor=found.noise_floor_percent,
        evidence=first.candidates[0].delta_bic if first.candidates else 0.0,
        reference=_reference(case, found),
        seconds=seconds,
        lent=found.lent,
    )


def _reference(case: ThreePhaseCase, found: Diagnosis) -> float:
    """Return the held-out error of the true structure, fitted to the same data, percent."""
    first = found.steps[0]
    if not case.effect:
        return first.validation_error_percent
    fitted = fit_model(
        case.train, case.valid, model=first.model, effects=[case.effect], lent=found.lent
    )
    return fitted.validation.error_percent
