"""d and q of motors that are recorded in phases: the angle that makes them, and what tells it."""

from collections.abc import Mapping, Sequence
import math

from motor_sysid.errors import UserError
from motor_sysid.physics.motors import motor
from motor_sysid.signals.checks.phases import check, OFF
from motor_sysid.signals.phases import CURRENTS, PHASES, with_dq
from motor_sysid.signals.record import Record

PAIRS, OFFSET = 'pole_pairs', 'angle_offset'

BY_HAND = (
    '`motor-sysid check` says what the phases show; in Python '
    '`motor_sysid.signals.phases.with_dq(record, pole_pairs, offset)` makes d and q'
)


def axes_told(
    records: Sequence[Record], wanted: str | None, known: Mapping[str, float]
) -> dict[str, float]:
    """Return pole pairs and electrical offset that phases show, where d and q are made with them.

    Nothing where no d and q have to be made, or both are known.

    Raises
    ------
    UserError
        If the phases do not tell the angle, or not one for all, or other pole pairs than known.
    """
    phases = [record for record in records if _in_phases(record, wanted)]
    if not phases or {PAIRS, OFFSET} <= set(known):
        return {}
    seen = [finding for record in sorted(phases, key=len)[::-1] for finding in check([record])]
    shown = [one.numbers for one in seen if math.isfinite(one.numbers.get('offset_rad', math.nan))]
    if not shown:
        why = next((one.message for one in seen if one.code in ('phase_order', PAIRS)),
                   'the motion does not tell where the magnet lies')  # fmt: skip
        raise _unclear(why)
    pairs, offset = shown[0]['pole_pairs'], shown[0]['offset_rad']
    if any(one['pole_pairs'] != known.get(PAIRS, pairs) for one in shown):
        found = sorted({f'{one["pole_pairs"]:g}' for one in shown})
        given = f', and {known[PAIRS]:g} are given' if PAIRS in known else ''
        raise _unclear(f'the phases show {" and ".join(found)} pole pairs{given}')
    if any(abs(math.remainder(one['offset_rad'] - offset, math.tau)) > OFF for one in shown):
        raise _unclear('the magnet lies elsewhere at position 0 from record to record')
    return {PAIRS: float(pairs), OFFSET: float(known.get(OFFSET, offset))}


def words_of_axes(told: Mapping[str, float]) -> tuple[str, ...]:
    """Say with which angle d and q were made, if phases told it."""
    if not told:
        return ()
    return (
        f'd and q are made from the phases, with the {told[PAIRS]:g} pole pairs and the offset of '
        f'{told[OFFSET]:.3f} rad electrical that they show',
    )


def with_axes(
    records: Sequence[Record], wanted: str | None, known: Mapping[str, float]
) -> list[Record]:
    """Return the records with d and q made from phases, where the wanted motor needs them."""
    angle = {**known, **axes_told(records, wanted, known)}
    return [
        with_dq(record, angle[PAIRS], angle[OFFSET]) if _in_phases(record, wanted) else record
        for record in records
    ]


def _in_phases(record: Record, wanted: str | None) -> bool:
    """Whether a motor in d and q is wanted of a record that has but phases and a position."""
    return (
        wanted is not None
        and motor(wanted).frame == 'dq'
        and 'position' in record
        and not {'voltage_q', 'current_q'} & set(record)
        and all(f'voltage_{phase}' in record for phase in PHASES)
        and sum(name in record for name in CURRENTS) > 1
    )


def _unclear(why: str) -> UserError:
    return UserError(
        f'the motor is fitted in d and q, and these phases do not make them: {why}. {BY_HAND}'
    )
