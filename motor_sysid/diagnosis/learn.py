"""Learn from data what no effect of the catalogue explains: physics plus a free function.

Only after a diagnosis has found an unknown effect.  The function lives on the axis that the
diagnosis names; its values are fitted by output error together with all free parameters of the
physics, under a prior that keeps it smooth (penalized least squares; Wahba, Spline Models for
Observational Data, 1990, chapter 1) and leaves to the physics what that can explain.  It counts
only if the held-out error falls, and it says over which range it was learned.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.diagnose import diagnose
from motor_sysid.diagnosis.fitting import bench_of
from motor_sysid.diagnosis.result.findings import Unknown
from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.diagnosis.search.bench import Bench
from motor_sysid.diagnosis.search.gain import gain_percent, MIN_STEADY, steadiness
from motor_sysid.diagnosis.search.gates import MIN_FURTHER_GAIN_PERCENT
from motor_sysid.diagnosis.search.rung import climb, judge, Rung
from motor_sysid.diagnosis.settings import Settings
from motor_sysid.diagnosis.where.equation_errors import measured_states
from motor_sysid.diagnosis.where.unknown import unknown_of
from motor_sysid.diagnosis.where.where import failure_of
from motor_sysid.estimation.batch import fit, Prior, Problem
from motor_sysid.physics.effects import effect
from motor_sysid.physics.learned import HELD, WAVES
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

LAWS = {
    ('torque', 'speed'): 'learned_torque_speed',
    ('torque', 'current'): 'learned_torque_current',
    ('torque', 'position'): 'learned_torque_position',
    ('voltage', 'current'): 'learned_voltage_current',
    ('voltage', 'speed'): 'learned_voltage_speed',
}
"""Equation and axis to the effect that is filled."""

_STATES = {'speed': 'omega', 'current': 'i'}
_ENDS = (0.002, 0.998)
"""Quantiles of the training data between which a law counts as learned."""

ONE_WAY = 0.02
"""Least share of the range on either side of zero, for a motor that never turned back."""

WIDE = 5.0
"""Standard deviation of the values before the data, in units of the RMS of what is lacking."""

FADE = 0.1
"""Share of the range over which a law falls to zero beyond it, where it is not held."""


@dataclass(frozen=True)
class Learned:
    """What was learned.

    Attributes
    ----------
    model:
        The model with the learned law, its values fixed; None where it was refused.
    reason:
        Why it was taken or refused, in words.
    unknown:
        What the model lacks, and on which axis; None where that was not looked for.
    before, after:
        The fits without and with the law; None where there was no fit.
    diagnosis:
        The diagnosis that came first; None where there was none.
    """

    model: Model | None
    reason: str
    unknown: Unknown | None = None
    before: Rung | None = None
    after: Rung | None = None
    diagnosis: Diagnosis | None = None


def learn(
    train: Sequence[Record],
    validation: Sequence[Record] = (),
    *,
    motor: str | None = None,
    model: Model | None = None,
    nominal: Mapping[str, float] | None = None,
    effects: Sequence[str] | None = None,
    hold: bool = True,
    settings: Settings | None = None,
    progress: Callable[[str], None] | None = None,
) -> Learned:
    """Diagnose, and learn what is unknown.

    Parameters
    ----------
    train, validation, motor, model, nominal, effects, settings, progress:
        See `motor_sysid.diagnosis.diagnose.diagnose`.
    hold:
        Whether the law keeps its outermost value beyond its range, or falls to zero.
    """
    settings, tell = settings or Settings(), progress or (lambda text: None)
    found = diagnose(
        train, validation, motor=motor, model=model, nominal=nominal, effects=effects,
        settings=settings, progress=progress,
    )  # fmt: skip
    if found.verdict is not Verdict.UNKNOWN_EFFECT:
        said = found.verdict.value.replace('_', ' ')
        reason = f'nothing is learned: the diagnosis says {said}'
        if found.effects:
            reason += f' ({", ".join(found.effects)}); a named effect is better than a learned law'
        return Learned(None, reason, diagnosis=found)
    base = found.steps[0].model
    unknown = _unknown(found)
    if unknown is None:
        return Learned(None, _nowhere(found), diagnosis=found)
    tell(f'learning the {unknown.quantity} over {unknown.axis}')
    bench, base = bench_of(*found.searched, base, None, {}, settings.validation_fraction)
    return replace(learned_on(base, unknown, bench, hold), diagnosis=found)


def _unknown(found: Diagnosis) -> Unknown | None:
    """Return what the base model lacks on an axis that a law can be learned on, clearest first."""
    step = found.steps[0]
    failure = failure_of(step.model, found.records, found.roles, step.predictions)
    lacking = unknown_of(step.model, found.records, failure, found.noise_sigma)
    for one in lacking:
        key = LAWS.get((one.equation, one.axis))
        if key and step.model.admits(effect(key)):
            return one
    return None


def _nowhere(found: Diagnosis) -> str:
    words = ' '.join(one.words for one in found.unknown) or 'no equation shows what is lacking.'
    axes = ', '.join(f'{equation} over {axis}' for equation, axis in LAWS)
    return f'nothing is learned: {words}  What can be learned is {axes}.'


def learned_on(base: Model, unknown: Unknown, bench: Bench, hold: bool = True) -> Learned:
    """Fit a law on the axis of what is unknown, and judge it on held-out data.

    Parameters
    ----------
    base:
        The model without it.
    unknown:
        Equation and axis.
    bench:
        The data.
    hold:
        See `learn`.
    """
    key = LAWS[unknown.equation, unknown.axis]
    before = climb(base, bench)
    limits = _limits(before.model, unknown.axis, bench, hold)
    tried = before.model.with_effect(key, limits, bench.scales)
    names = [f'{key}.{a.name}' for a in effect(key).card.amplitudes]
    prior = _smooth(names, unknown.axis, max(unknown.rms, 1e-300))
    problem = Problem(
        tried, bench.train, bench.outputs, substeps=bench.substeps, prior=prior
    )
    after = judge(fit(problem, before.result.weighting), bench)
    gain = gain_percent(before.held, after.held)
    steady = steadiness(before.held, after.held)
    errors = (
        f'the held-out error goes from {before.validation.error_percent:.3g} to '
        f'{after.validation.error_percent:.3g} %'
    )
    where = f'{unknown.quantity} over {unknown.axis}'
    if not (gain >= MIN_FURTHER_GAIN_PERCENT and steady >= MIN_STEADY):
        reason = f'refused: with a learned {where} {errors}, which is no steady gain'
        return Learned(None, reason, unknown, before, after)
    model = after.model.with_free(names, False)
    note = f'{range_words(model, key)}; {errors}'
    model = model.with_provenance(**{key: note})
    return Learned(model, f'learned the {where}, {note}', unknown, before, after)


def _limits(model: Model, axis: str, bench: Bench, hold: bool) -> dict[str, float]:
    """Return the range of the training data, as shapes of a table; nothing for a position."""
    if axis not in _STATES:
        return {}
    pairs = zip(bench.records, bench.roles, strict=True)
    train = [record for record, role in pairs if role == 'train']
    seen = np.concatenate([measured_states(model, r)[_STATES[axis]] for r in train])
    low, high = (float(q) for q in np.quantile(seen, _ENDS))
    reach = max(-low, high)
    ends = {'back': max(-low, ONE_WAY * reach), 'ahead': max(high, ONE_WAY * reach)}
    return {**ends, 'fade': HELD if hold else FADE * reach}


def _smooth(names: Sequence[str], axis: str, size: float) -> Prior:
    """Return the prior of a law: second differences, but for the jump at zero, and values small.

    Of waves over a turn the higher ones are the smaller; both say that the law is smooth.
    """
    count = len(names)
    if axis == 'position':
        order = np.tile(np.arange(1, WAVES + 1), 2)
        precision = np.diag(((1 + (order / 3) ** 2) / (WIDE * size)) ** 2)
    else:
        bends = np.diff(np.eye(count), 2, axis=0)
        bends = np.delete(bends, count // 2 - 1, axis=0)
        precision = bends.T @ bends / size**2 + np.eye(count) / (WIDE * size) ** 2
    return Prior(tuple(names), np.zeros(count), precision)


def range_words(model: Model, key: str) -> str:
    """Return over which range a learned law of a model holds, in words."""
    card = effect(key).card
    if not card.shapes:
        return 'valid over the whole turn'
    unit = model.parameters[f'{key}.ahead'].unit
    low, high = -model[f'{key}.back'], model[f'{key}.ahead']
    beyond = 'held' if model[f'{key}.fade'] >= HELD else 'zero'
    return f'valid for {card.axis} from {low:.3g} to {high:.3g} {unit}, {beyond} beyond'


def beyond_range(model: Model, records: Sequence[Record]) -> list[str]:
    """Say of each learned law of a model how long records leave the range that it knows."""
    words = []
    for key in model.effects:
        axis = effect(key).card.axis
        if key not in LAWS.values() or axis not in _STATES:
            continue
        states = [measured_states(model, r.uniform()).get(_STATES[axis]) for r in records]
        seen = np.concatenate([s for s in states if s is not None] or [np.zeros(0)])
        out = (seen < -model[f'{key}.back']) | (seen > model[f'{key}.ahead'])
        if seen.size and float(np.mean(out)) > 1 - _ENDS[1] + _ENDS[0]:
            words.append(
                f'{key} is {range_words(model, key)}: {100 * float(np.mean(out)):.0f} % of the '
                'time of these data lies beyond'
            )
    return words
