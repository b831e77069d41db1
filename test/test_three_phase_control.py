"""Field-oriented control and six-step commutation, on the independently simulated machines."""

import math

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from motor_sysid.benchmark.machine import BLDC_SHEETS, Bridge, PMSM_SHEETS
from motor_sysid.benchmark.three_phase import shape
from motor_sysid.benchmark.three_phase_drive import (
    PhaseSensors,
    run_drive,
    ThreePhaseDrive,
    ThreePhaseRun,
)
from motor_sysid.control.foc import (
    CurrentLoop,
    Foc,
    legs,
    voltage_limit,
)
from motor_sysid.control.six_step import FORWARD, pair_legs, SixStepLoop
from motor_sysid.control.tuning import current_pi
from motor_sysid.errors import UserError
from motor_sysid.signals.phases import hall_sector, SECTOR, to_abc, to_dq

PMSM = PMSM_SHEETS[0].machine._replace(L_d=150e-6, L_q=320e-6)
BLDC = BLDC_SHEETS[2].machine
IDEAL = PhaseSensors(counts=0, noise=0.0, bits=0)
BANDWIDTH = 1500.0
LOOP = CurrentLoop(PMSM.R, PMSM.L_d, PMSM.L_q, PMSM.k_e / 4, BANDWIDTH)
volts = st.floats(-20, 20)


def dq(run: ThreePhaseRun) -> np.ndarray:
    return to_dq(run.current, PMSM.pole_pairs * run.position)


def follow(reference: np.ndarray, reference_d: np.ndarray, inertia: float) -> ThreePhaseRun:
    drive = ThreePhaseDrive(Bridge(24.0), LOOP, control_dt=5e-5, sensors=IDEAL)
    machine = PMSM._replace(J=inertia)
    return run_drive(
        machine, drive, reference, 1e-4, np.random.default_rng(0), reference_d=reference_d
    )


def test_currents_follow_with_the_bandwidth_and_leave_each_other_alone() -> None:
    count = 2500
    q = np.where(np.arange(count) < 10, 0.0, 2.0)
    d = np.where(np.arange(count) < 2400, 0.0, -1.0)
    run = follow(q, d, 8e-5)
    current = dq(run)
    expected = 2.0 * (1 - np.exp(-BANDWIDTH * 1e-4 * np.arange(40)))
    assert np.max(np.abs(current[10:50, 1] - expected)) < 0.2, 'a control period of delay'
    assert run.speed[2399] > 200, 'it turns fast by now'
    assert np.max(np.abs(current[2400:2450, 1] - current[2399, 1])) < 0.05, 'd does not move q'
    assert current[2480, 0] == pytest.approx(-1.0, abs=0.02)


def test_voltage_is_limited_and_does_not_wind_up() -> None:
    count = 6000
    q = np.where(np.arange(count) < 5000, 8.0, 0.0)
    run = follow(q, np.zeros(count), 5e-6)
    length = np.hypot(*run.command_dq.T)
    assert np.max(length) < 24.0 / math.sqrt(3) + 1e-9
    assert np.mean(length[4000:4900] > 13.8) > 0.9, 'all there is'
    assert abs(dq(run)[5020, 1]) < 0.3, 'the current is gone 2 ms after it is not wanted any more'


@given(volts, volts)
def test_legs_keep_line_voltages_and_stay_within_the_rails(d: float, q: float) -> None:
    size = math.hypot(d, q)
    scale = min(1.0, voltage_limit(24.0) / size) if size else 0.0
    u = to_abc((d * scale, q * scale), 0.3)
    v = np.array(legs(*u, 24.0))
    assert np.all((v >= -1e-9) & (v <= 24.0 + 1e-9))
    assert np.allclose(v - v[0], u - u[0], atol=1e-9)
    assert v.max() + v.min() == pytest.approx(24.0)


def test_what_cannot_work_is_refused() -> None:
    with pytest.raises(UserError, match=r'control periods of at most 0\.0002 s'):
        Foc(LOOP, 24.0, 1e-3)
    with pytest.raises(UserError, match='inertia'):
        current_pi(0.0, 0.05, 50.0, 5.0)


@pytest.mark.parametrize('sector', range(1, 7))
def test_the_pair_of_a_sector_is_the_one_that_pulls_most(sector: int) -> None:
    angles = SECTOR * (sector - 0.5) + np.linspace(0.02, 0.98, 25) * SECTOR
    assert set(hall_sector(angles)) == {sector}
    pulls = {
        (i, o): np.mean([
            shape(BLDC, a - i * 2 * math.pi / 3) - shape(BLDC, a - o * 2 * math.pi / 3)
            for a in angles
        ])
        for i in range(3) for o in range(3) if i != o
    }  # fmt: skip
    assert max(pulls, key=pulls.get) == FORWARD[sector - 1]
    assert pulls[FORWARD[sector - 1]] == pytest.approx(2.0, abs=0.05), 'both are flat'


def test_legs_of_six_steps() -> None:
    assert np.array_equal(pair_legs(1, 5.0), (0.0, 5.0, np.nan), equal_nan=True)
    assert np.array_equal(pair_legs(1, -5.0), (5.0, 0.0, np.nan), equal_nan=True)
    assert np.array_equal(pair_legs(4, 5.0), (5.0, 0.0, np.nan), equal_nan=True)


def six_step(want: np.ndarray, limit: float) -> ThreePhaseRun:
    loop = SixStepLoop(BLDC.R, BLDC.L_d, BLDC.k_e, BANDWIDTH, limit)
    drive = ThreePhaseDrive(Bridge(24.0), loop, control_dt=5e-5, sensors=IDEAL)
    return run_drive(
        BLDC._replace(J=3e-5), drive, want, 1e-4, np.random.default_rng(0)
    )


def test_six_steps_turn_both_ways_and_keep_to_the_current_limit() -> None:
    want = np.repeat([10.0, -10.0], 1500)
    run = six_step(want, 2.0)
    assert run.speed[1490] > 80
    assert run.speed[2990] < 0.3 * run.speed[1490]
    flowing = np.sort(np.abs(run.current), axis=1)
    assert np.median(flowing[200:1400, 2]) == pytest.approx(2.0, rel=0.1), 'two phases carry it'
    assert np.quantile(flowing[200:1400, 2], 0.99) < 2.0 * 1.25
    assert np.median(flowing[200:1400, 0]) < 1e-3, 'and one is off'
    torque = (BLDC.J * 0 + 3e-5) * np.diff(run.speed[200:1400]).mean() / 1e-4
    assert torque == pytest.approx(2 * BLDC.k_e * 2.0, rel=0.06), 'twice k_e, less what turns cost'
