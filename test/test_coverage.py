"""The table of what the review paper names: its links lead somewhere, its names run."""

from pathlib import Path
import re

import numpy as np
import pytest

from motor_sysid.estimation.batch import METHODS, OPTIMIZERS, search
from motor_sysid.estimation.online import ESTIMATORS
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.motors import motors
from motor_sysid.structures import KINDS

PAGE = Path(__file__).parents[1] / 'docs/coverage.md'
TEXT = PAGE.read_text(encoding='utf-8')
ROWS = {int(n): cell for n, cell in re.findall(r'^\| (\d+) \|.*\| (.*) \|$', TEXT, re.MULTILINE)}
LISTS = {
    'effect': set(catalogue()),
    'estimator': set(ESTIMATORS),
    'method': set(METHODS),
    'motor': set(motors()),
    'structure': set(KINDS),
}


def test_every_row_is_there():
    assert list(ROWS) == list(range(1, 200))
    assert sum(cell.startswith('not here') for cell in ROWS.values()) < 30


@pytest.mark.parametrize('number', ROWS)
def test_a_row_leads_somewhere(number):
    cell = ROWS[number]
    links = re.findall(r'\]\(([^)#]+)(?:#([^)]+))?\)', cell)
    names = re.findall(r'(effect|estimator|method|motor|structure) `([^`]+)`', cell)
    assert links or names or cell.startswith('not here')
    for path, heading in links:
        target = PAGE.parent / path
        assert target.exists(), path
        if heading:
            words = [
                re.sub(r'[^a-z0-9 -]', '', line.lstrip('# ').lower()).replace(' ', '-')
                for line in target.read_text(encoding='utf-8').splitlines()
                if line.startswith('#')
            ]
            assert heading in words
    for kind, name in names:
        assert name in LISTS[kind], f'{kind} {name}'


@pytest.mark.parametrize('name', sorted({n for n in OPTIMIZERS if f'`{n}`' in TEXT}))
def test_a_named_optimizer_finds_the_bottom_of_a_bowl(name):
    """Estimators, structures, effects and motors each have a contract test over their list."""

    def bowl(x: np.ndarray) -> np.ndarray:
        return np.sum((x - 0.3) ** 2, axis=1)

    found = search(
        bowl, -np.ones(2), np.ones(2), method=name, population=20, iterations=40,
        rng=np.random.default_rng(0),
    )  # fmt: skip
    assert found.cost < 0.05
