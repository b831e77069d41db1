"""Where fits begin of effects of which a touch tells little: at the best of a grid."""

from dataclasses import replace

from bench_motor import a_motor, measure, voltage_profile
import numpy as np
import pytest

from motor_sysid.diagnosis.candidates.score import Scored
from motor_sysid.diagnosis.fitting import bench_of
from motor_sysid.diagnosis.search import grid_starts, refit
from motor_sysid.diagnosis.search.grid_starts import BEST, starts_on_grid
from motor_sysid.diagnosis.search.refit import try_effect
from motor_sysid.diagnosis.search.rounds import scored
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.diagnosis.search.trial import Level
from motor_sysid.physics.effects import catalogue, effect

HIDDEN = {
    'flexible_shaft': {'r': 1.2, 'w_a': 260.0, 'z': 0.04},
    'backlash': {'r': 1.0, 'phi_g': 0.02, 'w_a': 600.0, 'z': 0.2},
}
GRIDS = [(key, grid) for key, one in catalogue().items() for grid in one.card.grids]


def level_of(key: str):
    """Return a bench with that hidden, its base level, and the variants of the effect."""
    rng = np.random.default_rng(7)
    truth = a_motor({key: HIDDEN[key]}).with_values({'J': 1.3e-5})
    records = [measure(truth, voltage_profile(k, 8.0, rng), rng) for k in ('steps', 'triangle')]
    bench, linear = bench_of(records[:1], records[1:], None, 'brushed_dc', {}, 0.2)
    rung = climb(linear, bench)
    scores = scored(rung, bench, [effect(key)], lambda _: None)
    return bench, Level.of(rung, bench, scores.weighting), scores.singles


@pytest.mark.parametrize('key', dict(GRIDS))
def test_the_fit_from_the_grid_finds_what_is_hidden(key):
    bench, level, variants = level_of(key)
    points = starts_on_grid(variants[0].variant, level.rung.model, bench)
    assert 0 < len(points) <= BEST
    near = points[0]
    for name in ('r', 'w_a'):
        assert 1 / 3 < near[f'{key}.{name}'] / HIDDEN[key][name] < 3
    assert near['J'] * (1 + near[f'{key}.r']) == pytest.approx(level.rung.model['J'])
    trial = try_effect(variants, level, bench)
    assert trial.passes
    for name, value in HIDDEN[key].items():
        assert trial.rung.model[f'{key}.{name}'] == pytest.approx(value, rel=0.05)


def test_an_effect_without_a_grid_has_no_such_starts():
    bench, level, _ = level_of('flexible_shaft')
    other = scored(level.rung, bench, [effect('coulomb_friction')], lambda _: None).singles[0]
    assert starts_on_grid(other.variant, level.rung.model, bench) == []


def test_what_the_touch_calls_impossible_is_tried_from_the_grid():
    """A touch swings elsewhere, and may ask for less inertia than none behind the shaft."""
    bench, level, variants = level_of('flexible_shaft')

    def impossible(one: Scored) -> Scored:
        return Scored(one.variant, one.gain, one.delta_bic, {'r': 0.0}, False, one.overlap)

    trial = try_effect([impossible(one) for one in variants], level, bench)
    assert trial.passes
    assert trial.rung.model['flexible_shaft.r'] == pytest.approx(1.2, rel=0.05)


@pytest.mark.parametrize(
    ('cost', 'evidence', 'asked'), [(1.02, 0.9, False), (1.02, 1.1, True), (1.05, 0.9, True)]
)
def test_a_grid_is_tried_where_something_is_missing(monkeypatch, cost, evidence, asked):
    """The noise model may have taken it for noise; the evidence of a touch tells of it then."""
    bench, level, variants = level_of('flexible_shaft')
    level = replace(level, cost=cost * level.rows)
    touch = replace(variants[0], delta_bic=evidence * bench.threshold)
    points = []
    monkeypatch.setattr(refit, 'starts_on_grid', lambda *_: points.append(1) or [])
    refit.try_roughly([touch], level, bench)
    assert bool(points) is asked


@pytest.mark.parametrize(('key', 'grid'), GRIDS)
def test_a_grid_is_of_the_cards_own_parameters_and_inside_their_boxes(key, grid):
    card = catalogue()[key].card
    own = {p.name: p for p in card.parameters}
    assert set(grid) <= set(own)
    assert card.amplitudes[0].name in grid, 'at none of it there is nothing to try'
    for name, values in grid.items():
        low = getattr(own[name], 'lower', 0.0)
        high = getattr(own[name], 'upper', getattr(own[name], 'limit', None))
        if name in card.slows.values():
            assert all(0 <= share < 1 for share in values)
        else:
            assert all(low < value <= high for value in values)
        assert list(values) == sorted(set(values))


def test_the_boxes_of_a_special_case_hold_those_of_the_wider_law():
    """What a fit of it finds must fit into the special case that is tried in its place."""
    for one in catalogue().values():
        mine = {s.name: s for s in one.card.shapes}
        for special, pairs in one.card.generalises.items():
            theirs = {s.name: s for s in effect(special).card.shapes}
            shared = [(mine[m], theirs[t]) for m, t in pairs if m in mine and t in theirs]
            for wide, narrow in shared:
                assert wide.scale is narrow.scale
                assert narrow.lower <= wide.lower
                assert wide.upper <= narrow.upper


@pytest.mark.parametrize(('gone', 'left'), [((), 1), ((0,), 1), (None, 0)])
def test_a_start_that_runs_away_is_none(monkeypatch, gone, left):
    bench, level, variants = level_of('flexible_shaft')
    right = grid_starts._runs

    def runaway(*args):
        runs = right(*args)
        for run in runs:
            run[-1, :, slice(None) if gone is None else list(gone)] = np.nan
            run[-2, :, slice(None) if gone is None else list(gone)] = 1e200
        return runs

    monkeypatch.setattr(grid_starts, '_runs', runaway)
    found = starts_on_grid(variants[0].variant, level.rung.model, bench)
    assert min(len(found), 1) == left
