"""A drop with the sign of the current, between samples that are long beside the motor's times."""

import numpy as np

from motor_sysid.diagnosis import refit
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

IDLE = {'R': 1.2, 'L': 3.3e-4, 'k_t': 0.041, 'J': 2.3e-5, 'b': 6e-6, 'i_eps': 1e-4}
DT, COUNT = 5e-3, 1600


def idle_motor() -> Record:
    """Return a motor without load: a drop of an eighth of the voltage is thirty times R i."""
    rng = np.random.default_rng(3)
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


def test_a_fit_slides_down_from_a_wide_sign_of_the_current(monkeypatch):
    record = idle_motor()

    def fitted():
        return fit_model([record], motor='brushed_dc', effects=['brush_voltage_drop'])

    found = fitted()
    monkeypatch.setattr(refit, 'WIDE', ())
    stuck = fitted()
    assert found.validation.error_percent < 0.5 * stuck.validation.error_percent
    assert abs(found.model['brush_voltage_drop.v_b'] - 3.0) < 0.01
    assert abs(found.model['R'] - IDLE['R']) < 0.02 * IDLE['R']
