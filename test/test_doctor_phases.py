"""The data doctor on three phases: good records pass, and each usual mistake is named."""

from collections.abc import Callable

import numpy as np
import pytest
from three_phase_records import pmsm_record

from motor_sysid.benchmark.machine import BLDC_SHEETS, Bridge, PMSM_SHEETS
from motor_sysid.benchmark.three_phase_drive import (
    phase_record,
    PhaseSensors,
    run_drive,
    ThreePhaseDrive,
)
from motor_sysid.control.foc import CurrentLoop
from motor_sysid.control.profile import Profile
from motor_sysid.control.six_step import SixStepLoop
from motor_sysid.control.tuning import current_pi
from motor_sysid.signals import Finding, Record
from motor_sysid.signals.doctor import examine
from motor_sysid.signals.phases import with_dq

Spoil = Callable[[Record], Record]
SENSORS = PhaseSensors(offsets=(0.01, -0.01, 0.005))


def recorded(kind: str) -> Record:
    """Return a record of a few seconds in closed loop, with friction and dead time."""
    sheet = (PMSM_SHEETS if kind == 'pmsm' else BLDC_SHEETS)[0]
    m = sheet.machine._replace(J=4 * sheet.machine.J, tau_c=2e-3)
    if kind == 'pmsm':
        psi_f = m.k_e / m.pole_pairs
        loop, k_t, dt, top = CurrentLoop(m.R, m.L_d, m.L_q, psi_f, 1500.0), 1.5 * m.k_e, 1e-3, 90
    else:
        loop = SixStepLoop(m.R, m.L_d, m.k_e, 1500.0, sheet.current)
        k_t, dt, top = 2 * m.k_e, 2e-4, 60
    speed = current_pi(m.J, k_t, 40.0, sheet.current)
    drive = ThreePhaseDrive(
        Bridge(sheet.supply, 0.2), loop, speed, control_dt=2e-4, sensors=SENSORS
    )
    reference = Profile('mixed', top, 3.0).sampled(dt)
    run = run_drive(m, drive, reference, dt, np.random.default_rng(0))
    return phase_record(run, m.pole_pairs, ['speed_reference', 'hall_sector'])


PMSM, BLDC = recorded('pmsm'), recorded('bldc')


def found(record: Record) -> dict[str, Finding]:
    return {f.code: f for f in examine(record) if f.severity != 'info'}


@pytest.mark.parametrize('record', [PMSM, BLDC], ids=['pmsm', 'bldc'])
def test_good_phases_pass_and_tell_pole_pairs_and_offset(record: Record) -> None:
    assert found(record) == {}
    told = next(f for f in examine(record) if f.code == 'electrical_angle').numbers
    assert told['pole_pairs'] == (4 if record is PMSM else 8)
    assert told['offset_rad'] == pytest.approx(0, abs=0.06)


@pytest.mark.parametrize(('late', 'offset'), [(120e-6, 0.0), (0.0, 0.5)])
def test_a_voltage_that_is_late_is_no_wrong_offset(late: float, offset: float) -> None:
    """A drone's motor turns one way, so that half a radian at top speed looks like an offset."""
    time, rng = 1e-4 * np.arange(20_000), np.random.default_rng(0)
    speed = 300 + 150 * np.sin(3 * time) + 60 * np.sin(11 * time)
    i = 4 * np.sin(40 * time) + 1j * (6 + 3 * np.sin(23 * time))
    omega = 7 * speed
    u = 0.06 * i + 1j * omega * (2e-5 * i + 1.07e-3) + 0.01 * rng.standard_normal(time.size)
    u = u * np.exp(1j * (omega * late + offset))
    parts = {'voltage_d': u.real, 'voltage_q': u.imag, 'current_d': i.real, 'current_q': i.imag}
    units = {name: 'V' if 'voltage' in name else 'A' for name in parts}
    record = Record(time, {**parts, 'speed': speed}, {**units, 'speed': 'rad/s'})
    assert ('electrical_offset' in found(record)) == bool(offset)


def test_a_turned_encoder_disc_is_read_from_the_back_emf() -> None:
    record = PMSM.with_signal('position', PMSM['position'] + 0.25, 'rad')
    phases = record.select([name for name in record if name[-2:] not in ('_d', '_q')])
    told = next(f for f in examine(phases) if f.code == 'electrical_angle')
    assert told.numbers['offset_rad'] == pytest.approx(-4 * 0.25, abs=0.06)
    assert 'with_dq(record, 4, -' in told.remedy
    mended = with_dq(phases, 4, told.numbers['offset_rad'])
    assert np.allclose(mended['current_q'], PMSM['current_q'], atol=0.1)


def changed(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    return lambda r: r.with_signal(name, change(r[name].copy()), r.units[name])


def swapped_phases(r: Record) -> Record:
    for kind in ('voltage', 'current'):
        b, c = r[f'{kind}_b'], r[f'{kind}_c']
        unit = r.units[f'{kind}_b']
        r = r.with_signal(f'{kind}_b', c, unit).with_signal(f'{kind}_c', b, unit)
    return r


def turned_round(r: Record, phases: str) -> Record:
    for phase in phases:
        r = r.with_signal(f'current_{phase}', -r[f'current_{phase}'], 'A')
    return r


def exchanged(r: Record, phases: str) -> Record:
    one, other = (f'current_{phase}' for phase in phases)
    return r.with_signal(one, r[other], 'A').with_signal(other, r[one], 'A')


def turned_frame(angle: float) -> Spoil:
    return lambda r: with_dq(r, 4, angle)


SPOILT: dict[str, tuple[str, str, str, Spoil]] = {
    'phases b and c swapped': ('phase_order', 'error', 'swap two phases', swapped_phases),
    'position backward': ('position_sign', 'error', 'sign: -1', changed('position', np.negative)),
    'gear before the encoder': (
        'pole_pairs', 'warning', 'gear_ratio', lambda r: r.with_signal(
            'position', r['position'] * 1.6, 'rad').with_signal('speed', r['speed'] * 1.6, 'rad/s')
    ),
    'current sensor b the wrong way round': (
        'current_sum', 'error', 'sign: -1` for current_b', changed('current_b', np.negative)
    ),
    'current of another motor': (
        'current_sum', 'error', 'leave the third one out', changed('current_c', lambda x: x[::-1])
    ),
    'offset of a current sensor': (
        'current_sum', 'warning', 'offset:', changed('current_a', lambda x: x + 0.3)
    ),
    'current sensors the wrong way round': (
        'current_sign', 'error', 'sign: -1` for current_a, current_b and current_c', lambda r:
        turned_round(r, 'abc')
    ),
    'one of two current sensors the wrong way round': (
        'current_sign', 'error', 'sign: -1` for current_b in', lambda r: turned_round(
            r.select([n for n in r if n[-2:] not in ('_d', '_q') and n != 'current_c']), 'b')
    ),
    'current sensors of b and c exchanged': (
        'current_order', 'error', 'of current b and c', lambda r: exchanged(r, 'bc')
    ),
    'current sensors of a and c exchanged': (
        'current_order', 'error', 'of current a and c', lambda r: exchanged(r, 'ac')
    ),
    'angle from the q axis': (
        'electrical_offset', 'error', 'd lies on', turned_frame(np.pi / 2)
    ),
    'half a turn off': ('electrical_offset', 'error', 'd lies on', turned_frame(np.pi)),
    'offset not calibrated': ('electrical_offset', 'error', 'd lies on', turned_frame(0.8)),
    'far too slow': (
        'phase_rate', 'warning', 'record faster', lambda r: r.uniform(4e-3)
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', SPOILT)
def test_mistakes_are_named_with_their_remedy(name: str) -> None:
    code, severity, remedy, spoil = SPOILT[name]
    findings = found(spoil(PMSM))
    assert code in findings, list(findings)
    assert findings[code].severity == severity
    assert remedy in findings[code].remedy
    assert findings[code].consequence


def test_a_d_current_that_alone_is_turned_round_is_told() -> None:
    _, record = pmsm_record(4.0, 1e-3)
    assert 'current_d_sign' not in found(record)
    finding = found(record.with_signal('current_d', -record['current_d'], 'A'))['current_d_sign']
    assert finding.severity == 'error'
    assert 'sign: -1' in finding.remedy


def test_currents_of_two_sound_sensors_pass() -> None:
    for missing in 'abc':
        left = [n for n in PMSM if n[-2:] not in ('_d', '_q') and n != f'current_{missing}']
        assert found(PMSM.select(left)) == {}


def test_the_classic_mix_up_is_called_by_its_name_and_its_angle_is_right() -> None:
    finding = found(turned_frame(np.pi / 2)(PMSM))['electrical_offset']
    assert 'counted from the q axis' in finding.message
    mended = np.pi / 2 + finding.numbers['error_rad']
    assert mended == pytest.approx(0, abs=0.06)
    assert 'half a turn' in found(turned_frame(np.pi)(PMSM))['electrical_offset'].message


def test_a_motor_that_is_braked_is_not_one_of_the_wrong_sign() -> None:
    """While it brakes hard, the voltage is against the speed for good reason."""
    slowing = PMSM['speed'] * PMSM['voltage_q'] < 0
    edges = np.flatnonzero(np.diff(slowing.astype(int)))
    longest = max(np.split(np.arange(len(PMSM)), edges + 1), key=lambda k: k.size * slowing[k[0]])
    piece = PMSM.slice(int(longest[0]), int(longest[-1]) + 1)
    assert len(piece) > 20
    assert 'speed_sign' not in found(piece)
    backward = PMSM.with_signal('speed', -PMSM['speed'], 'rad/s')
    assert 'speed_sign' in found(backward.select([n for n in backward if n != 'position']))


def test_noise_of_three_sensors_is_no_uneven_sum():
    t = 1e-3 * np.arange(4000)
    noise = 0.015 * np.random.default_rng(0).normal(size=(3, t.size))
    columns = {
        f'current_{phase}': 0.18 * np.sin(20 * t - 2 * np.pi / 3 * k) + noise[k]
        for k, phase in enumerate('abc')
    }
    record = Record(t, columns, dict.fromkeys(columns, 'A'))
    assert 'current_sum' not in {one.code for one in examine([record])}
    scaled = record.with_signal('current_b', 0.6 * columns['current_b'], 'A')
    assert 'current_sum' in {one.code for one in examine([scaled])}
