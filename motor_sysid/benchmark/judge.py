"""Judge one diagnosis against the truth."""

from collections.abc import Mapping
from dataclasses import replace
import math

from motor_sysid.benchmark.answers import true_base_values, true_effect_values
from motor_sysid.benchmark.cases import Case
from motor_sysid.benchmark.equivalences import same_as, special_cases
from motor_sysid.benchmark.outcome import Outcome, Result
from motor_sysid.benchmark.scenarios import case_name, Scenario
from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.model import Model


def drawn(case: Case) -> Result:
    """Return the part of a result that is clear before the diagnosis."""
    s, scenario = case.setting, case.scenario
    return Result(
        case=case_name(scenario, case.number),
        category=scenario.category.value,
        effects=scenario.effects,
        size=scenario.size,
        known=known(case.scenario),
        motor=s.sheet.name,
        profiles=s.profiles,
        closed=s.closed,
        dt=s.dt,
        position=bool(s.sensors.counts) and s.sensors.position,
        process=s.process[0] / s.sheet.torque,
    )


def known(scenario: Scenario) -> bool:
    """Whether the catalogue that the diagnosis was given holds all that is hidden."""
    return not scenario.withheld and all(k in catalogue() for k in scenario.effects)


def judged(case: Case, diagnosis: Diagnosis, seconds: float) -> Result:
    """Compare what was said with what is true."""
    first, last = diagnosis.steps[0], diagnosis.steps[-1]
    candidates = first.candidates
    rivals = {r for step in diagnosis.steps for c in step.candidates for r in c.confusable_with}
    return replace(
        drawn(case),
        outcome=outcome(case.scenario, diagnosis.verdict, diagnosis.effects, rivals),
        verdict=diagnosis.verdict.value,
        named=diagnosis.effects,
        first=candidates[0].effect if candidates else '',
        rivals=tuple(sorted(rivals)),
        before=first.validation_error_percent,
        after=last.validation_error_percent,
        floor=_combined({k: case.floor_percent[k] for k in last.channel_errors}),
        evidence=candidates[0].delta_bic if candidates else 0.0,
        sigmas=effect_sigmas(case, last.model),
        base_before=base_errors(case, first.model),
        base_after=base_errors(case, last.model),
        seconds=seconds,
        lent=diagnosis.lent,
    )


def outcome(
    scenario: Scenario, verdict: Verdict, effects: tuple[str, ...], rivals: set[str]
) -> Outcome:
    """Return what became of a case."""
    truth, named = frozenset(scenario.effects), frozenset(effects)
    same = same_as(truth)
    if verdict is Verdict.INSUFFICIENT_DATA:
        return Outcome.INSUFFICIENT
    if verdict is Verdict.COMPLETE:
        return Outcome.RIGHT if frozenset() in same else Outcome.MISSED
    if not truth:
        return Outcome.FALSE_ALARM
    if verdict is Verdict.UNKNOWN_EFFECT:
        return Outcome.UNKNOWN if known(scenario) else Outcome.RIGHT
    if verdict is Verdict.AMBIGUOUS and any(one and one <= named | rivals for one in same):
        return Outcome.AMBIGUOUS
    if named in same:
        return Outcome.RIGHT
    if any(one and one < named for one in same):
        return Outcome.EXTRA
    part = any(named <= one | special_cases(one) for one in same)
    return Outcome.PART if part else Outcome.WRONG


def effect_sigmas(case: Case, model: Model) -> dict[str, float] | None:
    """Return (estimate - truth) / sigma of effect parameters; None if the effects are others."""
    if not model.effects or set(model.effects) != set(case.scenario.effects):
        return None
    found = {}
    for name, true in true_effect_values(case).items():
        parameter = model.parameters[name]
        if parameter.free and parameter.sigma and math.isfinite(parameter.sigma):
            found[name] = (parameter.value - true) / parameter.sigma
    return found


def base_errors(case: Case, model: Model) -> dict[str, float]:
    """Return the relative errors of the base parameters."""
    names = {p.name for p in model.parameters}
    true = true_base_values(case, model.effects)
    return {name: model[name] / value - 1 for name, value in true.items() if name in names}


def _combined(percent: Mapping[str, float]) -> float:
    return math.sqrt(sum(v**2 for v in percent.values()) / len(percent))
