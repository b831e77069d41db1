"""Which motor kind records are fitted with, and which of their signals it uses."""

from collections.abc import Callable, Mapping, Sequence
import math
from types import MappingProxyType

from motor_sysid.diagnosis.result.names import listed
from motor_sysid.diagnosis.search.rotor_axes import BY_HAND
from motor_sysid.diagnosis.search.standstill import stands_still, words_of_standstill
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import observed_outputs
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor, motors
from motor_sysid.physics.motors.base import Motor
from motor_sysid.physics.motors.speed import top_speed
from motor_sysid.signals.channels import DRIVING_CURRENTS
from motor_sysid.signals.checks.common import SUPPLY
from motor_sysid.signals.record import Record

FAST_FIELD, WELL_SEEN = 1.5, 0.5
"""Electrical angle from sample to sample that is told, and one that records show well, rad."""

LOST_FIELD = 2.0 * math.pi
"""The same from which on another kind takes the place of a motor's, unless its own is asked for.
A voltage that turns that far in a sample is a mean, and each sample would take dozens of steps."""

NOTHING: Mapping[str, float] = MappingProxyType({})


def told_kind(
    records: Sequence[Record], wanted: str | None, known: Mapping[str, float] = NOTHING
) -> str | None:
    """Return the motor kind that is wanted, else the one that the records tell, if they do.

    That is the kind whose own signals all of them have; or the axis alone, where the field is too
    fast for the samples (`is_field_lost`) with the parameters that are `known`.
    """
    told = (
        key for key, kind in motors().items()
        if kind.tells and all(name in r for name in kind.tells for r in records)
    )  # fmt: skip
    kind = _blurring(records)
    alone = kind.blurred if kind and is_field_lost(kind, records, known) else None
    return wanted or next(told, alone)


def _blurring(records: Sequence[Record]) -> Motor | None:
    """Return the kind that all records fit and that another one may take the place of, if any."""
    kinds = (kind for kind in motors().values() if kind.blurred)
    return next((kind for kind in kinds if all(_fits(kind, r) for r in records)), None)


def is_field_lost(kind: Motor, records: Sequence[Record], known: Mapping[str, float]) -> bool:
    """Tell whether records hold no more of the electrical side of a motor.

    Its field turns by more than a whole turn from sample to sample, with one pole pair if more are
    not known.
    """
    pairs = known.get(kind.wave, 1.0)
    return any(pairs * top_speed(record) * record.dt > LOST_FIELD for record in records)


def choose_kind(records: Sequence[Record], wanted: str | None) -> Motor:
    """Return the motor kind: the wanted one, or the richest that the signals allow.

    A current beside a duty cycle drives a motor only where that is wanted: what the drive sets is
    the voltage, of which the duty cycle is a share.

    Raises
    ------
    UserError
        If no kind fits the signals.
    """
    order = [k for k in (wanted, motor(wanted).unmeasured) if k] if wanted else list(motors())
    for kind in map(motor, order):
        if all(_fits(kind, r) for r in records) and (
            wanted or not any(_passes_over_duty(kind, r) for r in records)
        ):
            return kind
    have = ', '.join(sorted(set.intersection(*(set(r) for r in records)))) or 'none in common'
    needed = '; or, as '.join(_needs(motor(key), wanted) for key in order)
    told = (
        f'a {motor(wanted).title} needs {needed}. These data have {have}; name what is missing in '
        'a msg_config file'
        if wanted
        else f'no motor kind fits these signals ({have}): needed are an input (voltage, torque, '
        'force or current) and an output (speed or position); name them in a msg_config file'
    )
    if wanted and motor(wanted).frame == 'dq' and all('voltage_a' in r for r in records):
        told += f', or `position`, all voltages and two currents of the phases. {BY_HAND}'
    duty = all('duty' in r for r in records)
    raise UserError(f'{told}{f", or add {SUPPLY}" if duty else ""}')


def refuse_mixed(kind: Motor, records: Sequence[Record]) -> None:
    """Refuse records that are not driven and measured alike.

    Raises
    ------
    UserError
        If two differ in the signals that drive them, or one turns and the other is linear.
    """
    alike: dict[tuple[str, ...], str] = {}
    for record in records:
        inputs = [
            'current' if name in DRIVING_CURRENTS else name
            for name in input_signals(record, kind)
        ]
        motion = {record.units[name] for name in ('speed', 'position') if name in record}
        linear = 'linear motion' if any(u.startswith('m') for u in motion) else 'rotation'
        alike.setdefault((*inputs, linear), _sources([record]))
    if len(alike) > 1:
        one, other = list(alike.items())[:2]
        raise UserError(
            f'{one[1]} has {listed(one[0])}, {other[1]} {listed(other[0])}: these are no records '
            'of one motor; give them one by one'
        )


def refuse_other_kind(kind: Motor, model: Model | None) -> None:
    """Refuse a given model of another kind than the one that the records allow.

    Raises
    ------
    UserError
        If there is such a model; it says what that needs.
    """
    if model is not None and model.motor != kind.key:
        raise UserError(
            f'the model is a {model.kind.title}, and needs {_needs(model.kind, model.motor)}. '
            f'Not all of these data have that: leave out those that lack it, or begin without the '
            f'model (`--motor {kind.key}`)'
        )


def _fits(kind: Motor, record: Record) -> bool:
    """Whether a record has all that a kind needs."""
    drivable = any(all(name in record for name in names) for names in kind.inputs)
    moving = 'position' in record or ('speed' in record and not kind.needs_position)
    return drivable and moving and all(name in record for name in _currents(kind))


def _currents(kind: Motor) -> list[str]:
    return [o.signal for o in kind.outputs if o.state in kind.currents]


def _passes_over_duty(kind: Motor, record: Record) -> bool:
    return 'duty' in record and set(input_signals(record, kind)) <= set(DRIVING_CURRENTS)


def _needs(kind: Motor, wanted: str | None) -> str:
    """Say which signals a kind needs, with its name if it takes the place of the wanted one."""
    inputs = ' or '.join(', '.join(names) for names in kind.inputs) + ' as input'
    motion = 'position' if kind.needs_position else 'speed or position'
    name = '' if kind.key == wanted else f'`{kind.key}`, '
    return f'{name}{", ".join([inputs, *_currents(kind)])}, and {motion}'


def used_signals(records: Sequence[Record], wanted: str | None) -> set[str]:
    """Return the signals that a fit to records uses."""
    kind = choose_kind(records, told_kind(records, wanted))
    inputs = {name for r in records for name in input_signals(r, kind)}
    return {*inputs, *observed_outputs(kind, records), *kind.tells}


def passed_over(
    records: Sequence[Record], used: Callable[[Sequence[Record]], set[str]]
) -> tuple[str, ...]:
    """Say which signals of some records are not used because others lack them.

    `used` tells the signals that are used of some records together.
    """
    together = used(records)
    owners: dict[str, list[Record]] = {}
    for record in records:
        for name in sorted(used([record]) - together):
            owners.setdefault(name, []).append(record)
    lacking = {name: [r for r in records if name not in r] for name in owners}
    return tuple(
        f'{_sources(lacking[name])} {"have" if len(lacking[name]) > 1 else "has"} no {name}; the '
        f'{name} of {_sources(with_it)} is not used'
        for name, with_it in owners.items()
        if lacking[name]
    )


def _sources(records: Sequence[Record]) -> str:
    names = dict.fromkeys(r.provenance.source or 'a record' for r in records)
    return ', '.join(names)


def remarks(kind: Motor, records: Sequence[Record], wanted: str | None) -> tuple[str, ...]:
    """Say what a fit to records makes no use of, and what comes of a rotor that stands still."""
    still = bool(kind.currents) and stands_still(records)
    said: tuple[str, ...] = (words_of_standstill(kind),) if still else ()
    blurring = None if wanted else _blurring(records)
    if blurring and blurring.blurred == kind.key:
        said = (_ALONE.format(blurring.key),)
    if kind.frame == 'abc' and not wanted:
        said += (_TRAPEZOID,)
    return (*passed_over(records, lambda some: used_signals(some, wanted)), *said)


_TRAPEZOID = (
    'three phases alone do not tell a sinusoidal back-EMF from a trapezoidal one, which is fitted '
    'here. To do: name the kind, `--motor bldc`, or `--motor pmsm` for a sinusoidal one'
)

_ALONE = (
    'the field turns on by more than a turn from sample to sample: the mechanical side is fitted '
    'alone, with the q current as what drives it. To do: for the electrical side, record faster '
    '(`--motor {}` tries with these data, and takes long)'
)


def remarks_on_values(
    kind: Motor, records: Sequence[Record], values: Mapping[str, float]
) -> tuple[str, ...]:
    """Say what parameters tell of records: of their rate, and of the units that a fit is in."""
    return (*remarks_on_field(kind, records, values), *remarks_on_units(kind, records, values))


def remarks_on_units(
    kind: Motor, records: Sequence[Record], values: Mapping[str, float]
) -> tuple[str, ...]:
    """Say so where torques are in ampere: the torque constant of a current is not known."""
    held = [p.name for p in kind.parameters if p.name in ('gain', 'k_t') and not p.free]
    driven = {name for record in records for name in input_signals(record, kind)}
    in_amperes = kind.currents or driven <= set(DRIVING_CURRENTS)
    if not (held and in_amperes and values[held[0]] == 1.0):
        return ()
    return (
        'the torque constant is not known, and current and motion do not tell it: torques are in '
        'ampere, inertia and friction per torque constant. To do: name it in a data sheet '
        f'(`--nominal`, `torque_constant_Nm_per_A`) or in the model (`{held[0]}`)',
    )


def remarks_on_field(
    kind: Motor, records: Sequence[Record], values: Mapping[str, float]
) -> tuple[str, ...]:
    """Say so where the field of a three-phase motor turns on by much within a sample."""
    if not kind.wave or kind.wave not in values:
        return ()
    dt = max(record.dt for record in records)
    turn = values[kind.wave] * max(map(top_speed, records)) * dt
    if turn < FAST_FIELD:
        return ()
    wanted = 100 * math.ceil(turn / (WELL_SEEN * dt) / 100)
    held = _COMMUTATED if kind.terminals else _HELD
    alone = f'; or fit {_AXIS} (`--motor {kind.blurred}`)' if kind.blurred else ''
    return (
        f'the field turns on by {math.degrees(turn):.0f} degrees from sample to sample at the '
        f'highest speed: {held}. To do: record at {wanted} Hz, or slower motion{alone}',
    )


_HELD = (
    'a voltage that a drive changes in between, and is held here, tells little of the currents, '
    'and each sample takes many steps of simulation'
)
_COMMUTATED = 'the drive commutates in nearly every sample, and what happens there is not recorded'
_AXIS = 'the mechanical side alone, driven by the q current'
