"""How much evidence a complete model makes by chance: one run of the parametric bootstrap."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from motor_sysid.diagnosis.calibration.controller import Controller, fit_controller, WELL
from motor_sysid.diagnosis.calibration.noise import Noise
from motor_sysid.diagnosis.calibration.situation import Situation, situation_of
from motor_sysid.diagnosis.calibration.spectrum import fit_noise
from motor_sysid.diagnosis.calibration.twin import Twin
from motor_sysid.diagnosis.search.bench import (
    make_bench,
    prepared_parts,
    with_scales,
)
from motor_sysid.diagnosis.search.gates import UNPHYSICAL
from motor_sysid.diagnosis.search.integration_steps import refined
from motor_sysid.diagnosis.search.refusals import refuse_short
from motor_sysid.diagnosis.search.rounds import refitted, scored
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.diagnosis.search.standstill import refuse_model_at_rest
from motor_sysid.errors import UserError
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Tell = Callable[[str], None]

REFITS = 6


@dataclass(frozen=True)
class Plan:
    """Everything that a run needs; it can be sent to another process.

    Attributes
    ----------
    model:
        The motor that lacks nothing.
    train, validation:
        Recordings to make again.
    fraction:
        Part of each that is held back where there is no validation recording.
    noise:
        What is random about them.
    candidates:
        Keys of the effects that are looked for.
    situation:
        What the calibration is for.
    seed:
        Of all runs.
    """

    model: Model
    train: tuple[Twin, ...]
    validation: tuple[Twin, ...]
    fraction: float
    noise: Noise
    candidates: tuple[str, ...]
    situation: Situation
    seed: int

    @property
    def driven_by(self) -> tuple[str, ...]:
        """For each recording what gives the input again, in words."""
        loops = [twin.controller for twin in (*self.train, *self.validation)]
        return tuple(one.words if one else 'the recorded input' for one in loops)


@dataclass(frozen=True)
class Chance:
    """What one complete-model run shows.

    Attributes
    ----------
    number:
        Which run.
    evidence:
        Largest gain in BIC of any candidate: after the refit for those that are refitted, by
        score for the others.
    passing:
        Largest gain in BIC of a candidate that passes every other gate; minus infinity if none.
    effect:
        Key of the candidate with the largest gain.
    """

    number: int
    evidence: float
    passing: float
    effect: str


def make_plan(
    model: Model,
    train: Sequence[Record],
    validation: Sequence[Record],
    *,
    fraction: float,
    candidates: Sequence[str],
    seed: int,
    tell: Tell,
) -> Plan:
    """Read controller and noise from the recordings that a model was fitted to.

    Raises
    ------
    UserError
        If the recordings are too short, or the model cannot be run over one.
    """
    records, held = prepared_parts(train, validation, model.motor, model.parameters.values())
    refuse_short(records, held)
    refuse_model_at_rest(model, records)
    bench = with_scales(make_bench(records, held, model.kind, model, fraction), model)
    rung, bench = refined(climb(model, bench), bench)
    if not np.isfinite(rung.result.cost):
        raise UserError('the model cannot be run over these data; fit one with `motor-sysid fit`')
    model = rung.model
    loops = [Twin(model, r, _controller(model, r, tell)) for r in (*records, *held)]
    tell('reading the noise from what the model leaves')
    twins = [Twin(model, record) for record in records]
    noise = fit_noise(model, bench, twins, seed)
    return Plan(
        model,
        tuple(loops[: len(records)]),
        tuple(loops[len(records) :]),
        fraction,
        noise,
        tuple(candidates),
        situation_of(model, records, bench.outputs),
        seed,
    )


def _controller(model: Model, record: Record, tell: Tell) -> Controller | None:
    """Return the controller of a record if it was closed-loop and the controller is understood."""
    found = fit_controller(model, record)
    if found and found.quality < WELL:
        tell(f'the recorded input is used again, for a {found.words}')
        return None
    return found


def chance(plan: Plan, number: int) -> Chance:
    """Make the recordings again with fresh noise and see how much evidence that gives.

    The result depends on the plan and the number alone.

    Raises
    ------
    UserError
        If the run goes astray: an unstable loop.
    """
    rng = np.random.default_rng([plan.seed, 1 + number])
    train = [twin.make(plan.noise, rng) for twin in plan.train]
    held = [twin.make(plan.noise, rng) for twin in plan.validation]
    if not all(np.all(np.isfinite(r[name])) for r in (*train, *held) for name in r):
        raise UserError('a run of the calibration goes astray: its loop is unstable')
    return evidence_of(plan.model, train, held, plan.fraction, plan.candidates, number)


def evidence_of(
    model: Model,
    train: Sequence[Record],
    held: Sequence[Record],
    fraction: float,
    candidates: Sequence[str],
    number: int = 0,
) -> Chance:
    """Return the largest evidence for anything beyond a model, as the gates of a diagnosis see it.

    Parameters
    ----------
    model:
        The complete model; it is fitted again, from its values.
    train, held, fraction:
        Data, as `motor_sysid.diagnosis.diagnose` takes them.
    candidates:
        Keys of effects.
    number:
        Put into the result.
    """
    train, held = prepared_parts(train, held, model.motor, model.parameters.values())
    bench = with_scales(make_bench(train, held, model.kind, model, fraction), model)
    bench = replace(bench, threshold=-np.inf)
    rung, bench = refined(climb(model, bench), bench)
    scores = scored(rung, bench, [effect(key) for key in candidates], _silent)
    trials = refitted(scores, rung, bench, REFITS, _silent)
    found = {
        t.key: t.delta_bic for t in trials if t.note not in (UNPHYSICAL, 'cannot be simulated')
    }
    tried = {t.key for t in trials}
    for one in scores.singles:
        key = one.variant.effect.key
        if key not in tried and one.gain > 0.0:
            found[key] = max(found.get(key, -np.inf), one.delta_bic)
    best = max(found, key=lambda key: found[key], default='')
    passing = [t.delta_bic for t in trials if t.passes]
    return Chance(number, found.get(best, -np.inf), max(passing, default=-np.inf), best)


def _silent(text: str) -> None:
    """Tell nobody."""
