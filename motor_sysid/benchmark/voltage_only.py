"""Cases of a brushed motor whose current nobody measured: voltage in, speed and position out.

The cases are those of `cases`, without their current.  What electrical effects do to it is then
lost, and the inductance that every winding has is no part of the base model: naming it is neither
right nor wrong, and is right where the sensor of the speed lags, which looks the same.
"""

from collections import Counter
from dataclasses import replace
from functools import partial
import time

from motor_sysid.benchmark.cases import Case, draw
from motor_sysid.benchmark.judge import drawn, outcome
from motor_sysid.benchmark.outcome import Result
from motor_sysid.benchmark.scenarios import Category, Scenario
from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.diagnosis.result.result import Diagnosis
from motor_sysid.errors import UserError
from motor_sysid.signals.record import Record

PREFIX, KIND, WINDING = 'voltage_only', 'brushed_dc_reduced', 'armature_inductance'

SIZES = (0.03, 0.1)
"""Sizes of what is hidden, as fractions."""

EFFECTS = (
    'coulomb_friction', 'stribeck_friction', 'gravity_load', 'input_delay',
    'load_dependent_friction', 'drive_coast', 'constant_load_torque', 'flexible_shaft',
    'speed_sensor_lag', 'cogging_torque', 'inertia_change', 'asymmetric_coulomb_friction',
    'load_torque_step', 'quadratic_drag', 'driver_clipping', 'periodic_load', 'backlash',
    'lugre_friction', 'friction_drift', 'iron_loss', 'brush_voltage_drop',
)  # fmt: skip
"""What may be hidden: all that voltage and speed alone can show."""


def owns(name: str) -> bool:
    """Whether the name of a case is that of a motor whose current is not measured."""
    return name.partition('/')[0] == PREFIX


def schedule(count: int) -> list[str]:
    """Return the names of `count` cases, a third of them complete."""
    singles = [f'{key}/{100 * size:g}' for size in SIZES for key in EFFECTS]
    found: list[str] = []
    taken: Counter[str] = Counter()
    for k in range(count):
        case = singles[(k - k // 3 - 1) % len(singles)] if k % 3 else 'complete'
        found.append(f'{PREFIX}/{case}/{taken[case]}')
        taken[case] += 1
    return found


def described(name: str) -> Result:
    """Return the part of a result that the name tells.

    Raises
    ------
    UserError
        If there is no such case.
    """
    scenario, _ = _scenario(name)
    return Result(name, scenario.category.value, scenario.effects, scenario.size, known=True)


def one_case(name: str, seed: int) -> Result:
    """Draw, diagnose and judge one case; a diagnosis that raises is a result, too."""
    scenario, number = _scenario(name)
    case = draw(scenario, seed, number)
    bare = replace(case, train=_bare(case.train), valid=_bare(case.valid))
    result = replace(drawn(case), case=name)
    begun = time.perf_counter()
    try:
        found = diagnose(bare.train, bare.valid, motor=KIND)
        seconds = time.perf_counter() - begun
        return _judged(result, bare, found, seconds)
    except Exception as error:  # noqa: BLE001 - whatever it raises is what the benchmark reports
        seconds = time.perf_counter() - begun
        return replace(result, seconds=seconds, error=f'{type(error).__name__}: {error}')


def _scenario(name: str) -> tuple[Scenario, int]:
    _, *middle, number = name.split('/')
    key, percent, *_ = [*middle, '', '']
    complete = middle == [Category.COMPLETE.value]
    hides = key in EFFECTS and percent.isdigit() and len(middle) == 2
    if not (owns(name) and number.isdigit() and (complete or hides)):
        raise UserError(
            f'no case `{name}`; names look like `{PREFIX}/coulomb_friction/3/0` or '
            f'`{PREFIX}/complete/1`'
        )
    scenario = Scenario(()) if complete else Scenario((key,), float(percent) / 100)
    return scenario, int(number)


def _bare(records: tuple[Record, ...]) -> tuple[Record, ...]:
    return tuple(r.select([name for name in r if name != 'current']) for r in records)


def _judged(result: Result, case: Case, found: Diagnosis, seconds: float) -> Result:
    truth = case.scenario.effects
    first, last = found.steps[0], found.steps[-1]
    rivals = {r for step in found.steps for c in step.candidates for r in c.confusable_with}
    named = _beside_the_winding(found.effects, truth)
    verdict = found.verdict
    if verdict in (Verdict.EFFECT_MISSING, Verdict.AMBIGUOUS) and not named:
        verdict = Verdict.COMPLETE
    fitted = partial(fit_model, case.train, case.valid, lent=found.lent)
    winding = fitted(model=first.model, effects=[WINDING])
    true = fitted(model=winding.model, effects=list(truth))
    return replace(
        result,
        outcome=outcome(case.scenario, verdict, named, rivals - {WINDING}),
        verdict=found.verdict.value,
        named=named,
        first=first.candidates[0].effect if first.candidates else '',
        rivals=tuple(sorted(rivals)),
        before=winding.validation.error_percent,
        after=last.validation_error_percent,
        reference=true.validation.error_percent,
        floor=found.noise_floor_percent,
        evidence=first.candidates[0].delta_bic if first.candidates else 0.0,
        seconds=seconds,
        lent=found.lent,
    )


def _beside_the_winding(named: tuple[str, ...], truth: tuple[str, ...]) -> tuple[str, ...]:
    """Return what is named beside the inductance; which is the lag that looks the same, if any."""
    lag = 'speed_sensor_lag'
    if WINDING in named and lag in truth and lag not in named:
        return tuple(lag if key == WINDING else key for key in named)
    return tuple(key for key in named if key != WINDING)
