"""Parts of a recording keep its clock: what comes in time comes when it does."""

import numpy as np
import pytest
from simulated_axis import AXIS, axis

from motor_sysid.diagnosis.candidates.columns import columns
from motor_sysid.diagnosis.candidates.left_noise import left_noise
from motor_sysid.diagnosis.candidates.variants import variants
from motor_sysid.diagnosis.fitting import bench_of
from motor_sysid.diagnosis.search.lacking import _columns
from motor_sysid.diagnosis.search.rung import climb, profile_cost, slopes
from motor_sysid.diagnosis.where.unexplained import lack_of
from motor_sysid.effort import counted_by, Effort
from motor_sysid.estimation.batch import white
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.effects import effect
from motor_sysid.physics.motors import motor
from motor_sysid.physics.scales import scales_of
from motor_sysid.physics.simulate import simulate

STEP = AXIS.with_effect('load_torque_step', {'tau_l': 0.2, 't_on': 4.0})


def test_parts_keep_the_clock_of_their_recording_and_recordings_have_their_own():
    whole = axis(6.0)
    part = whole.slice(1000, 6000).slice(2000, 4000)
    assert part.lead == pytest.approx(3.0)
    assert part.clock[[0, -1]] == pytest.approx([3.0, 4.999])
    assert Drive.of(part, motor('mechanical_axis')).start == pytest.approx(3.0)
    rows = np.r_[0:1000, 3000:6000]
    gap = type(whole)(whole.time[rows], {'speed': whole['speed'][rows]}, whole.units)
    assert [one.lead for one in gap.segments(0.1)] == [0.0, 0.0]
    assert scales_of('mechanical_axis', AXIS.parameters.values(), [part]).duration == (
        pytest.approx(4.999)
    )


def test_a_load_that_comes_at_4_s_acts_on_a_part_from_3_s_as_on_the_whole():
    whole = axis(6.0)
    run = simulate(STEP, whole)
    begun = {'omega': run.outputs['speed'][3000], 'theta': run.outputs['position'][3000]}
    tail = simulate(STEP, whole.slice(3000, 6000), initial=begun)
    assert np.allclose(tail.outputs['speed'], run.outputs['speed'][3000:], atol=1e-9)
    still = simulate(AXIS, whole)
    assert np.max(np.abs(still.outputs['speed'] - run.outputs['speed'])) > 0.1


def test_what_comes_in_time_is_looked_for_when_it_does_on_what_is_held_out():
    """A step at 4 s of a record of 10 s is all of what its last fifth lacks."""
    bench, model = bench_of([axis(10.0)], [], AXIS, None, {}, 0.2)
    rung = climb(model, bench)
    (step, *_) = variants(
        model, bench.scales, [effect('load_torque_step')], {'load_torque_step': [4.0]}
    )
    (force,) = step.effect.laws
    shown = []
    runs = (*rung.training.predictions, *rung.validation.predictions)
    for record, run in zip(bench.records, runs, strict=True):
        shown.append(np.abs(_columns(step, force, lack_of(model, record, run), record)))
    assert [np.mean(one) for one in shown] == pytest.approx([0.5, 1.0], abs=0.01)


def test_steps_that_scoring_takes_count_as_effort():
    bench, model = bench_of([axis(6.0)], [], AXIS, None, {}, 0.2)
    some = [effect(key) for key in ('coulomb_friction', 'stribeck_friction', 'flexible_shaft')]
    tried = list(variants(model, bench.scales, some, {}))
    effort = Effort()
    with counted_by(effort):
        columns(bench.problem(model), tried)
    assert effort.steps > len(tried) * sum(map(len, bench.records)) / 2


def test_a_true_model_leaves_noise_and_no_less_over_short_looks():
    """Of 160 looks of 100 rows 12 rows each, and the starts, tell nothing.

    One seed of 200 would leave 3 % more or less.
    """
    bench, model = bench_of([axis(20.0, names=('torque', 'position'))], [], AXIS, None, {}, 0.2)
    rung = climb(model, bench)
    problem, near = bench.problem(rung.model), slopes(rung, bench)
    assert len(near) > 50
    raw = [np.concatenate((one.residual[:, :, np.newaxis], one.slope), axis=2) for one in near]
    plain = white([problem.settled(one, white([one.residual])) for one in near])
    weighting = left_noise(problem, raw, [one.start for one in near], plain)
    cost, rows = profile_cost(rung, bench, weighting)
    assert rows < 0.9 * sum(one.residual.size for one in near)
    assert cost / rows == pytest.approx(1.0, abs=0.03)
