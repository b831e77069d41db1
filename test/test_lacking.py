"""Effects that get a turn because their laws follow what the equations lack."""

from dataclasses import replace

from bench_motor import a_motor, measure, voltage_profile
import numpy as np
import pytest

from motor_sysid.diagnosis.fitting import bench_of
from motor_sysid.diagnosis.search.lacking import following, MOST
from motor_sysid.diagnosis.search.rounds import scored
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.physics.effects import catalogue

MADE_UP = 1e-3
"""Amplitudes of scores that tell nothing, in units of the truth."""


def fitted(effects, seed=5):
    """Return the linear fit of a motor with effects, its bench, and scores of the catalogue."""
    rng = np.random.default_rng(seed)
    truth = a_motor(effects)
    records = [measure(truth, voltage_profile(k, 8.0, rng), rng) for k in ('steps', 'triangle')]
    bench, linear = bench_of(records[:1], records[1:], None, 'brushed_dc', {}, 0.2)
    rung = climb(linear, bench)
    return rung, bench, scored(rung, bench, list(catalogue().values()), lambda _: None).singles


@pytest.mark.parametrize(
    ('key', 'values'),
    [
        ('quadratic_drag', {'k_d': 2e-7}),
        ('coulomb_friction', {'tau_c': 2e-3}),
        ('brush_voltage_drop', {'v_b': 0.5}),
    ],
)
def test_the_law_that_is_missing_follows_what_the_equations_lack(key, values):
    """Whatever the scores say of it: they are made to tell next to nothing here."""
    rung, bench, singles = fitted({key: values})
    (name, truth), = values.items()
    useless = [
        replace(one, gain=0.0, delta_bic=-9.0, amplitudes={name: MADE_UP * truth})
        for one in singles if one.variant.effect.key == key
    ]  # fmt: skip
    others = [one for one in singles if one.variant.effect.key != key]
    starts = following(rung, bench, useless + others, set())
    assert len(starts) <= MOST
    first = starts[0][0]
    assert first.variant.effect.key == key
    assert first.amplitudes[name] == pytest.approx(truth, rel=0.25)
    assert starts[0][1].amplitudes[name] == MADE_UP * truth, 'the score has its start as well'
    assert key not in {one[0].variant.effect.key for one in following(rung, bench, singles, {key})}


def test_a_complete_motor_gives_nobody_a_turn():
    rung, bench, singles = fitted({})
    assert following(rung, bench, singles, set()) == []


def test_no_effect_follows_with_a_sign_that_is_impossible():
    """What helps the motion is no friction, however well it follows."""
    rung, bench, singles = fitted({'coulomb_friction': {'tau_c': 2e-3}})
    mine = [one for one in singles if one.variant.effect.key == 'coulomb_friction']
    assert following(rung, bench, mine, set())
    count = len(rung.training.predictions)
    predicted = (*rung.training.predictions, *rung.validation.predictions)
    pairs = zip(bench.records, predicted, strict=True)
    turned = tuple({name: 2 * r[name] - p[name] for name in p} for r, p in pairs)
    helped = replace(
        rung,
        training=replace(rung.training, predictions=turned[:count]),
        validation=replace(rung.validation, predictions=turned[count:]),
    )
    assert following(helped, bench, mine, set()) == []
