"""Judge one diagnosis against the truth."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from enum import Enum
import math

from motor_sysid.benchmark.cases import Case, SENSOR_SCALE
from motor_sysid.diagnosis.result import Diagnosis, Verdict
from motor_sysid.physics.effects import catalogue

SPECIAL = {
    'asymmetric_coulomb_friction': 'coulomb_friction',
    'stribeck_friction': 'coulomb_friction',
}
"""A true effect and the simpler one that is half the truth."""

UNOBSERVABLE = frozenset({SENSOR_SCALE})
"""What no record of voltage, current and speed can show: it hides in the base parameters."""


class Outcome(Enum):
    """What became of a case."""

    RIGHT = 'right'
    """Exactly the truth was said."""

    AMBIGUOUS = 'ambiguous, truth among the rivals'
    """Nothing was claimed that is wrong."""

    PART = 'a part of it'
    """Some of what is hidden was named, or its simpler special case, and nothing else."""

    EXTRA = 'superfluous effect beside it'
    """All that is hidden was named, and something else as well."""

    WRONG = 'wrong name'
    """Something was named that is not there, and something that is there was not."""

    UNKNOWN = 'unknown effect'
    """Something is missing, it said, but not what; right where the catalogue lacks it."""

    MISSED = 'missed'
    """It said that nothing is missing."""

    INSUFFICIENT = 'insufficient data'
    FAILED = 'failed'


@dataclass(frozen=True)
class Result:
    """One line of the benchmark.

    Attributes
    ----------
    index, effects, size, withheld, known:
        Which case, what was hidden, and whether the catalogue that the diagnosis had holds it.
    motor, profiles, closed, dt, process:
        What else was drawn: `process` is the random torque in units of rated torque.
    outcome, verdict, named, first, rivals:
        What was said: effects in order, the strongest candidate of the first round, and what it
        was not told from.
    before, over_floor, explained:
        Held-out error of the base model and after the last step, in units of the error that the
        sensors alone make; and share of the squared error above it that was explained.
    evidence:
        dBIC of the first round's strongest candidate.
    base_error:
        Base parameter to relative error under the last model.
    seconds:
        Time of the diagnosis.
    error:
        What went wrong.
    """

    index: int
    effects: tuple[str, ...]
    size: float
    withheld: bool
    known: bool
    motor: str
    profiles: tuple[str, ...]
    closed: tuple[bool, ...]
    dt: float
    process: float
    outcome: Outcome = Outcome.FAILED
    verdict: str = ''
    named: tuple[str, ...] = ()
    first: str = ''
    rivals: tuple[str, ...] = ()
    before: float = 0.0
    over_floor: float = 0.0
    explained: float = 0.0
    evidence: float = 0.0
    base_error: Mapping[str, float] | None = None
    seconds: float = 0.0
    error: str = ''

    @property
    def title(self) -> str:
        """What was hidden, for tables."""
        return ' + '.join(self.effects) or 'none'

    @property
    def answer(self) -> str:
        """What was said, for tables."""
        return ' + '.join(self.named) or self.verdict or self.outcome.value

    def as_dict(self) -> dict[str, object]:
        """Return plain values for JSON."""
        return {**asdict(self), 'outcome': self.outcome.name.lower()}


def judged(case: Case, diagnosis: Diagnosis, seconds: float) -> Result:
    """Compare what was said with what is true."""
    first, last = diagnosis.steps[0], diagnosis.steps[-1]
    candidates = first.candidates
    rivals = tuple(
        {r for step in diagnosis.steps for c in step.candidates for r in c.confusable_with}
    )
    floor = _floor(case, last.channel_errors)
    before, after = (_combined(step.channel_errors) for step in (first, last))
    return replace(
        _drawn(case),
        outcome=_outcome(case, diagnosis, rivals),
        verdict=diagnosis.verdict.value,
        named=diagnosis.effects,
        first=candidates[0].effect if candidates else '',
        rivals=rivals,
        before=before / floor,
        over_floor=after / floor,
        explained=(before**2 - after**2) / max(before**2 - floor**2, 1e-12),
        evidence=candidates[0].delta_bic if candidates else 0.0,
        base_error=_base_error(case, diagnosis),
        seconds=seconds,
    )


def failed(case: Case, error: str, seconds: float) -> Result:
    """Return the result of a diagnosis that raised."""
    return replace(_drawn(case), seconds=seconds, error=error)


def _drawn(case: Case) -> Result:
    """Return the part of a result that was clear before the diagnosis."""
    s = case.setting
    return Result(
        index=case.index,
        effects=case.scenario.effects,
        size=case.scenario.size,
        withheld=case.scenario.withheld,
        known=known(case),
        motor=s.sheet.name,
        profiles=s.profiles,
        closed=s.closed,
        dt=s.dt,
        process=s.process[0] / s.sheet.torque,
    )


def known(case: Case) -> bool:
    """Whether the catalogue that the diagnosis was given holds all that is hidden."""
    return not case.scenario.withheld and all(k in catalogue() for k in case.scenario.effects)


def _outcome(case: Case, diagnosis: Diagnosis, rivals: tuple[str, ...]) -> Outcome:
    truth, named = set(case.scenario.effects), set(diagnosis.effects)
    verdict = diagnosis.verdict
    if verdict is Verdict.INSUFFICIENT_DATA:
        return Outcome.INSUFFICIENT
    if verdict is Verdict.UNKNOWN_EFFECT:
        return Outcome.RIGHT if truth and not known(case) else Outcome.UNKNOWN
    if verdict is Verdict.COMPLETE:
        return Outcome.RIGHT if truth <= UNOBSERVABLE else Outcome.MISSED
    if verdict is Verdict.AMBIGUOUS and truth and truth <= named | set(rivals):
        return Outcome.AMBIGUOUS
    if named == truth:
        return Outcome.RIGHT
    if truth and truth < named:
        return Outcome.EXTRA
    half = truth | {SPECIAL[k] for k in truth if k in SPECIAL}
    return Outcome.PART if named <= half and truth else Outcome.WRONG


def _floor(case: Case, channels: Mapping[str, float]) -> float:
    return max(_combined({k: case.floor_percent[k] for k in channels}), 1e-9)


def _combined(percent: Mapping[str, float]) -> float:
    return math.sqrt(sum(v**2 for v in percent.values()) / len(percent))


def _base_error(case: Case, diagnosis: Diagnosis) -> dict[str, float]:
    plant, model = case.setting.plant, diagnosis.model
    true = {'R': plant.R, 'L': plant.L, 'k_t': plant.k, 'J': plant.J, 'b': plant.b}
    names = {p.name for p in model.parameters}
    return {n: model[n] / value - 1 for n, value in true.items() if n in names}
