"""Effects hidden in three-phase drives in closed loop are named, and nothing is where nothing is.

The simulator is the independent one; its dead time, saturation and cogging are not written as the
package's laws are.
"""

import numpy as np
import pytest
from three_phase_records import bldc_record, pmsm_record, PMSM_SHEETS

from motor_sysid.benchmark.three_phase_cases import draw
from motor_sysid.diagnosis import diagnose, Diagnosis, Verdict
from motor_sysid.signals.record import Record

HIDDEN = {
    'coulomb_friction': ({'tau_c': 2e-3}, {'tau_c': (2e-3, 0.05)}),
    'inverter_dead_time': ({'dead': 0.35}, {'v_d': (0.35, 0.1)}),
    'cogging_torque': (
        {'cogging': 2e-3, 'order': 24.0}, {'b_1': (2e-3, 0.05), 'n': (24.0, 0.0)}
    ),
    'inductance_saturation': ({'soft': 0.6, 'i_soft': 1.5}, {}),
    'emf_harmonics': (
        {'fifth': 0.06, 'seventh': -0.03}, {'k_5': (0.06, 0.05), 'k_7': (-0.03, 0.05)}
    ),
}  # fmt: skip
"""Numbers of the true motor; parameters with their relative tolerance."""

pytestmark = [pytest.mark.slow, pytest.mark.timeout(400)]


def diagnosed(kind: str, first: int = 1, **hidden: float) -> Diagnosis:
    """Return what is said of two records, with the whole catalogue to choose from."""
    pair = [
        pmsm_record(4.0, seed=seed, **hidden)[1] if kind == 'pmsm'
        else bldc_record(1.5, seed=seed, **hidden)[1]
        for seed in (first, first + 1)
    ]  # fmt: skip
    return diagnose(pair[:1], pair[1:], motor=kind, nominal={'pole_pairs': 4.0})


@pytest.mark.parametrize('key', HIDDEN)
def test_it_is_named_in_a_pmsm(key):
    hidden, parameters = HIDDEN[key]
    found = diagnosed('pmsm', **hidden)
    assert found.verdict is Verdict.EFFECT_MISSING
    assert found.effects == (key,)
    assert found.steps[-1].validation_error_percent < 1.5 * found.noise_floor_percent
    for name, (value, tolerance) in parameters.items():
        assert found.model[f'{key}.{name}'] == pytest.approx(value, rel=tolerance), name


@pytest.mark.parametrize('seed', [1, 3, 5])
@pytest.mark.parametrize('kind', ['pmsm', 'bldc'])
def test_a_complete_drive_is_called_complete(kind, seed):
    assert diagnosed(kind, seed).verdict is Verdict.COMPLETE


@pytest.mark.parametrize('key', HIDDEN)
def test_it_is_named_in_a_bldc(key):
    hidden, parameters = HIDDEN[key]
    found = diagnosed('bldc', **hidden)
    assert found.verdict is Verdict.EFFECT_MISSING
    assert found.effects == (key,)
    for name, (value, tolerance) in parameters.items():
        assert found.model[f'{key}.{name}'] == pytest.approx(value, rel=tolerance), name


def test_an_angle_that_the_drive_knows_late_is_named():
    case = draw('pmsm/rotor_angle_lag/10/0', 12)
    found = diagnose(case.train, case.valid, motor=case.motor, nominal=case.nominal)
    assert found.effects == ('rotor_angle_lag',)
    assert found.model['rotor_angle_lag.lag'] == pytest.approx(case.hidden.angle_lag, rel=0.01)


def test_a_voltage_that_acts_late_is_told_from_an_angle_that_is():
    case = draw('pmsm/voltage_angle_lag/10/0', 12)
    found = diagnose(case.train, case.valid, motor=case.motor, nominal=case.nominal)
    assert found.effects == ('voltage_angle_lag',)
    lag = found.model['voltage_angle_lag.lag']
    assert lag == pytest.approx(case.hidden.voltage_lag, rel=0.01)


@pytest.mark.parametrize(
    ('drive', 'named'),
    [
        ({}, ()),
        ({'computes': True, 'ahead': 1.5}, ('input_delay',)),
        ({'computes': True, 'ahead': 0.0}, ('voltage_angle_lag', 'input_delay')),
    ],
)
def test_what_a_drive_does_with_its_time_at_its_own_rate(drive, named):
    """Measured every 100 us; applied at once or a period later, with the angle predicted or not.

    The rotor turns by up to 0.14 rad in a period.
    """
    machine = PMSM_SHEETS[1].machine
    records = [
        pmsm_record(2.0, 1e-4, seed=seed, top=350.0, push_d=0.7, machine=machine, **drive)[1]
        for seed in (1, 2)
    ]
    found = diagnose(records[:1], records[1:], motor='pmsm', nominal={'pole_pairs': 4.0})
    assert found.effects == named
    truth = {'voltage_angle_lag': ('lag', 150e-6), 'input_delay': ('delay', 100e-6)}
    for key in named:
        name, value = truth[key]
        assert found.model[f'{key}.{name}'] == pytest.approx(value, rel=0.02), key


def test_a_salient_motor_beside_the_recorded_axis_is_complete_and_told_so():
    """Seen from axes 8 electrical degrees ahead of those of the magnet."""
    case, angle = draw('pmsm/complete/1', 12), np.radians(8.0)

    def turned(record: Record) -> Record:
        for kind in ('voltage', 'current'):
            d, q = record[f'{kind}_d'], record[f'{kind}_q']
            unit = record.units[f'{kind}_d']
            record = record.with_signal(
                f'{kind}_d', np.cos(angle) * d + np.sin(angle) * q, unit
            ).with_signal(f'{kind}_q', np.cos(angle) * q - np.sin(angle) * d, unit)
        return record

    train, valid = [turned(r) for r in case.train], [turned(r) for r in case.valid]
    found = diagnose(train, valid, motor=case.motor, nominal=case.nominal)
    assert found.verdict is Verdict.COMPLETE
    assert any('8 electrical degrees behind' in line for line in found.reasons)
