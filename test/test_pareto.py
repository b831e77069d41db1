"""NSGA-II: sorting by hand, the published distance to a known front, and the docs' example."""

from pathlib import Path
import re

import numpy as np
import pytest

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.optimizers.nsga2 import fronts, loneliness, pareto

PAGE = (Path(__file__).resolve().parent.parent / 'docs' / 'optimizers.md').read_text()


def test_fronts_and_loneliness_by_hand():
    costs = np.array([[1, 5], [2, 3], [4, 1], [3, 4], [5, 5], [2, 3]], dtype=float)
    assert fronts(costs).tolist() == [0, 0, 0, 1, 2, 0]
    lonely = loneliness(costs[:3], np.zeros(3, dtype=int))
    assert np.isinf(lonely[[0, 2]]).all()
    assert lonely[1] == pytest.approx(2.0)


def zdt1(x):
    g = 1 + 9 * x[:, 1:].mean(axis=1)
    return np.column_stack([x[:, 0], g * (1 - np.sqrt(x[:, 0] / g))])


def test_it_is_as_close_to_a_known_front_as_published():
    """Deb et al. 2002, Table II: mean distance 0.0335 with 25 000 evaluations in 30 dimensions."""
    front = pareto(zdt1, np.zeros(30), np.ones(30), population=100, iterations=250,
                   rng=np.random.default_rng(0))  # fmt: skip
    assert front.evaluations == 25_000
    distance = np.mean(front.costs[:, 1] - (1 - np.sqrt(front.costs[:, 0])))
    assert 0 <= distance < 0.0335
    assert np.max(np.diff(front.costs[:, 0])) < 0.1
    assert len(front.x) > 80


def test_same_seed_same_front_and_holes_do_no_harm():
    def holes(x):
        costs = zdt1(x)
        costs[x[:, 0] > 0.5] = np.nan
        return costs

    one, two = (
        pareto(holes, np.zeros(4), np.ones(4), iterations=40, rng=np.random.default_rng(3))
        for _ in range(2)
    )
    assert np.array_equal(one.x, two.x)
    assert np.all(np.isfinite(one.costs))
    assert np.max(one.x[:, 0]) <= 0.5
    assert len(np.flatnonzero(fronts(one.costs) == 0)) == len(one.costs)


def test_bad_questions():
    rng = np.random.default_rng(0)
    with pytest.raises(UserError, match='finite'):
        pareto(zdt1, np.zeros(2), np.array([1.0, np.inf]), rng=rng)
    with pytest.raises(UserError, match='give 4'):
        pareto(zdt1, np.zeros(2), np.ones(2), population=2, rng=rng)


def test_the_examples_of_the_page_run(capsys):
    for block in re.findall(r'```python\n(.*?)```', PAGE, flags=re.DOTALL):
        names = {}
        exec(compile(block, 'optimizers.md', 'exec'), names)
    front = names['front']
    assert front.costs.shape[1] == 3
    complete = front.x[front.costs[:, 2] == 2]
    best = complete[0]
    assert best[:2] == pytest.approx([0.02, 3e-4], rel=0.1)
    assert front.costs[0, 0] < 0.002
    assert capsys.readouterr().out
