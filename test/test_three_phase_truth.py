"""The three-phase simulator that tests trust: against scipy, power balance and theory."""

import math
from pathlib import Path
import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from motor_sysid.benchmark.machine import BLDC_SHEETS, Bridge, Machine, PMSM_SHEETS
from motor_sysid.benchmark.three_phase import advance, OMEGA, OMEGA_L, shape, STATES, THETA, TWIST
from motor_sysid.benchmark.three_phase_drive import (
    phase_record,
    PhaseSensors,
    run_drive,
    ThreePhaseDrive,
)
from motor_sysid.control.foc import CurrentLoop
from motor_sysid.control.six_step import SixStepLoop
from motor_sysid.control.tuning import current_pi
from motor_sysid.signals.phases import to_dq

PMSM, BLDC = (sheets[0].machine for sheets in (PMSM_SHEETS, BLDC_SHEETS))
SALIENT = PMSM._replace(L_d=150e-6, L_q=320e-6)
H = 5e-6
IDEAL = PhaseSensors(counts=0, noise=0.0, bits=0)


def simulated(machine: Machine, terminals, seconds: float, start=(), dead: float = 0.0):
    """Return the states (N, 8) and terminal voltages (N, 3) under ``terminals(t)``; NaN is off."""
    x, work = np.zeros(STATES), np.zeros((6, STATES))
    x[: len(start)] = start
    machine, states, shown = Machine(*map(float, machine)), [x.copy()], []
    for k in range(round(seconds / H)):
        v = np.asarray(terminals(k * H), dtype=float)
        off = np.isnan(v)
        low = np.where(off, -0.7, v - dead)
        high = np.where(off, 24.7, v + dead)
        advance(machine, x, low, high, k * H, H, work)
        states.append(x.copy())
        shown.append(work[1, :3].copy())
    return np.array(states), np.array(shown)


def held(k: int):
    """Return terminal voltages of a quick, unsymmetric excitation, held over each millisecond."""
    return [(6, 2, 0), (0, 5, 1), (3, 0, 7), (8, 8, 1), (1, 0, 0)][k % 5]


def test_a_salient_machine_is_that_of_the_textbook_in_dq() -> None:
    """The textbook's equations in the rotor frame, by an integrator of high order."""
    m, p = SALIENT, SALIENT.pole_pairs

    def textbook(t, y):
        i_d, i_q, omega, theta = y
        u_d, u_q = to_dq(held(int(t * 1e3 + 1e-9)), p * theta)
        flux_d, flux_q = m.L_d * i_d + m.k_e / p, m.L_q * i_q
        torque = 1.5 * p * (flux_d * i_q - flux_q * i_d)
        return [
            (u_d - m.R * i_d + p * omega * flux_q) / m.L_d,
            (u_q - m.R * i_q - p * omega * flux_d) / m.L_q,
            (torque - m.b * omega) / m.J,
            omega,
        ]

    states, _ = simulated(m, lambda t: held(int(t * 1e3 + 1e-9)), 0.02)
    y = np.zeros(4)
    for k in range(20):
        y = solve_ivp(textbook, (k * 1e-3, (k + 1 - 1e-9) * 1e-3), y, 'DOP853',
                      rtol=1e-10, atol=1e-12).y[:, -1]  # fmt: skip
        ours = states[(k + 1) * 200]
        i_dq = to_dq(ours[:3], p * ours[THETA])
        assert np.allclose(i_dq, y[:2], atol=2e-6), k
        assert np.allclose(ours[3:5], y[2:], rtol=1e-6, atol=1e-6), k


def test_a_trapezoidal_machine_is_three_windings_on_one_neutral() -> None:
    """Windings one by one, with the neutral's voltage in the open: no transformation at all."""
    m = BLDC

    def windings(t, y):
        i, omega, theta = y[:3], y[3], y[4]
        form = [shape(m, m.pole_pairs * theta - k * 2 * math.pi / 3) for k in range(3)]
        emf = m.k_e * omega * np.array(form)
        v = np.asarray(held(int(t * 1e3 + 1e-9)), dtype=float)
        neutral = np.mean(v - emf)
        rates = (v - neutral - m.R * i - emf) / m.L_d
        return [*rates, (m.k_e * np.dot(form, i) - m.b * omega) / m.J, omega]

    states, _ = simulated(m, lambda t: held(int(t * 1e3 + 1e-9)), 0.02)
    y = np.zeros(5)
    for k in range(20):
        y = solve_ivp(windings, (k * 1e-3, (k + 1 - 1e-9) * 1e-3), y, 'DOP853', rtol=1e-10,
                      atol=1e-12, max_step=2e-5).y[:, -1]  # fmt: skip
        assert np.allclose(states[(k + 1) * 200][:5], y, rtol=2e-6, atol=2e-6), k


@pytest.mark.parametrize('machine', [SALIENT, BLDC], ids=['pmsm', 'bldc'])
def test_power_in_is_heat_motion_and_field(machine: Machine) -> None:
    """Phases off now and then, dead time, dry friction: nothing comes from nowhere."""
    m = machine._replace(tau_c=3e-3, cogging=1e-3, order=6.0)

    def terminals(t: float) -> tuple[float, float, float]:
        return [(8, 0, math.nan), (math.nan, 6, 0), (5, 0, 1)][int(t * 500) % 3]

    states, v = simulated(m, terminals, 0.03, dead=0.3)
    i, omega, theta = states[:, :3], states[:, OMEGA], states[:, THETA]
    given = np.sum(v * 0.5 * (i[1:] + i[:-1])) * H
    dq = to_dq(i, m.pole_pairs * theta)
    field = 0.75 * (m.L_d * dq[:, 0] ** 2 + m.L_q * dq[:, 1] ** 2)
    motion = 0.5 * m.J * omega**2 + m.cogging / 6 * np.cos(6 * theta)
    heat = np.sum(m.R * np.sum(i**2, axis=1) + m.b * omega**2 + m.tau_c * np.abs(omega)) * H
    kept = field[-1] - field[0] + motion[-1] - motion[0]
    assert given == pytest.approx(kept + heat, rel=3e-3)
    assert heat > 0.2 * given


def test_finer_steps_change_nothing() -> None:
    m = BLDC._replace(tau_c=2e-3, J=3e-5)
    loop = SixStepLoop(m.R, m.L_d, m.k_e, 1500.0, 3.0)
    drive = ThreePhaseDrive(Bridge(24.0, 0.2), loop, sensors=IDEAL)
    want = np.repeat([1.0, -1.0], 200)
    coarse, fine = (
        run_drive(m, drive, want, 1e-4, np.random.default_rng(0), longest_step=h)
        for h in (10e-6, 2.5e-6)
    )
    assert np.max(np.abs(coarse.current - fine.current)) < 5e-3
    assert np.max(np.abs(coarse.speed - fine.speed)) < 5e-4 * np.max(np.abs(fine.speed))


def test_an_open_phase_frees_itself_through_its_diode_and_then_shows_its_emf() -> None:
    m = BLDC._replace(J=1.0)  # the shaft keeps its speed
    start = (1.0, -1.0, 0.0, 60.0, math.radians(60) / m.pole_pairs)
    states, v = simulated(m, lambda t: (math.nan, 0.0, 6.0), 3e-3, start)
    current = states[1:, 0]
    free = np.flatnonzero(current <= 0)[0]
    assert 10 < free < 300
    assert np.all(v[: free - 1, 0] == -0.7), 'current into the machine comes through the lower one'
    assert np.all(current[free:] == 0.0)
    angles = m.pole_pairs * states[free + 1 :, THETA]
    emf = m.k_e * 60 * np.array(
        [[shape(m, a - k * 2 * math.pi / 3) for k in range(3)] for a in angles]
    )  # fmt: skip
    shown = 3.0 - 0.5 * (emf[:, 1] + emf[:, 2]) + emf[:, 0]
    assert np.allclose(v[free:, 0], shown[: v[free:].shape[0]], atol=2e-2)


def test_dead_time_takes_its_voltage_and_clamps_small_currents() -> None:
    m = PMSM._replace(J=1.0)
    states, _ = simulated(m, lambda t: (12.4, 12.0, 12.0), 5e-3, dead=0.5)
    assert not np.any(states[:, :3]), 'less than dead time takes'
    states, _ = simulated(m, lambda t: (14.0, 12.0, 12.0), 5e-3, dead=0.5)
    assert states[-1, 0] == pytest.approx((2.0 - 1.0) / (1.5 * m.R), rel=1e-3)


def test_dry_friction_holds_below_break_away() -> None:
    m = PMSM._replace(tau_c=20e-3, tau_s=10e-3)
    torque = 1.5 * m.k_e
    for share, moves in ((0.97, False), (1.05, True)):
        i_q = share * 30e-3 / torque
        v = -np.sin(-2 * np.pi / 3 * np.arange(3)) * i_q * m.R
        states, _ = simulated(m, lambda t, v=v: v, 0.02)
        assert bool(states[-1, OMEGA] != 0) is moves


def closed_loop(machine: Machine, **sensors: float):
    psi_f = machine.k_e / machine.pole_pairs
    loop = CurrentLoop(machine.R, machine.L_d, machine.L_q, psi_f, 1500.0)
    gains = current_pi(machine.J, 1.5 * machine.k_e, 60.0, 6.0)
    drive = ThreePhaseDrive(Bridge(24.0), loop, gains, sensors=PhaseSensors(**sensors))
    reference = np.repeat([0.0, 100.0, -60.0], 200)
    rng = np.random.default_rng(1)
    run = run_drive(machine, drive, reference, 1e-3, rng)
    return run, phase_record(run, machine.pole_pairs, ['speed_reference', 'hall_sector'])


def test_records_have_phases_and_their_vector_as_sensors_show_them() -> None:
    run, record = closed_loop(PMSM._replace(J=3e-5), noise=0.02)
    steady = slice(380, 399)
    speed = record['speed'][steady].mean()
    assert speed == pytest.approx(100, rel=0.03)
    codes = record['current_a'] / (40 / 4096)
    assert np.allclose(codes, np.round(codes)), '12 bit over 40 A'
    error = run.shown_current - run.current
    assert np.std(error) == pytest.approx(0.02, rel=0.1)
    i_q, u_q = record['current_q'][steady].mean(), record['voltage_q'][steady].mean()
    assert u_q == pytest.approx(PMSM.R * i_q + PMSM.k_e * speed, rel=5e-3), 'd is on the magnet'
    assert abs(record['current_d'][steady].mean()) < 0.02
    assert set(np.unique(record['hall_sector'])) == {1, 2, 3, 4, 5, 6}
    assert record.units['voltage_q'] == 'V'


@pytest.mark.parametrize('sheet', [*PMSM_SHEETS, *BLDC_SHEETS], ids=lambda s: s.name)
def test_sheets_are_plausible(sheet) -> None:
    """Torque constant, efficiency at rated current and electrical time constant of real motors."""
    m = sheet.machine
    assert 1e-4 < m.L_q / m.R < 2e-2
    assert sheet.top_speed * 60 / (2 * math.pi) < 10_000
    power = sheet.current * m.k_e * sheet.top_speed * 0.8
    assert sheet.current**2 * m.R < 0.7 * power


def test_the_example_of_the_page_runs(repository: Path) -> None:
    (block,) = re.findall(
        r'```python\n(.*?)```', (repository / 'docs' / 'benchmark.md').read_text(), re.DOTALL
    )
    names: dict[str, object] = {}
    exec(compile(block, 'benchmark.md', 'exec'), names)
    record = names['record']
    assert {'voltage_a', 'current_c', 'voltage_q', 'current_d', 'speed'} <= set(record)
    assert record['speed'][380:400].mean() == pytest.approx(100, rel=0.03)


def spun(seconds: float, start=(), **numbers: float) -> np.ndarray:
    """Return the states (N, 8) of a shaft whose machine neither drives nor brakes."""
    machine = PMSM._replace(k_e=0.0, b=0.0, J=1e-4, **numbers)
    state = np.zeros(STATES)
    state[: len(start)] = start
    return simulated(machine, lambda t: (0.0, 0.0, 0.0), seconds, state)[0]


def test_a_load_behind_a_shaft_swings_as_two_masses_do() -> None:
    load, spring, damper = 5e-5, 2.0, 1e-3
    states = spun(0.1, (0, 0, 0, 10.0), J_load=load, spring=spring, damper=damper)
    omega, omega_l = states[:, OMEGA], states[:, OMEGA_L]
    assert np.allclose(1e-4 * omega + load * omega_l, 1e-4 * 10.0, rtol=1e-9), 'nothing is lost'
    small = 1e-4 * load / (1e-4 + load)
    decay, pulsation = 0.5 * damper / small, math.sqrt(spring / small)
    damped = math.sqrt(pulsation**2 - decay**2)
    t = H * np.arange(len(states))
    wave = np.exp(-decay * t) * (np.cos(damped * t) - decay / damped * np.sin(damped * t))
    assert np.allclose(omega - omega_l, 10.0 * wave, atol=1e-5)
    assert np.allclose(states[:, TWIST], 10 / damped * np.exp(-decay * t) * np.sin(damped * t),
                       atol=1e-7)  # fmt: skip


def test_a_load_that_swings_or_joins_moves_the_shaft_by_its_torque() -> None:
    rate, angle = 100.0, 0.4
    states = spun(0.1, swing=2e-3, swing_rate=rate, swing_angle=angle)
    t = H * np.arange(len(states))
    want = 2e-3 / 1e-4 / rate * (np.cos(rate * t + angle) - math.cos(angle))
    assert np.allclose(states[:, OMEGA], want, atol=1e-9)

    states = spun(0.1, tau_l=-1e-3, step_time=0.05, step_inertia=1e-4)
    slopes = np.diff(states[:, OMEGA]) / H
    assert np.allclose(slopes[:9990], 10.0)
    assert np.allclose(slopes[10010:], 5.0), 'an inertia joins at the speed of the rotor'


def test_gear_friction_takes_its_share_of_the_torque() -> None:
    m = PMSM._replace(b=0.0, J=1.0)  # the shaft keeps its speed
    start = (0.0, 0.0, 0.0, 5.0)
    free, rubbing = (
        simulated(m._replace(mu=mu), lambda t: (3.0, 0.0, 0.0), 1e-3, start)[0]
        for mu in (0.0, 0.2)
    )
    gained, left = free[-1, OMEGA] - 5.0, rubbing[-1, OMEGA] - 5.0
    assert left == pytest.approx(gained - 0.2 * abs(gained), rel=1e-3)
