"""A short time that makes nearly all of an error is told; what goes on all the time is not."""

import numpy as np
import pytest

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.diagnosis.where.spell import spell_of
from motor_sysid.signals.record import Provenance, Record

COUNT, DT = 4000, 1e-3
ONES = np.ones(2)


class Stretch:
    """A scored stretch of data that begins at 10 s."""

    scored, scored_from = True, 0

    def __init__(self, source: str):
        time = 10.0 + DT * np.arange(COUNT)
        self.record = Record(time, {'voltage': 0 * time}, {'voltage': 'V'}, Provenance(source))


def side(*errors: np.ndarray, name: str):
    """Return a comparison of two outputs with noise of 1 and further errors in the first."""
    rng = np.random.default_rng(7)
    residuals = tuple(rng.standard_normal((COUNT, 2)) + np.outer(e, [1.0, 0.0]) for e in errors)
    measured = tuple(np.ones((COUNT, 2)) for _ in errors)
    chains = [(Stretch(f'{name}{k}'),) for k in range(len(errors))]
    return Comparison(5.0, {}, (), residuals, measured), chains


def bump(first: int, last: int, size: float) -> np.ndarray:
    error = np.zeros(COUNT)
    error[first:last] = size
    return error


@pytest.mark.parametrize(('name', 'held'), [('train', False), ('held', True)])
def test_the_time_of_a_short_one_is_told(name, held):
    """Of the worst record, whichever it is; to a few samples."""
    still, burst = np.zeros(COUNT), bump(1500, 1600, 30.0)
    sides = [side(still, still if held else burst, name='train'), side(burst if held else still,
                                                                       name='held')]  # fmt: skip
    found = spell_of(sides, ONES)
    assert found is not None
    assert found.source == f'{name}{0 if held else 1}'
    assert found.begins == pytest.approx(11.5, abs=0.01)
    assert found.ends == pytest.approx(11.6, abs=0.01)
    assert found.share > 0.95
    assert 'between 11.5 and 11.6 s' in str(found)


@pytest.mark.parametrize(
    'error',
    [np.zeros(COUNT), bump(0, COUNT, 5.0), bump(1000, 1800, 10.0),
     10 * np.sin(np.arange(COUNT) / 50), bump(1500, 1502, 3.0)],
)  # fmt: skip
def test_what_lasts_is_none(error):
    """Nor noise alone, nor what is too small to matter."""
    assert spell_of([side(error, name='train'), side(np.zeros(COUNT), name='held')], ONES) is None


def test_short_records_tell_none():
    comparison, chains = side(bump(10, 20, 30.0), name='train')
    short = Comparison(5.0, {}, (), (comparison.residuals[0][:200],), (np.ones((200, 2)),))
    assert spell_of([(short, chains)], ONES) is None
