"""What one round of a diagnosis tries."""

from dataclasses import replace
from types import SimpleNamespace

from bench_motor import MOTOR, records
import numpy as np
import pytest

from motor_sysid.diagnosis.rounds import unpromised
from motor_sysid.diagnosis.score import score, Scored, Scores
from motor_sysid.diagnosis.setup import make_bench
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor


def a_score(key, delta_bic, *, finite):
    """Return what scoring found of an effect, which a finite trial or a derivative told."""
    free = () if finite else ('some amplitude',)
    model = SimpleNamespace(parameters=SimpleNamespace(free=free))
    variant = SimpleNamespace(effect=effect(key), model=model, inherits=False)
    return Scored(variant, delta_bic, delta_bic, {}, True, 0.0)


def test_where_nothing_passes_finite_trials_get_a_turn_whatever_their_score():
    singles = [
        a_score('quadratic_drag', 50.0, finite=False), a_score('input_delay', 9.0, finite=True),
        a_score('coulomb_friction', 8.0, finite=False),
        a_score('current_sensor_lag', -5.0, finite=True),
        a_score('current_sensor_lag', -7.0, finite=True),
    ]  # fmt: skip
    found = unpromised(Scores(singles, [], None), {'quadratic_drag', 'input_delay'})
    assert [[one.delta_bic for one in starts] for starts in found] == [[-5.0, -7.0]]


def test_a_start_that_is_off_is_no_noise():
    moving = [one.slice(300, 2000) for one in records({}, seconds=3.0)]
    bench = make_bench(moving, [], motor('brushed_dc'))
    problem = bench.problem(Model.base('brushed_dc', MOTOR))
    rng, z = np.random.default_rng(4), problem.vector()
    near = []
    for one in problem.linearize(z):
        assert one.start.shape[2] > 0
        off = one.start @ np.full(one.start.shape[2], 1e3)
        near.append(replace(one, residual=off + 0.1 * rng.normal(size=one.residual.shape)))
    assert score(problem, z, [], near).weighting.sigma == pytest.approx(0.1, rel=0.1)
