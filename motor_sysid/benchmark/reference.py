"""The best that could be reached: the true structure, fitted to the same data from true values."""

from dataclasses import replace

from motor_sysid.benchmark.answers import start_values, true_base_values
from motor_sysid.benchmark.cases import Case
from motor_sysid.benchmark.judge import base_errors, effect_sigmas
from motor_sysid.benchmark.outcome import Result
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.diagnosis.result.result import Diagnosis
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.model import Model, SpeedSensor


def with_reference(result: Result, case: Case, diagnosis: Diagnosis) -> Result:
    """Return the result with the errors of the true structure, where the catalogue has it.

    For a complete model the base model of the diagnosis is that already.
    """
    effects = case.scenario.effects
    if not effects:
        return replace(result, reference=result.before, base_reference=result.base_before)
    if any(key not in catalogue() for key in effects):
        return result
    model = diagnosis.steps[0].model
    if not all(model.admits(catalogue()[key]) for key in effects):
        model = model.with_speed_sensor(SpeedSensor.IDEAL)  # counts have no offset
    model = model.with_values(
        {n: v for n, v in true_base_values(case, effects).items() if n in model.parameters}
    )
    unstarted = []
    for key in effects:
        values = start_values(case, key)
        if values is None or not model.admits(catalogue()[key]):
            unstarted.append(key)
        else:
            model = model.with_effect(key, values)
    if any(not model.admits(catalogue()[key]) for key in unstarted):
        return result
    lent = diagnosis.lent
    fitted = fit_model(case.train, case.valid, model=model, effects=unstarted, lent=lent)
    several = len(effects) > 1
    return replace(
        result,
        reference=fitted.validation.error_percent,
        lacking=_lacking(case, fitted.model, lent=lent) if several else result.before,
        reference_sigmas=effect_sigmas(case, fitted.model),
        base_reference=base_errors(case, fitted.model),
    )


def _lacking(case: Case, model: Model, *, lent: bool) -> float:
    """Return the least held-out error of a true structure that lacks one of its effects."""
    return min(
        fit_model(
            case.train, case.valid, model=model.without_effect(key), lent=lent
        ).validation.error_percent
        for key in model.effects
    )
