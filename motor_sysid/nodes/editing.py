"""Change the effects of a running identifier: which values a new model starts from, or why not."""

from collections.abc import Mapping, Sequence

from motor_sysid.errors import UserError
from motor_sysid.estimation.handover import Estimate
from motor_sysid.nodes.live_diagnosis import DiagnosisOutcome
from motor_sysid.physics.effect import Effect, Shape
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.scales import scales_of
from motor_sysid.signals.record import Record

ASK_FIRST = 'call `~/diagnose` first, which finds the value, then add it'
_REST = 1e-9
_LEAST = 100
"""Samples that tell something of how the motor moves."""


def edited(
    model: Model,
    effects: Sequence[str],
    estimates: Mapping[str, Estimate] | None = None,
    found: DiagnosisOutcome | None = None,
    record: Record | None = None,
) -> Model:
    """Return a model with other effects.

    Where the last diagnosis fitted the model with exactly these effects, all values are those of
    that fit, for the effect's and the motor's belong together.  Otherwise the motor keeps its
    present estimates, and a new effect begins with what the diagnosis found for it, or with
    amplitudes of zero and shapes that suit the window.

    Parameters
    ----------
    model, effects:
        The model as it is, and the effects that it is to have.
    estimates:
        Present estimates.
    found:
        The last diagnosis.
    record:
        The last samples.

    Raises
    ------
    UserError
        If an effect is unknown, makes no sense for the motor, or cannot be carried on or started
        live; with the remedy.
    """
    new = present(model, estimates or {})
    wanted = tuple(dict.fromkeys(effects))
    for key in model.effects:
        if key not in wanted:
            new = new.without_effect(key)
    for key in wanted:
        if key in new.effects:
            continue
        one = _carried(key)
        new.with_effect(key)  # refuses what makes no sense for the motor, before anything else
        values = found.values_of(key) if found else {}
        values = values or _start(new, one, record)
        if 't' in one.needs():  # its phase and growth count from the start of the window
            values |= dict.fromkeys([a.name for a in one.card.amplitudes], 0.0)
        new = new.with_effect(key, values)
    fitted = found.model_with(new.effects) if found else None
    return _with_values(new, fitted.parameters.values(), wanted) if fitted else new


def present(model: Model, estimates: Mapping[str, Estimate]) -> Model:
    """Return the model with what has been estimated so far; the rest is as it was."""
    known = {name: value for name, (value, _, _, sure) in estimates.items() if sure}
    return _with_values(model, known, ())


def _with_values(model: Model, values: Mapping[str, float], timed: Sequence[str]) -> Model:
    """Return the model with the values that it has parameters for, inside their boxes.

    Amplitudes of the `timed` effects that count the time since the window began stay.
    """
    stay = {
        f'{key}.{a.name}'
        for key in timed
        if 't' in effect(key).needs()
        for a in effect(key).card.amplitudes
    }
    inside = model.parameters.inside(values)
    return model.with_values({name: v for name, v in inside.items() if name not in stay})


def _carried(key: str) -> Effect:
    """Return the effect if it has a place in a model that runs on for ever."""
    one = effect(key)
    if one.card.moment:
        raise UserError(
            f'`{key}` sets in at one moment, which a running identifier has passed: what changed '
            'once it follows by itself. Call `~/reset` to forget the time before; a load that '
            'came to stay is `constant_load_torque`'
        )
    return one


def _start(model: Model, one: Effect, record: Record | None) -> dict[str, float]:
    """Return start values of an effect that no diagnosis has looked at."""
    vague = [a.name for a in one.card.amplitudes if a.trials]
    vague += [s.name for s in one.card.shapes if not s.starts and s.name != one.card.orders]
    if vague:
        names = ', '.join(vague)
        raise UserError(f'`{one.key}` needs a value of {names} to start from: {ASK_FIRST}')
    return {shape.name: _shape(model, one, shape, record) for shape in one.card.shapes}


def _shape(model: Model, one: Effect, shape: Shape, record: Record | None) -> float:
    if record is None or len(record) < _LEAST:
        raise UserError(
            f'`{one.key}` needs samples to start from, and {len(record) if record else "none"} '
            'have come yet: add it while the motor turns, or start from a `model_file` that has it'
        )
    if shape.name == one.card.orders:
        from motor_sysid.diagnosis.candidates.matched_filter import Matched, STANDS_OUT
        from motor_sysid.estimation.batch import make_chain, observed_outputs, Problem

        outputs = observed_outputs(model.kind, [record])
        problem = Problem(model, [make_chain(record.uniform(), model.kind, outputs)], outputs)
        matched = Matched(problem, problem.linearize(problem.vector()))
        orders = matched.orders(one, 1, contrast=STANDS_OUT)
        if orders:
            return float(orders[0])
        if not shape.starts:
            raise UserError(
                f'no number of waves per turn stands out for `{one.key}` in the last samples: '
                f'turn the motor slowly, or {ASK_FIRST}'
            )
    size = scales_of(model.motor, model.parameters.values(), [record]).size(shape.scale)
    if not size > _REST:
        raise UserError(
            f'`{one.key}` cannot be started at rest: move the motor, or {ASK_FIRST}'
        )
    return shape.starts[0] * size
