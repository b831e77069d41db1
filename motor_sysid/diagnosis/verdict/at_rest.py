"""What is said of a motor that stands still: its windings are seen, and nothing else."""

from motor_sysid.diagnosis.result.result import Diagnosis, Step, Verdict
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.rung import Rung
from motor_sysid.diagnosis.search.standstill import held_parameters
from motor_sysid.diagnosis.verdict import words
from motor_sysid.diagnosis.verdict.blind_spots import blind_spots
from motor_sysid.diagnosis.verdict.left_over import left_over


def diagnosis_at_rest(rung: Rung, bench: Bench) -> Diagnosis:
    """Return the diagnosis of a rotor that stands still in all records, as its currents tell it.

    No effect is tried: most of them act on what moves.
    """
    train = [r for r, role in zip(bench.records, bench.roles, strict=True) if role == 'train']
    left = left_over(rung, bench, train)
    step = Step(
        model=rung.model,
        train_error_percent=rung.training.error_percent,
        validation_error_percent=rung.validation.error_percent,
        channel_errors=rung.validation.channel_percent,
        predictions=(*rung.training.predictions, *rung.validation.predictions),
    )
    warnings = (*rung.result.unidentifiable, *rung.result.warnings)
    hidden = blind_spots(rung.model, bench.records, warnings)
    return Diagnosis(
        verdict=Verdict.INSUFFICIENT_DATA,
        effects=(),
        steps=(step,),
        noise_floor_percent=left.floor_percent,
        noise_sigma=left.floor,
        reasons=tuple(words.insufficient(held_parameters(bench.kind), warnings, hidden)),
        records=bench.records,
        roles=bench.roles,
        warnings=warnings,
        blind_spots=hidden,
    )
