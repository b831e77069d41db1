"""A drop with the sign of the current, between samples that are long beside the motor's times."""

import numpy as np

from motor_sysid.diagnosis.fitting import bench_of, fit_model
from motor_sysid.diagnosis.search.refit import rough_fit, ROUGH_STEPS, slid
from motor_sysid.diagnosis.search.rung import climb
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

IDLE = {'R': 1.2, 'L': 3.3e-4, 'k_t': 0.041, 'J': 2.3e-5, 'b': 6e-6, 'i_eps': 1e-4}
DT, COUNT = 5e-3, 1600


def idle_motor(seed: int) -> Record:
    """Return a motor without load: a drop of an eighth of the voltage is thirty times R i."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(COUNT)
    triangle = 24 * (2 * np.abs(2 * ((t / 3) % 1) - 1) - 1)
    steps = np.repeat(rng.uniform(-20, 20, COUNT // 40 + 1), 40)[:COUNT]
    volts = np.where(t < 4.0, triangle, steps)
    truth = Model.base('brushed_dc', IDLE).with_effect('brush_voltage_drop', {'v_b': 3.0})
    drive = Record(t, {'voltage': volts}, {'voltage': 'V'})
    run = simulate(truth, drive, follow_position=False, substeps=64).outputs
    signals = {
        'voltage': volts,
        'current': run['current'] + 2e-3 * rng.normal(size=COUNT),
        'speed': run['speed'] + 1.0 * rng.normal(size=COUNT),
    }
    return Record(t, signals, {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'})


def test_a_narrow_sign_of_the_current_is_fitted_from_a_wide_one():
    """Of six motors all within 5 %; directly, five were off by more when this was written."""
    off = {'directly': 0, 'from a wide sign': 0}
    for seed in range(3, 9):
        bench, linear = bench_of([idle_motor(seed)], [], None, 'brushed_dc', {}, 0.2)
        base = climb(linear, bench)
        names = [p.name for p in base.model.parameters.free]
        model = base.model.with_effect('brush_voltage_drop', {'v_b': 1.0}, bench.scales)
        model = model.with_free([*names, 'brush_voltage_drop.v_b']).with_values({'i_eps': 2e-4})
        fits = {
            'directly': rough_fit(model, base.result.weighting, bench, ROUGH_STEPS),
            'from a wide sign': slid(model, base.result.weighting, bench),
        }
        for way, found in fits.items():
            off[way] += abs(found.model['brush_voltage_drop.v_b'] - 3.0) > 0.15
    assert off['from a wide sign'] == 0
    assert off['directly'] >= 2


def test_the_drop_is_found_with_all_that_a_fit_does():
    found = fit_model([idle_motor(3)], motor='brushed_dc', effects=['brush_voltage_drop'])
    assert abs(found.model['brush_voltage_drop.v_b'] - 3.0) < 0.01
    assert abs(found.model['R'] - IDLE['R']) < 0.02 * IDLE['R']
