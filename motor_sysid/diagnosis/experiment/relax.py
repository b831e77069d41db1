"""Where no admissible experiment separates the rivals: which limit stands in the way."""

from dataclasses import replace

from motor_sysid.diagnosis.experiment.discriminate import discriminate
from motor_sysid.diagnosis.experiment.limits import Limits, SIZES
from motor_sysid.diagnosis.experiment.stage import Stage

LONGER = 3.0
"""How much longer an experiment is tried to find out whether time would help."""

_WORDS = {
    'input': 'twice the input', 'speed': 'twice the speed', 'current': 'twice the current',
    'travel': 'twice the travel', 'reverse': 'leave to turn back',
    'time': f'{LONGER:.0f} times the time',
}  # fmt: skip


def would_help(stage: Stage) -> tuple[str, ...]:
    """Say which wider limit would let an experiment separate the rivals, or that none would."""
    helps = []
    for name, limits in wider(stage.limits):
        found = discriminate(stage.with_limits(limits), quick=True)
        if found is not None and found.decides:
            helps.append(_WORDS[name])
    if not helps:
        return ('No wider limit was found to help either.',)
    return (f'It could be decided with {" or ".join(helps)}.',)


def wider(limits: Limits) -> list[tuple[str, Limits]]:
    """Return every single limit that could be wider, and the limits with it widened."""
    more = [(n, limits.widened(n)) for n in SIZES if limits.of(n) < float('inf')]
    if not limits.reverse:
        more.append(('reverse', limits.widened('reverse')))
    return [*more, ('time', replace(limits, time=LONGER * limits.time))]
