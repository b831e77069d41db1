"""Titles, numbers and short phrases of the view."""

from collections.abc import Mapping, Sequence
import math
import re

from motor_sysid.diagnosis.result.names import listed
from motor_sysid.diagnosis.result.result import Diagnosis, Verdict
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.motors import motor
from motor_sysid.signals.record import Record
from motor_sysid.signals.short_names import short_names
from motor_sysid.workbench.schema import Named

VERDICTS: Mapping[Verdict, str] = {
    Verdict.COMPLETE: 'Nothing is missing',
    Verdict.EFFECT_MISSING: 'Missing',
    Verdict.AMBIGUOUS: 'Several effects explain these data equally well',
    Verdict.UNKNOWN_EFFECT: 'Something is missing that the catalogue does not know',
    Verdict.INSUFFICIENT_DATA: 'These data are not enough to decide',
}

UNEVEN = 'The records are not of one motor and supply'

MOST_NAMES = 4
"""Recordings that are listed by name."""

DIGITS = 6
"""Significant digits of a number in the view."""


def number(value: float) -> float | None:
    """Return a value rounded to six significant digits, or None if it is not finite."""
    return float(f'{value:.{DIGITS}g}') if math.isfinite(value) else None


def named(key: str, titles: Mapping[str, str]) -> Named:
    """Return an effect's key with its title."""
    return {'key': key, 'title': titles.get(key) or title_of(key)}


def title_of(key: str) -> str:
    """Turn a key into words, for an effect that no catalogue knows."""
    return key.replace('_', ' ')


def motor_title(key: str) -> str:
    """Return a motor kind in words."""
    return motor(key).title


def effect_titles(diagnosis: Diagnosis) -> dict[str, str]:
    """Return the title of every effect of the catalogue and of every other that was tried."""
    tried = {c.effect: c.title for step in diagnosis.steps for c in step.candidates}
    return {**{key: effect.card.title for key, effect in catalogue().items()}, **tried}


def verdict_title(diagnosis: Diagnosis, titles: Mapping[str, str]) -> str:
    """Return the verdict in a few words, with the effects that it names."""
    effects = listed([named(key, titles)['title'] for key in diagnosis.effects])
    if diagnosis.verdict is Verdict.EFFECT_MISSING and effects:
        return f'{VERDICTS[diagnosis.verdict]}: {effects}'
    if diagnosis.verdict is Verdict.AMBIGUOUS and effects:
        return f'Possibly missing: {effects}; another effect fits as well'
    if diagnosis.verdict is Verdict.UNKNOWN_EFFECT and diagnosis.differences:
        return UNEVEN if diagnosis.unknown else f'{UNEVEN}; nothing else is missing'
    return VERDICTS[diagnosis.verdict]


def with_titles(text: str, titles: Mapping[str, str]) -> str:
    """Replace the keys of effects in a text by their titles."""
    return re.sub(r'\b[a-z]+(_[a-z]+)+\b', lambda found: titles.get(found[0], found[0]), text)


def sources_of(records: Sequence[Record]) -> list[str]:
    """Return where records come from, each source once."""
    return list(dict.fromkeys(record.provenance.source for record in records))


def recordings(names: Sequence[str]) -> str:
    """Name recordings, or say how many there are."""
    if len(names) <= MOST_NAMES:
        return ', '.join(names)
    return f'{len(names)} recordings: {names[0]}, {names[1]}, ...'


def held_out_words(records: Sequence[Record], roles: Sequence[str]) -> str:
    """Say which part of the data the errors are judged on."""
    held = [r for r, role in zip(records, roles, strict=True) if role == 'validate']
    if not held:
        return 'nothing held out'
    seconds = sum(record.duration for record in held)
    if len(held) == len(records):
        return f'validated on all {seconds:.3g} s'
    own = sources_of(held)
    trained = [r for r, role in zip(records, roles, strict=True) if role == 'train']
    before = [record for record in trained if record.provenance.source in own]
    if before:
        last = len(held) == 1 and all(r.time[-1] < held[0].time[0] for r in before)
        return f'held out: {"last " if last else ""}{seconds:.3g} s'
    names = short_names(sources_of(records))
    return f'held out: {recordings([names[source] for source in own])} ({seconds:.3g} s)'
