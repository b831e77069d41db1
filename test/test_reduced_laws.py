"""Laws for motors whose current is not measured: those of the whole motor, seen by its speed."""

import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

R, L, K, J = 2.0, 3e-3, 0.05, 5e-5
K_A = R * J / K
DT = 1e-3
REDUCED = motor('brushed_dc_reduced')


def record(seconds: float = 4.0, seed: int = 3) -> Record:
    rng = np.random.default_rng(seed)
    count = round(seconds / DT)
    voltage = np.repeat(rng.uniform(-8, 8, count // 100 + 1), 100)[:count]
    return Record(DT * np.arange(count), {'voltage': voltage}, {'voltage': 'V'})


def speed(model: Model, data: Record) -> np.ndarray:
    return simulate(model, data, substeps=16).outputs['speed']


def whole(key: str, values: dict[str, float], inductance: float = 1e-7) -> Model:
    """Return the motor with its winding, and without viscous friction."""
    base = {'R': R, 'L': inductance, 'k_t': K, 'J': J, 'b': 1e-12, 'omega_eps': 0.5,
            'i_eps': 1e-3}  # fmt: skip
    model = Model.base('brushed_dc', base)
    return model.with_effect(key, values) if key else model


def reduced(key: str, values: dict[str, float]) -> Model:
    model = Model.base('brushed_dc_reduced', {'k_v': K, 'k_a': K_A, 'omega_eps': 0.5})
    return model.with_effect(key, values)


@pytest.mark.parametrize(
    ('key', 'values'),
    [
        ('load_dependent_friction', {'mu': 0.3}),
        ('brush_voltage_drop', {'v_b': 1.0}),
        ('inertia_change', {'g': 0.5, 't_on': 1.5, 'rise': 2e-3}),
        ('inertia_change', {'g': -0.5, 't_on': 1.5, 'rise': 2e-3}),
        ('flexible_shaft', {'r': 0.8, 'w_a': 90.0, 'z': 0.1}),
        ('backlash', {'r': 0.8, 'phi_g': 0.05, 'w_a': 300.0, 'z': 0.3}),
    ],
)
def test_they_are_those_of_a_motor_without_inductance(key, values):
    data = record()
    with_current = speed(whole(key, values), data)
    without = speed(reduced(key, values), data)
    plain = speed(whole('', {}), data)
    effect_of_it = np.sqrt(np.mean((with_current - plain) ** 2))
    assert np.sqrt(np.mean((without - with_current) ** 2)) < 0.03 * effect_of_it


def test_gear_friction_of_an_axis_goes_with_what_drives_it():
    time = DT * np.arange(1000)
    data = Record(time, {'current': np.where(time < 0.5, 2.0, -1.0)}, {'current': 'A'})
    axis = Model.base('mechanical_axis', {'J': 0.5, 'b': 1e-9, 'gain': 3.0, 'omega_eps': 1e-6})
    geared = axis.with_effect('load_dependent_friction', {'mu': 0.2})
    gain = np.diff(simulate(geared, data).outputs['speed']) / DT
    assert gain[400] == pytest.approx((1 - 0.2) * 3.0 * 2.0 / 0.5, rel=1e-4)
    assert gain[700] == pytest.approx(-(1 + 0.2) * 3.0 * 1.0 / 0.5, rel=1e-4)


def test_the_inductance_that_it_adds_is_that_of_the_winding():
    data = record()
    true = speed(whole('', {}, L), data)
    with_it = speed(reduced('armature_inductance', {'t_e': L / R}), data)
    assert np.max(np.abs(with_it - true)) < 1e-4 * np.max(np.abs(true))


def test_only_motors_without_a_measured_current_take_it():
    takes = [key for key in ('brushed_dc', 'brushed_dc_reduced', 'mechanical_axis', 'pmsm', 'bldc')
             if Model.base(key).admits(effect('armature_inductance'))]  # fmt: skip
    assert takes == ['brushed_dc_reduced']


def measured(model: Model, seed: int, noise: float) -> Record:
    data, rng = record(8.0, seed), np.random.default_rng(seed)
    true = speed(model, data)
    return data.with_signal('speed', true + noise * rng.standard_normal(true.size), 'rad/s')


def test_an_inductance_goes_before_a_lag_that_would_do_as_well():
    """No record of voltage and speed tells the two apart; every winding has the first."""
    model = whole('', {}, 1.5e-3)
    train = [measured(model, seed, 0.3) for seed in (1, 2)]
    found = diagnose(train, [measured(model, 3, 0.3)], motor='brushed_dc_reduced')
    assert found.verdict is Verdict.EFFECT_MISSING
    assert found.effects == ('armature_inductance',)
    step = next(s for s in found.steps if s.model.effects)
    assert step.model['armature_inductance.t_e'] == pytest.approx(1.5e-3 / R, rel=0.1)


def test_a_lag_that_no_winding_has_is_that_of_the_sensor():
    model = whole('', {}).with_effect('speed_sensor_lag', {'lag': 20e-3})
    train = [measured(model, seed, 0.3) for seed in (1, 2)]
    found = diagnose(train, [measured(model, 3, 0.3)], motor='brushed_dc_reduced')
    assert found.effects == ('speed_sensor_lag',)


@pytest.mark.slow
def test_gear_friction_is_named_without_a_current():
    model = whole('load_dependent_friction', {'mu': 0.3}).with_effect(
        'gravity_load', {'tau_sin': 0.05, 'tau_cos': 0.0}
    )
    train = [measured(model, seed, 0.3) for seed in (1, 2)]
    found = diagnose(train, [measured(model, 3, 0.3)], motor='brushed_dc_reduced')
    assert {'gravity_load', 'load_dependent_friction'} <= set(found.effects)
    assert found.steps[-1].model['load_dependent_friction.mu'] == pytest.approx(0.3, rel=0.1)
