"""What counts where a noise model knows nothing, and where an error is nearly all noise."""

from dataclasses import replace

from bench_motor import records
import pytest
from test_trials import prepared

from motor_sysid.diagnosis.search.gates import NO_EVIDENCE
from motor_sysid.diagnosis.search.rounds import scored
from motor_sysid.diagnosis.search.rung import climb, judge
from motor_sysid.diagnosis.search.starts import best_per_effect
from motor_sysid.diagnosis.search.trial import gain_of_likelihood, judged, Level, searching
from motor_sysid.estimation.batch import Weighting
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import SpeedSensor


def test_what_leaves_only_noise_clears_what_is_more_than_noise_for_certain():
    """All that is left of a variance that was 1.06, 1.2 or 1.5 times the noise, or most of it."""
    for cost, after, clears in (
        (1.06, 1.01, True), (1.2, 1.03, True), (1.2, 1.05, False), (1.04, 1.0, False),
        (1.06, 1.02, False), (1.5, 1.03, True), (1.5, 1.05, False),
    ):  # fmt: skip
        assert Level(None, None, 1000.0 * cost, 1000).clears(1000.0 * after) is clears


def test_what_halves_the_error_is_judged_by_the_noise_of_its_own_errors():
    """A noise model that sees nothing but noise gives no evidence of a friction."""
    data = records({'coulomb_friction': {'tau_c': 6e-3}}, kinds=('steps', 'triangle'))
    bench, rung = prepared(data[:1], SpeedSensor.DIFFERENCE, data[1:])
    new = climb(rung.model.with_effect('coulomb_friction', {'tau_c': 5e-3}, bench.scales), bench)
    assert gain_of_likelihood(rung, rung, bench) == 0.0
    gain = gain_of_likelihood(new, rung, bench)
    assert gain == pytest.approx(-gain_of_likelihood(rung, new, bench))
    assert gain > 1000.0
    starts = best_per_effect(
        scored(rung, bench, [effect('coulomb_friction')], lambda text: None).singles, 1
    )[0]
    deaf = Weighting(1e6 * rung.result.weighting.sigma)
    level = Level.of(rung, bench, deaf)
    assert level.gain(new, bench) < 0.0
    found = judged(starts[0], new, level, bench)
    assert found.passes
    samples = sum(len(one.record) for one in bench.train[0])
    assert found.delta_bic == pytest.approx(
        gain - searching(effect('coulomb_friction'), samples)
    )
    little = rung.model.with_effect('coulomb_friction', {'tau_c': 1e-3}, bench.scales)
    name = 'coulomb_friction.tau_c'
    held = climb(little.with_free([name], free=False), bench).result
    stuck = judge(replace(held, model=held.model.with_free([name])), bench)
    assert stuck.training.error_percent > 0.5 * rung.training.error_percent
    assert judged(starts[0], stuck, level, bench).note == NO_EVIDENCE
