"""A rotor that stands still all the time, locked or too weak: only its windings can be seen."""

from collections.abc import Sequence

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors.base import Motor, Term
from motor_sysid.signals.record import Record

MOTION = ('speed', 'position')


def stands_still(records: Sequence[Record]) -> bool:
    """Whether what is measured of the motion is a speed of zero, and a position that stays."""
    moved = [np.any(r['speed']) for r in records if 'speed' in r]
    moved += [np.ptp(r['position']) > 0 for r in records if 'position' in r]
    return bool(moved) and not any(moved)


def seen_at_rest(outputs: Sequence[str]) -> tuple[str, ...]:
    """Return the outputs that tell of a rotor that stands still: its currents, if any."""
    return tuple(name for name in outputs if name not in MOTION) or tuple(outputs)


def with_rotor_held(model: Model) -> Model:
    """Return the model of a locked rotor: it does not move, and what motion tells is held."""
    heavy = model.with_values({'J': model.parameters['J'].upper})
    return heavy.with_free(held_parameters(model.kind), free=False)


def words_of_standstill(kind: Motor) -> str:
    """Say what comes of a rotor that stands still."""
    return (
        f'the motor stands still in these data: {", ".join(held_parameters(kind))} are held so '
        'that it does, and say nothing of it'
    )


def refuse_model_at_rest(model: Model | None, records: Sequence[Record]) -> None:
    """Refuse to fit a model to records of a rotor that stands still.

    Raises
    ------
    UserError
        If there is a model; what it says of motion would be lost.
    """
    if model is not None and stands_still(records):
        raise UserError(
            'the motor stands still in these data, so they tell nothing of its motion; fit them '
            'without a model, and take resistance and inductance from there'
        )


def refuse_load_at_rest(kind: Motor, records: Sequence[Record]) -> None:
    """Refuse records of what stands still of which no current is measured: they tell nothing.

    Raises
    ------
    UserError
        If that is so.
    """
    if not kind.currents and stands_still(records):
        raise UserError(
            f'the {kind.title} stands still in these data, so they tell nothing of it: release '
            'its brake, drive it harder, or choose records in which it moves'
        )


def held_parameters(kind: Motor) -> list[str]:
    """Return the parameters of a kind that only a rotor in motion tells."""

    def parameters(terms: Sequence[Term]) -> set[str]:
        return {term.parameter for term in terms}

    terms = [t for b in kind.balances if b.force != 'torque' for t in b.terms]
    seen = parameters([t for t in terms if set(t.signals) & set(kind.currents)])
    everything = parameters([t for b in kind.balances for t in (b.drive, *b.terms)])
    return [p.name for p in kind.parameters if p.free and p.name in everything - seen]
