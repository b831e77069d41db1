"""Diagnose each motor of a fleet, agree on one model for all, fit it to each, and compare."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
import math
from typing import Protocol, TypeVar

from motor_sysid.diagnosis import diagnose, Settings, Verdict
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.errors import UserError
from motor_sysid.fleet.spread import ALPHA, Spread, spreads
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Task = TypeVar('Task')
Answer = TypeVar('Answer')

class Each(Protocol):
    """Does tasks, one after the other or in several processes."""

    def __call__(
        self, tasks: Iterable[Task], work: Callable[[Task], Answer], /
    ) -> Iterable[tuple[Task, Answer]]:
        """Yield tasks with their answers as they come; one without answer is left out."""


def in_turn(
    tasks: Iterable[Task], work: Callable[[Task], Answer]
) -> Iterable[tuple[Task, Answer]]:
    """Do one task after the other."""
    return ((task, work(task)) for task in tasks)


_SURE = (Verdict.COMPLETE, Verdict.EFFECT_MISSING)


@dataclass(frozen=True)
class Question:
    """What is asked of each motor: arguments of `motor_sysid.diagnosis.diagnose`.

    Attributes
    ----------
    motor, model, nominal:
        Motor kind, model that all are said to follow, and data-sheet values; each may be left out.
    settings:
        Limits of the diagnosis.
    """

    motor: str | None = None
    model: Model | None = None
    nominal: Mapping[str, float] | None = None
    settings: Settings | None = None


@dataclass(frozen=True)
class Member:
    """One motor of a fleet.

    Attributes
    ----------
    name:
        Of the motor.
    verdict, effects:
        What its own diagnosis says; the effects beyond the model, where one was given.
    reason:
        The first of its reasons, or why nothing could be said.
    errors:
        Held-out errors in percent: of the model that the diagnosis begins with, of the one it ends
        with, and of the model of all, fitted to this motor; NaN where there is none.
    model:
        The model of all, fitted to this motor; None where that failed.
    more, less:
        Effects that this motor has beyond the model of all, and effects of it that its own
        diagnosis does not name.
    """

    name: str
    verdict: Verdict | None
    effects: tuple[str, ...]
    reason: str
    errors: tuple[float, float, float]
    model: Model | None = None
    more: tuple[str, ...] = ()
    less: tuple[str, ...] = ()


@dataclass(frozen=True)
class Fleet:
    """What there is to say of a fleet.

    Attributes
    ----------
    motor, effects:
        The model of all: motor kind and effects.
    members:
        Every motor.
    spreads:
        Every parameter that two motors tell.
    """

    motor: str
    effects: tuple[str, ...]
    members: tuple[Member, ...]
    spreads: tuple[Spread, ...]

    def oddities(self, member: Member) -> list[str]:
        """Return in what a motor is not like the others, in words; none where it is."""
        own, common = (f'{error:.3g} %' for error in member.errors[1:])
        found = [
            f'has {effect(key).card.title} beyond the others (error {common}, with all of its own '
            f'effects {own})'
            for key in member.more
        ]
        found += [f'shows no {effect(key).card.title}' for key in member.less]
        unknown = [one for one in self.members if one.verdict is Verdict.UNKNOWN_EFFECT]
        if member in unknown and len(unknown) <= len(self.members) / 2:
            found.append('something is missing that no known effect explains')
        for spread in self.spreads:
            found += [spread.words(one) for one in spread.odd if one.name == member.name]
        return found


def survey(
    records: Mapping[str, Sequence[Record]],
    question: Question | None = None,
    *,
    alpha: float = ALPHA,
    each: Each = in_turn,
    tell: Callable[[str], None] = lambda text: None,
) -> Fleet:
    """Diagnose each motor, agree on one model, fit it to each, and say which one is odd.

    The model of all has the effects that more than half of the motors have, or is the one that was
    given.  A special case counts for what it is a case of, and the other way round: where four
    motors have Coulomb friction and three Stribeck friction, all have the former.

    Parameters
    ----------
    records:
        Motor to its records.
    question:
        What is asked of each.
    alpha:
        Chance that any parameter is called odd though the motors are alike.
    each:
        Does the work; default: one motor after the other.
    tell:
        Is told what is going on.

    Raises
    ------
    UserError
        If no motor can be diagnosed.
    """
    question, tasks = question or Question(), list(records.items())
    known = {name: (_unjudged(name, 'its diagnosis came to no end'), '') for name in records}
    for count, (_, one) in enumerate(each(tasks, partial(_diagnosed, question=question)), 1):
        known[one[0].name] = one
        tell(f'{one[0].name}: {_said(one[0])} ({count} of {len(tasks)})')
    judged = [(member, kind) for member, kind in known.values() if kind]
    if not judged:
        reasons = '; '.join(f'{member.name}: {member.reason}' for member, _ in known.values())
        raise UserError(f'no motor can be diagnosed: {reasons}')
    motor = Counter(kind for _, kind in judged).most_common(1)[0][0]
    effects = common([member.effects for member, _ in judged])
    if question.model is not None:
        effects = question.model.effects
    agreed = Agreed(motor, effects, question)
    members = {name: member for name, (member, _) in known.items()}
    fits = [(member, records[member.name]) for member, _ in judged]
    for count, (_, member) in enumerate(each(fits, partial(_fitted, agreed=agreed)), 1):
        members[member.name] = member
        tell(f'{member.name}: fitted ({count} of {len(fits)})')
    models = {name: one.model for name, one in members.items() if one.model is not None}
    return Fleet(motor, effects, tuple(members.values()), tuple(spreads(models, alpha)))


@dataclass(frozen=True)
class Agreed:
    """The model of all: motor kind, effects, and what was asked."""

    motor: str
    effects: tuple[str, ...]
    question: Question


def common(sets: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return the effects that more than half of the motors have, the most frequent first.

    An effect counts where a more general one is, which has it as special case; of two chosen ones
    of which one is a case of the other the general one stays.
    """
    votes = Counter(k for own in sets for k in dict.fromkeys(k for o in own for k in _cases(o)))
    chosen = [key for key, count in votes.most_common() if count > len(sets) / 2]
    return tuple(k for k in chosen if not any(k in _cases(o) for o in chosen if o != k))


def _cases(key: str) -> list[str]:
    """Return an effect and its special cases, always in the same order."""
    return [key, *(k for special in effect(key).card.replaces for k in _cases(special))]


def _apart(own: Sequence[str], others: Sequence[str]) -> tuple[str, ...]:
    """Return what a model has that another has neither as such nor as a special or wider case."""
    return tuple(k for k in own if not any(k in _cases(o) or o in _cases(k) for o in others))


def _unjudged(name: str, reason: str) -> Member:
    return Member(name, None, (), reason, (math.nan,) * 3)


def _said(member: Member) -> str:
    if member.verdict is None:
        return member.reason
    return ', '.join(member.effects) or member.verdict.value.replace('_', ' ')


def _diagnosed(task: tuple[str, Sequence[Record]], question: Question) -> tuple[Member, str]:
    """Return what the diagnosis of one motor says, and its motor kind, '' where it failed."""
    name, records = task
    try:
        found = diagnose(
            records, motor=question.motor, model=question.model, nominal=question.nominal,
            settings=question.settings,
        )  # fmt: skip
    except UserError as problem:
        return _unjudged(name, str(problem)), ''
    errors = found.steps[0].validation_error_percent, found.steps[-1].validation_error_percent
    reason = found.reasons[0] if found.reasons else ''
    member = Member(name, found.verdict, found.effects, reason, (*errors, math.nan))
    return member, found.model.motor


def _fitted(task: tuple[Member, Sequence[Record]], agreed: Agreed) -> Member:
    """Return a motor with the model of all, fitted to it."""
    member, records = task
    question = agreed.question
    try:
        rung = fit_model(
            records, model=question.model, motor=None if question.model else agreed.motor,
            nominal=question.nominal, effects=agreed.effects,
        )  # fmt: skip
    except UserError as problem:
        return replace(member, reason=member.reason or str(problem))
    own = member.effects if question.model is None else (*agreed.effects, *member.effects)
    return replace(
        member, model=rung.model, errors=(*member.errors[:2], rung.validation.error_percent),
        more=_apart(own, agreed.effects),
        less=_apart(agreed.effects, own) if member.verdict in _SURE else (),
    )  # fmt: skip
