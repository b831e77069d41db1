"""The controller, its tuning and the speed profiles."""

from itertools import pairwise
import math

from hypothesis import given
from hypothesis import strategies as st
import pytest

from motor_sysid.control.pid import Pid, PidGains
from motor_sysid.control.profile import Profile, PROFILES
from motor_sysid.control.tuning import reduce_to_speed, speed_pi
from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model
from motor_sysid.physics.stepper import Stepper

DT = 0.002
finite = st.floats(-1e3, 1e3)


def test_proportional_and_integral_add_up() -> None:
    pid = Pid(PidGains(kp=2.0, ki=10.0))
    assert pid.step(1.0, 0.0, 0.1) == pytest.approx(2.0 + 1.0)
    assert pid.step(1.0, 0.0, 0.1) == pytest.approx(2.0 + 2.0)


@given(st.lists(st.tuples(finite, finite), min_size=1, max_size=50))
def test_output_never_leaves_its_limits(samples: list[tuple[float, float]]) -> None:
    pid = Pid(PidGains(3.0, 50.0, 0.1, 0.01, lower=-5.0, upper=7.0))
    for reference, measurement in samples:
        assert -5.0 <= pid.step(reference, measurement, DT) <= 7.0


def test_integral_does_not_wind_up_while_the_output_is_limited() -> None:
    pid = Pid(PidGains(1.0, 10.0, lower=-1.0, upper=1.0))
    for _ in range(10_000):
        assert pid.step(100.0, 0.0, DT) == 1.0
    assert pid.step(-0.5, 0.0, DT) < 0.5, 'a wound-up integral would hold the output at its limit'


def test_derivative_acts_on_the_measurement_alone() -> None:
    pid = Pid(PidGains(kp=0.0, kd=1.0))
    pid.step(0.0, 0.0, DT)
    assert pid.step(1000.0, 0.0, DT) == 0.0
    assert pid.step(1000.0, 0.1, DT) == pytest.approx(-0.1 / DT)


def test_derivative_filter_has_its_time_constant() -> None:
    pid = Pid(PidGains(kp=0.0, kd=1.0, derivative_filter=0.1))
    slopes = [-pid.step(0.0, 3.0 * k * DT, DT) for k in range(500)]
    k63 = next(k for k, slope in enumerate(slopes) if slope > 3.0 * (1 - math.exp(-1)))
    assert k63 * DT == pytest.approx(0.1, rel=0.05)


def test_new_gains_make_no_jump() -> None:
    pid = Pid(PidGains(1.0, 5.0))
    for _ in range(100):
        before = pid.step(1.0, 1.0 - 1e-9, DT)
    pid = pid.with_gains(PidGains(1.0, 50.0))
    assert pid.step(1.0, 1.0 - 1e-9, DT) == pytest.approx(before, abs=1e-6)


def test_bad_input_is_refused_with_its_value() -> None:
    with pytest.raises(UserError, match='dt = 0'):
        Pid(PidGains(1.0)).step(0.0, 0.0, 0.0)
    with pytest.raises(UserError, match='3 to 1'):
        PidGains(1.0, lower=3.0, upper=1.0)
    with pytest.raises(UserError, match='-1'):
        PidGains(1.0, derivative_filter=-1.0)


def test_tuned_loop_follows_with_the_wanted_time_constant() -> None:
    model = Model.base('brushed_dc', {'R': 2.0, 'L': 5e-3, 'k_t': 0.05, 'J': 5e-5, 'b': 2e-5})
    pid, stepper = Pid(speed_pi(model, 0.03, 24.0)), Stepper(model, DT)
    speeds = []
    for _ in range(500):
        speeds.append(stepper.outputs['speed'])
        stepper.step(pid.step(50.0, speeds[-1], DT))
    assert speeds[-1] == pytest.approx(50.0, rel=1e-3)
    assert max(speeds) < 1.15 * 50.0
    k63 = next(k for k, speed in enumerate(speeds) if speed > 50.0 * (1 - math.exp(-1)))
    assert 0.5 * 0.03 < k63 * DT < 2 * 0.03


def test_reduction_is_the_step_response_without_inductance() -> None:
    model = Model.base('brushed_dc', {'R': 2.0, 'L': 1e-6, 'k_t': 0.05, 'J': 5e-5, 'b': 2e-5})
    plant, stepper = reduce_to_speed(model), Stepper(model, 1e-3)
    for _ in range(round(plant.time_constant / 1e-3)):
        stepper.step(1.0)
    assert stepper.outputs['speed'] == pytest.approx(plant.gain * (1 - math.exp(-1)), rel=0.02)


def test_reduction_of_motors_without_current() -> None:
    axis = reduce_to_speed(Model.base('mechanical_axis', {'J': 4.0, 'b': 0.5, 'gain': 3.0}))
    assert (axis.gain, axis.time_constant) == pytest.approx((6.0, 8.0))
    motor = reduce_to_speed(Model.base('brushed_dc_reduced', {'k_v': 0.05, 'k_a': 1e-3}))
    assert (motor.gain, motor.time_constant) == pytest.approx((20.0, 0.02))


@pytest.mark.parametrize('name', PROFILES)
def test_profile_rests_at_both_ends_turns_both_ways_and_keeps_its_limit(name: str) -> None:
    profile = Profile(name, 200.0, 20.0)
    values = [profile(k * 0.001) for k in range(-1000, 22_000)]
    assert values[0] == values[-1] == profile(0.0) == profile(19.999) == 0.0
    assert 0.3 * 200 < max(values) <= 200.0
    assert -200.0 <= min(values) < -0.3 * 200


def test_mixed_profile_excites_what_a_diagnosis_needs() -> None:
    profile = Profile('mixed', 200.0, 20.0)
    values = [profile(k * 0.002) for k in range(10_000)]
    reversals = sum(a * b < 0 for a, b in pairwise(values))
    crawling = sum(0 < abs(v) < 0.08 * 200 for v in values) * 0.002
    assert reversals >= 20
    assert crawling > 1.0
    assert len({round(v) for v in values if v}) > 100


def test_unknown_profile_is_refused_with_those_that_exist() -> None:
    with pytest.raises(UserError, match='mixed'):
        Profile('wobble', 1.0, 1.0)
    with pytest.raises(UserError, match='positive'):
        Profile('mixed', 1.0, 0.0)
