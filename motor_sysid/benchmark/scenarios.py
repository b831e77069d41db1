"""What is to be drawn: complete models, one hidden effect, two, or one that is withheld."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cache
from itertools import combinations

import numpy as np

from motor_sysid.benchmark.datasheets import DATA_SHEETS
from motor_sysid.benchmark.equivalences import invisible
from motor_sysid.benchmark.hidden import HIDE, Situation
from motor_sysid.benchmark.hidden_sensors import HIDE_SENSOR
from motor_sysid.benchmark.plant import Plant
from motor_sysid.errors import UserError
from motor_sysid.physics.effects import catalogue

SIZES = (0.03, 0.10, 0.01)
LARGER = (0.03, 0.10)
"""Sizes as fractions, in the order in which they are drawn; where two effects are hidden or one is
withheld, only the larger ones."""


class Category(Enum):
    """Kinds of scenarios."""

    COMPLETE = 'complete'
    SINGLE = 'single'
    PAIR = 'pair'
    WITHHELD = 'withheld'


@dataclass(frozen=True)
class Scenario:
    """What is to be drawn.

    Attributes
    ----------
    effects:
        Keys of what is hidden; empty for a complete model.
    size:
        Size of each as a fraction; see `motor_sysid.benchmark.hidden`.
    withheld:
        Whether the diagnosis has to do without these effects in its catalogue.
    """

    effects: tuple[str, ...]
    size: float = 0.0
    withheld: bool = False

    @property
    def category(self) -> Category:
        """Its kind."""
        if self.withheld:
            return Category.WITHHELD
        return (Category.COMPLETE, Category.SINGLE, Category.PAIR)[len(self.effects)]

    @property
    def title(self) -> str:
        """What is hidden, for tables."""
        return ' + '.join(self.effects) or 'none'

    @property
    def key(self) -> str:
        """Its name: category, effects joined by `+`, size in percent."""
        if not self.effects:
            return self.category.value
        return f'{self.category.value}/{"+".join(self.effects)}/{100 * self.size:g}'


PATTERN = (
    Category.COMPLETE, Category.SINGLE, Category.PAIR, Category.SINGLE,
    Category.COMPLETE, Category.WITHHELD, Category.SINGLE, Category.WITHHELD,
)  # fmt: skip
"""The mixture, drawn round and round: any beginning of the list is a fair sample of it."""


def schedule(count: int) -> Iterator[tuple[Scenario, int]]:
    """Yield `count` scenarios with the number of times that each has come before."""
    streams = _streams()
    taken = dict.fromkeys(Category, 0)
    for k in range(count):
        category = PATTERN[k % len(PATTERN)]
        turn, place = divmod(taken[category], len(streams[category]))
        taken[category] += 1
        yield streams[category][place], turn


def case_name(scenario: Scenario, number: int) -> str:
    """Return the name of a case, which with the seed says everything about it."""
    return f'{scenario.key}/{number}'


def named_case(name: str) -> tuple[Scenario, int]:
    """Return scenario and number of a case.

    Raises
    ------
    UserError
        If there is no such case.
    """
    *head, number = name.split('/')
    known = {one.key: one for stream in _streams().values() for one in stream}
    scenario = known.get('/'.join(head))
    if scenario is None or not number.isdigit():
        raise UserError(
            f'no case `{name}`; names look like `complete/7`, `single/coulomb_friction/3/0`, '
            '`pair/coulomb_friction+cogging_torque/10/2` or `withheld/input_delay/3/1`'
        )
    return scenario, int(number)


@cache
def _streams() -> dict[Category, list[Scenario]]:
    keys = [*HIDE, *HIDE_SENSOR]
    visible = [key for key in keys if not invisible(key)]
    held = [key for key in visible if key in catalogue()]
    return {
        Category.COMPLETE: [Scenario(())],
        Category.SINGLE: _mixed([Scenario((key,), s) for key in keys for s in SIZES]),
        Category.PAIR: _mixed([Scenario(pair, s) for pair in pairs(held) for s in LARGER]),
        Category.WITHHELD: _mixed([Scenario((key,), s, True) for key in held for s in LARGER]),
    }


def pairs(keys: list[str]) -> list[tuple[str, ...]]:
    """Return the pairs of effects that can be hidden together without one undoing the other."""
    touched = {key: _touched(key) for key in keys}
    return [pair for pair in combinations(keys, 2) if not touched[pair[0]] & touched[pair[1]]]


def _touched(key: str) -> set[str]:
    """Return the numbers of plant or sensors that an effect sets."""
    if key in HIDE_SENSOR:
        return {f'sensor {key}'}
    sheet = DATA_SHEETS[0]
    plain = Plant(sheet.R, sheet.L, sheet.k, sheet.J, 1e-9)
    hidden = HIDE[key](plain, 0.03, Situation(sheet, 10.0, 1.0), np.random.default_rng(0))
    return {
        name
        for name, a, b in zip(Plant._fields, plain, hidden, strict=True)
        if a != b
    }


def _mixed(scenarios: list[Scenario]) -> list[Scenario]:
    """Return the scenarios in an order by chance that is always the same."""
    order = np.random.default_rng(2026).permutation(len(scenarios))
    return [scenarios[k] for k in order]
