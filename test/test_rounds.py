"""What one round of a diagnosis tries."""

from types import SimpleNamespace

from motor_sysid.diagnosis.rounds import unpromised
from motor_sysid.diagnosis.score import Scored, Scores
from motor_sysid.physics.effects import effect


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
