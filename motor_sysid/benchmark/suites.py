"""Benchmarks of the diagnosis on other motors than a brushed one with all its sensors."""

from collections.abc import Callable
from typing import NamedTuple

from motor_sysid.benchmark import three_phase_judge, voltage_only
from motor_sysid.benchmark.outcome import Result
from motor_sysid.benchmark.three_phase_cases import schedule as three_phase_schedule


class Suite(NamedTuple):
    """Cases that know their names.

    Attributes
    ----------
    cases:
        How many a whole run has.
    schedule:
        Returns the names of so many cases.
    owns:
        Whether a name is that of one of its cases.
    described:
        Returns the part of a result that the name tells.
    one_case:
        Draws, diagnoses and judges a case of a seed.
    """

    cases: int
    schedule: Callable[[int], list[str]]
    owns: Callable[[str], bool]
    described: Callable[[str], Result]
    one_case: Callable[[str, int], Result]


SUITES = {
    'three_phase': Suite(
        120, three_phase_schedule, three_phase_judge.owns, three_phase_judge.described,
        three_phase_judge.one_case,
    ),
    'voltage_only': Suite(
        126, voltage_only.schedule, voltage_only.owns, voltage_only.described,
        voltage_only.one_case,
    ),
}  # fmt: skip
"""By the name that the command line knows."""


def suite_of(name: str) -> Suite | None:
    """Return the suite of a case, or None for a brushed motor with all its sensors."""
    return next((suite for suite in SUITES.values() if suite.owns(name)), None)
