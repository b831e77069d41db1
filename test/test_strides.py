"""Fits where a few samples that jump would hold them far above the least error."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from motor_sysid.benchmark.answers import true_base_values, true_effect_values
from motor_sysid.benchmark.cases import draw
from motor_sysid.benchmark.scenarios import named_case
from motor_sysid.diagnosis.search import strides
from motor_sysid.diagnosis.search.bench import make_bench
from motor_sysid.diagnosis.search.rung import climb, judge
from motor_sysid.diagnosis.search.strides import strode
from motor_sysid.estimation.batch import white
from motor_sysid.estimation.batch.least_squares import normal_equations, result_at, Solution
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor

SHARP = 1e-4
"""Width of the sign of current, A: that of a drop which sets in at once."""

OFFSET = 0.0454
"""Of the current sensor, A, as the data have it."""

ASTRAY = {'R': 1.0015, 'L': 1.18, 'J': 0.9987, 'b': 1.09, 'brush_voltage_drop.v_b': 0.9986}
"""Where a fit by derivatives ended, in units of the truth: 15 standard errors off."""


@pytest.fixture(scope='module')
def chattering():
    """Return a bench and the true model: a current that settles in 0.1 ms, sampled every 1 ms."""
    scenario, number = named_case('single/brush_voltage_drop/10/0')
    case = draw(scenario, 7400, number)
    truth = {**true_base_values(case, scenario.effects), **true_effect_values(case)}
    bench = make_bench(case.train, case.valid, motor('brushed_dc'), nominal=truth)
    base = {p.name: truth[p.name] for p in bench.kind.parameters if p.name in truth}
    base |= {**bench.blunt, 'i_eps': SHARP, 'current_offset': OFFSET}
    model = Model.base('brushed_dc', base)
    model = model.with_effect('brush_voltage_drop', {'v_b': truth['brush_voltage_drop.v_b']})
    return replace(bench, substeps=4), model


def at(model, bench):
    """Return a model as it is, as a fit whose noise is what it leaves."""
    problem = bench.problem(model)
    near = tuple(problem.linearize(problem.vector()))
    weighting = white([one.residual for one in near])
    cost = normal_equations(near, weighting)[2]
    solution = Solution(problem.vector(), cost, True, 0, 0, near)
    return judge(result_at(problem, weighting, solution, 0, 0), bench, near)


def test_a_fit_that_jumping_samples_hold_is_led_on_by_strides(chattering):
    bench, true = chattering
    far = at(true.with_values({name: ASTRAY[name] * true[name] for name in ASTRAY}), bench)
    found = strode(far, bench)
    weighting, near = far.result.weighting, far.near
    problem = bench.problem(found.model)
    there, right = (
        problem.costs(bench.problem(m).vector()[np.newaxis], weighting, near)[0]
        for m in (found.model, true)
    )
    assert far.result.cost > right + 300.0
    assert there < right + 20.0
    assert found.model['L'] == pytest.approx(true['L'], rel=0.1)


def test_a_smooth_fit_stays_as_it_is(chattering):
    bench, true = chattering
    smooth = climb(Model.base('brushed_dc', {p.name: true[p.name] for p in bench.kind.parameters}),
                   replace(bench, substeps=1))  # fmt: skip
    assert strode(smooth, replace(bench, substeps=1)) is smooth


@pytest.mark.parametrize(('rough', 'much'), [(True, True), (True, False), (False, True)])
def test_only_what_chatters_and_leaves_much_is_led_on(monkeypatch, rough, much):
    """Two runs of derivatives are worth it only where a fit may be held far from the truth."""
    fit, on = SimpleNamespace(model=None), object()
    monkeypatch.setattr(strides, 'chatters', lambda _: rough)
    monkeypatch.setattr(strides, 'leaves_much', lambda *_: much)
    monkeypatch.setattr(strides, 'strode', lambda *_: on)
    assert strides.freed(fit, None) is (on if rough and much else fit)
