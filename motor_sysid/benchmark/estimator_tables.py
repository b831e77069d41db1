"""Scores of the online estimators as tables: one row an estimator."""

from collections.abc import Callable, Sequence
from html import escape
import math

import numpy as np

from motor_sysid.benchmark.estimators import Score
from motor_sysid.benchmark.page import section, whole
from motor_sysid.benchmark.perturbations import PERTURBATIONS
from motor_sysid.benchmark.tables import Cell, Table

TITLE = 'Online estimators under perturbations'

_GOOD, _POOR = 0.05, 0.2
_LOADED = 'P2'
_PLAIN = 'P0'


def estimator_tables(scores: Sequence[Score]) -> list[Table]:
    """Return errors, times to converge, and what they cost."""
    return [error_table(scores), settling_table(scores), cost_table(scores)]


def page(scores: Sequence[Score]) -> str:
    """Return the tables as one self-contained page."""
    codes = {one.perturbation for one in scores}
    known = [f'{p.code} {p.title}' for p in PERTURBATIONS if p.code in codes]
    tables = ''.join(map(section, estimator_tables(scores)))
    return whole(TITLE, f'<p>{escape(" · ".join(known))}</p>{tables}')


def error_table(scores: Sequence[Score]) -> Table:
    """Return the error of R, k_t and J by perturbation."""
    return _matrix(
        scores,
        'Error at the end, percent',
        'Largest relative error of R, k_t and J against their present true values, median over '
        'the last second; median over motors.',
        lambda one: one.error,
        _percent,
    )


def settling_table(scores: Sequence[Score]) -> Table:
    """Return the time to converge by perturbation."""
    return _matrix(
        scores,
        'Time to converge, s',
        'From when on R, k_t and J stay within 5 % of their true values, with half a second of '
        'rest at the begin; median over motors, "-" where they do not.',
        lambda one: one.settled,
        _seconds,
    )


def cost_table(scores: Sequence[Score]) -> Table:
    """Return cost, honesty and how the load torque is followed."""
    rows = []
    for key in _keys(scores):
        mine = [one for one in scores if one.estimator == key]
        loaded = [one.load_error for one in mine if one.perturbation == _LOADED]
        plain = [one.surprise for one in mine if one.perturbation == _PLAIN]
        rows.append((
            Cell(key),
            Cell(f'{1e6 * _median([one.cost for one in mine]):.0f}'),
            Cell(f'{_median([one.relative_cost for one in mine]):.2f}'),
            _number(_median(plain), '{:.1f}'),
            _number(100 * _median(loaded), '{:.1f}'),
        ))  # fmt: skip
    return Table(
        'Cost, honesty, load torque',
        'Time per sample, median of turns taken side by side; RMS of error over sigma at the end '
        'without perturbation; RMS of the error of the load torque over the rated one in the last '
        'second, where a load comes on.',
        ('estimator', 'us a sample', 'times rls', 'error / sigma', 'load error %'),
        tuple(rows),
    )


def _matrix(
    scores: Sequence[Score],
    title: str,
    note: str,
    value: Callable[[Score], float],
    cell: Callable[[float], Cell],
) -> Table:
    codes = list(dict.fromkeys(one.perturbation for one in scores))
    rows = []
    for key in _keys(scores):
        cells = [Cell(key)]
        for code in codes:
            mine = [s for s in scores if s.estimator == key and s.perturbation == code]
            cells.append(cell(_median([value(one) for one in mine])))
        if any(one.text for one in cells[1:]):
            rows.append(tuple(cells))
    return Table(title, note, ('estimator', *codes), tuple(rows))


def _keys(scores: Sequence[Score]) -> list[str]:
    return list(dict.fromkeys(one.estimator for one in scores))


def _median(values: Sequence[float]) -> float:
    """Return the median, in which infinite values count as large; NaN if there are none."""
    known = [value for value in values if not math.isnan(value)]
    if not known:
        return math.nan
    middle = np.sort(known)[[(len(known) - 1) // 2, len(known) // 2]]
    return float(middle.mean())


def _percent(value: float) -> Cell:
    if math.isnan(value):
        return Cell('')
    tone = 'good' if value < _GOOD else 'bad' if value > _POOR else 'soft'
    return Cell(f'{100 * value:.2g}' if value < _GOOD else f'{100 * value:.0f}', tone)


def _seconds(value: float) -> Cell:
    if math.isnan(value):
        return Cell('')
    return Cell('-', 'bad') if math.isinf(value) else Cell(f'{value:.1f}')


def _number(value: float, form: str) -> Cell:
    return Cell('' if math.isnan(value) else form.format(value))
