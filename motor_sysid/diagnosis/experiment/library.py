"""Experiments worth trying, each brought inside the limits."""

from collections.abc import Iterator
from dataclasses import dataclass

from motor_sysid.control.excitation import Family, input_families, speed_families
from motor_sysid.control.experiment import unit_of
from motor_sysid.control.profile import Profile, SPEED
from motor_sysid.diagnosis.experiment.limits import MARGIN
from motor_sysid.diagnosis.experiment.stage import Run, Stage

TRIES = 4
"""How often a profile that breaks a limit is made smaller."""

CAREFUL = 0.97
"""A profile is made that much smaller than the excess asks for."""

FITS = 1.0 + 1e-9
"""Largest peak over what is allowed that still fits: a limited output is at its limit."""

FLOOR = 0.01
"""Share of the first level below which a profile is given up."""


@dataclass(frozen=True)
class Choice:
    """One experiment that may be tried: a family at a level and a duration.

    Attributes
    ----------
    family:
        The family.
    signal:
        What it drives.
    share:
        Level as a share of the largest that the limits allow.
    duration:
        s.
    repeats:
        How often its parts are run through.
    """

    family: Family
    signal: str
    share: float = 1.0
    duration: float = 10.0
    repeats: int = 1


@dataclass(frozen=True)
class Tried:
    """An experiment inside the limits, simulated with every model."""

    choice: Choice
    profile: Profile
    runs: tuple[Run, ...]


def choices(stage: Stage, *, quick: bool = False) -> Iterator[Choice]:
    """Give the experiments to try first; `quick` gives a handful.

    Where the motor must not turn back few are left, and all of these are tried.
    """
    time = stage.limits.time
    speeds = speed_families(quick and stage.limits.reverse)
    for families, signal in ((speeds, SPEED), (() if quick else input_families(), stage.input)):
        for family in families:
            if stage.limits.reverse or not family.reverses:
                for share in (1.0,) if quick else (1.0, 0.4):
                    yield Choice(family, signal, share, time)


def variations(choice: Choice) -> Iterator[Choice]:
    """Give shorter and denser forms of an experiment, the shortest first."""
    for part in (0.25, 0.5, 1.0):
        for repeats in (1, 3):
            if (part, repeats) != (1.0, 1):
                yield Choice(
                    choice.family, choice.signal, choice.share, part * choice.duration, repeats
                )


def tried(stage: Stage, choice: Choice) -> Tried | None:
    """Simulate an experiment with every model, at the largest level within the limits.

    Returns
    -------
    None where no level fits: then even a hundredth of it breaks a limit.
    """
    level = first = top_level(stage, choice.signal) * choice.share
    unit = unit_of(choice.signal, linear=stage.models[0].linear)
    for _ in range(TRIES):
        profile = choice.family.profile(
            choice.signal, unit, level, choice.duration, choice.repeats
        )
        runs, worst = [], 0.0
        for place in range(len(stage.models)):
            runs.append(stage.run(profile, place))
            worst = max(worst, runs[-1].excess(stage.limits))
            if worst > FITS:
                break
        if worst <= FITS:
            return Tried(choice, profile, tuple(runs))
        level *= CAREFUL / min(worst, 10.0)
        if level < FLOOR * first:
            return None
    return None


def top_level(stage: Stage, signal: str) -> float:
    """Return the largest level that the limit of the signal itself allows."""
    limit = stage.limits.speed if signal == SPEED else stage.limits.input
    return MARGIN * min(limit, 1e9)
