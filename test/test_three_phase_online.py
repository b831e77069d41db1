"""Online estimators on three-phase drives: what is found within two seconds of motion."""

from functools import cache

import numpy as np
import pytest
from three_phase_records import bldc_record, pmsm_record, traction_record

from motor_sysid.benchmark.machine import Machine
from motor_sysid.estimation.online.identifier import OnlineIdentifier
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.signals.record import Record

WRONG = {'R': 1.6, 'L_d': 0.6, 'L_q': 1.5, 'L': 0.6, 'psi_f': 0.7, 'k_e': 0.7, 'J': 1.5, 'b': 2.0}

REGRESSIONS = ('rls', 'rls_directional', 'compound_ls', 'window_ls', 'mras')
COSTLY = ('dual_ekf', 'ukf', 'mhe')
ALL = (*REGRESSIONS, 'ekf', *(pytest.param(key, marks=pytest.mark.slow) for key in COSTLY))

RECORDS = {
    'pmsm': lambda seed: pmsm_record(2.1, seed=seed),
    'traction': lambda seed: traction_record(2.1, seed),
    'bldc': lambda seed: bldc_record(2.1, 2e-4, seed=seed),
}


@cache
def recorded(case: str, seed: int = 1) -> tuple[Machine, Record]:
    return RECORDS[case](seed)


def true_values(kind: str, m: Machine) -> dict[str, float]:
    shared = {'R': m.R, 'J': m.J, 'b': m.b}
    if kind == 'pmsm':
        return shared | {'L_d': m.L_d, 'L_q': m.L_q, 'psi_f': m.k_e / m.pole_pairs}
    return shared | {'L': m.L_d, 'k_e': m.k_e}


@cache
def followed(case: str, estimator: str, seed: int = 1) -> OnlineIdentifier:
    """Return an estimator after two seconds of motion, from values that are far off."""
    truth, record = recorded(case, seed)
    kind = 'bldc' if case == 'bldc' else 'pmsm'
    start = {n: v * WRONG[n] for n, v in true_values(kind, truth).items()}
    model = Model.base(
        kind, {**start, 'pole_pairs': truth.pole_pairs}, speed_sensor=SpeedSensor.DIFFERENCE
    )
    inputs = list(model.kind.inputs[0])
    outputs = [o.signal for o in model.kind.outputs]
    online = OnlineIdentifier(model, estimator, record.dt, inputs, outputs)
    u, y = (np.column_stack([record[n] for n in names]) for names in (inputs, outputs))
    online.update(record.time, u, y)
    return online


@pytest.mark.parametrize('kind', ['pmsm', 'bldc'])
@pytest.mark.parametrize('estimator', ['rls', 'ekf'])
def test_two_seconds_of_motion_are_enough(kind, estimator):
    truth, _ = recorded(kind)
    true, found = true_values(kind, truth), followed(kind, estimator).estimate()
    for name in ('R', 'J', 'psi_f' if kind == 'pmsm' else 'k_e'):
        assert found[name].value == pytest.approx(true[name], rel=0.025), name
        assert found[name].identifiable, name
    for name in ('L_d', 'L_q') if kind == 'pmsm' else ('L',):
        assert found[name].value == pytest.approx(true[name], rel=0.05), name
    mean = np.mean((0.03, -0.02, 0.01)) if kind == 'pmsm' else 0.0
    assert found['current_offset_a'].value == pytest.approx(0.03 - mean, abs=0.01)
    assert found['current_offset_b'].value == pytest.approx(-0.02 - mean, abs=0.01)


def check_all(case: str, estimator: str, seed: int = 1) -> None:
    """Every parameter is within 5 %; friction, a hundredth of the torque, within its interval."""
    true = true_values('bldc' if case == 'bldc' else 'pmsm', recorded(case, seed)[0])
    found = followed(case, estimator, seed).estimate()
    for name in true.keys() - {'b'}:
        assert found[name].value == pytest.approx(true[name], rel=0.05), name
    assert abs(found['b'].value - true['b']) < 2.6 * found['b'].sigma


@pytest.mark.parametrize('case', ['pmsm', 'bldc'])
@pytest.mark.parametrize('estimator', ALL)
def test_every_estimator_finds_every_parameter(case, estimator):
    check_all(case, estimator)


@pytest.mark.parametrize('estimator', REGRESSIONS)
def test_regressions_tell_the_inductances_of_another_machine(estimator):
    """They know it, too: within 5 % and 2.6 sigma, and sigma itself within 8 %."""
    truth, _ = recorded('traction')
    check_all('traction', estimator)
    found = followed('traction', estimator).estimate()
    for name, true in (('L_d', truth.L_d), ('L_q', truth.L_q)):
        assert abs(found[name].value - true) < 2.6 * found[name].sigma < 0.2 * true, name
        assert found[name].identifiable, name


@pytest.mark.slow
@pytest.mark.parametrize('case', ['pmsm', 'traction'])
@pytest.mark.parametrize('estimator', REGRESSIONS)
@pytest.mark.parametrize('seed', [2, 3])
def test_regressions_find_every_parameter_on_other_records(case, estimator, seed):
    check_all(case, estimator, seed)


@pytest.mark.parametrize('seed', [2, 3])
def test_directional_forgetting_finds_the_inductance_of_a_bldc(seed):
    """A prior that came in at once would tie it to what the first samples made of it."""
    check_all('bldc', 'rls_directional', seed)


@pytest.mark.parametrize('kind', ['pmsm', 'bldc'])
def test_what_is_not_driven_is_not_claimed(kind):
    truth, record = recorded(kind)
    model = Model.base(kind, {'pole_pairs': truth.pole_pairs})
    inputs = list(model.kind.inputs[0])
    outputs = [o.signal for o in model.kind.outputs]
    online = OnlineIdentifier(model, 'rls', record.dt, inputs, outputs)
    count = 1000
    noise = 1e-3 * np.random.default_rng(0).standard_normal((count, len(outputs)))
    online.update(record.time[:count], np.full((count, len(inputs)), 0.1), noise)
    found = online.estimate()
    assert not any(found[name].identifiable for name in found if name in ('J', 'L', 'L_d'))
