"""The catalogue on three-phase motors: one contract over every effect that makes sense there."""

import inspect

import numpy as np
import pytest

from motor_sysid.benchmark.three_phase import shape
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.laws import amplitude, atan, cos, settling, sin, THIRD
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor
from motor_sysid.physics.rollout import Program
from motor_sysid.physics.scales import scales_of
from motor_sysid.physics.simulate import simulate
from motor_sysid.physics.store import dump_model, parse_model
from motor_sysid.signals.phases import to_abc, to_dq
from motor_sysid.signals.record import Record

DT = 5e-4
BASES = {
    'pmsm': Model.base('pmsm', {
        'R': 0.6, 'L_d': 1.2e-3, 'L_q': 1.9e-3, 'psi_f': 0.012, 'J': 6e-5, 'b': 4e-5,
        'omega_eps': 0.5, 'i_eps': 0.02,
    }),
    'bldc': Model.base('bldc', {
        'R': 0.6, 'L': 1.4e-3, 'k_e': 0.04, 'J': 6e-5, 'b': 4e-5, 'omega_eps': 0.5, 'i_eps': 0.02,
    }),
}  # fmt: skip
SEARCHED = {'n': 7.0, 't_on': 0.2, 'f': 2.3}
CASES = [
    (kind, key)
    for kind, base in BASES.items()
    for key, one in sorted(catalogue().items())
    if base.admits(one)
]
MECHANICAL = {
    'coulomb_friction', 'asymmetric_coulomb_friction', 'stribeck_friction', 'lugre_friction',
    'load_dependent_friction', 'quadratic_drag', 'friction_drift', 'constant_load_torque',
    'load_torque_step', 'periodic_load', 'gravity_load', 'cogging_torque', 'flexible_shaft',
    'backlash', 'inertia_change', 'iron_loss',
}  # fmt: skip
ELECTRICAL = {
    'inverter_dead_time', 'inductance_saturation', 'emf_harmonics', 'armature_heating',
    'input_delay',
}  # fmt: skip


@pytest.fixture(scope='module')
def records() -> dict[str, Record]:
    """Return a record of each motor, driven by a vector that turns with its rotor."""
    return {kind: _record(base) for kind, base in BASES.items()}


def _record(base: Model) -> Record:
    rng = np.random.default_rng(5)
    u = np.repeat(rng.uniform([-2, -8], [2, 8], (16, 2)), 50, axis=0)
    time = DT * np.arange(len(u))
    if base.motor == 'pmsm':
        names, volts = 'dq', u
    else:
        angle = np.cumsum(4 * 25 * DT * u[:, 1])
        names, volts = 'abc', to_abc(u, angle)
    signals = {f'voltage_{n}': volts[:, k] for k, n in enumerate(names)}
    record = Record(time, signals, dict.fromkeys(signals, 'V'))
    run = simulate(base, record)
    for output in base.kind.outputs:
        unit = {'speed': 'rad/s', 'position': 'rad'}.get(output.signal, 'A')
        record = record.with_signal(output.signal, run.outputs[output.signal], unit)
    return record


def strong(kind: str, key: str, record: Record) -> Model:
    """Return the motor with an effect of a tenth of its scale."""
    base = BASES[kind]
    scales = scales_of(kind, base.parameters.values(), [record])
    card = catalogue()[key].card
    sizes = {a.name: a.trials[2] if a.trials else 0.1 for a in card.amplitudes}
    values = {a.name: sizes[a.name] * scales.size(a.scale) for a in card.amplitudes}
    values |= {s.name: SEARCHED[s.name] for s in card.shapes if not s.starts}
    return base.with_effect(key, values, scales)


@pytest.mark.parametrize('kind', BASES)
def test_what_makes_sense_is_offered_and_nothing_else(kind):
    offered = {key for other, key in CASES if other == kind}
    assert offered >= MECHANICAL | ELECTRICAL
    assert not offered & {'brush_voltage_drop', 'supply_sag', 'driver_clipping', 'drive_coast'}
    for key in ('rotor_angle_lag', 'voltage_angle_lag'):
        assert (key in offered) == (kind == 'pmsm'), 'phases know no axes'


@pytest.mark.parametrize(('kind', 'key'), CASES)
def test_it_keeps_the_contract(kind, key, records):
    base, record = BASES[kind], records[kind]
    model = strong(kind, key, record)
    card = catalogue()[key].card
    off = model.with_values({f'{key}.{a.name}': 0.0 for a in card.amplitudes})
    plain, without, with_it = (simulate(m, record).outputs for m in (base, off, model))
    sizes = {n: np.max(np.abs(v)) for n, v in plain.items()}
    for name, values in plain.items():
        np.testing.assert_allclose(without[name], values, atol=1e-8 * sizes[name], rtol=0)
    assert max(np.max(np.abs(with_it[n] - plain[n])) / sizes[n] for n in plain) > 1e-3
    assert parse_model(dump_model(model)) == model
    fine = simulate(model, record, substeps=16).outputs
    for name in ('speed', *(o.signal for o in base.kind.outputs if 'current' in o.signal)):
        assert np.std(with_it[name] - fine[name]) < 0.03 * np.std(fine[name]), name


@pytest.mark.parametrize('kind', BASES)
def test_population_equals_single_runs(kind, records):
    model = strong(kind, 'inverter_dead_time', records[kind])
    program = Program.of(model, ['speed'])
    drive = Drive.of(records[kind], model.kind)
    table = {n: np.full(40, v) for n, v in model.parameters.values().items()}
    table['J'] = table['J'] * np.linspace(0.8, 1.2, 40)
    together = program.run(table, drive, np.zeros(4), threads=2)
    for k in (0, 31, 32, 39):
        alone = program.run({n: v[k : k + 1] for n, v in table.items()}, drive, np.zeros(4))
        np.testing.assert_array_equal(together[:, :, k], alone[:, :, 0])


def law_values(kind: str, key: str, **values):
    """Return equation to value of the laws of an effect at given states and parameters."""
    one = motor(kind).taking(catalogue()[key])
    found: dict[str, float] = {}
    for name, law in one.laws.items():
        given = {n: values[n] for n in inspect.signature(law).parameters}
        target = name.removeprefix('and_')
        found[target] = found.get(target, 0.0) + law(**given)
    return found


def test_dead_time_is_the_same_in_phases_and_in_the_rotor():
    rng = np.random.default_rng(1)
    shared = {'v_d': 0.6, 'i_0': 0.4, 'pole_pairs': 3.0, 'angle_offset': 0.2}
    for theta in rng.uniform(0, 7, 30):
        i_dq, angle = rng.normal(size=2), 3.0 * theta + 0.2
        a, b, _ = to_abc(i_dq, angle)
        dq = law_values('pmsm', 'inverter_dead_time', i_d=i_dq[0], i_q=i_dq[1], theta=theta,
                        **shared)  # fmt: skip
        abc = law_values('bldc', 'inverter_dead_time', i_a=a, i_b=b, **shared)
        c = -abc['voltage_a'] - abc['voltage_b']
        expected = to_dq([abc['voltage_a'], abc['voltage_b'], c], angle)
        assert [dq['voltage_d'], dq['voltage_q']] == pytest.approx(expected, abs=1e-12)
        assert dq['voltage_d'] * i_dq[0] + dq['voltage_q'] * i_dq[1] < 0, 'it takes power'


@pytest.mark.parametrize('off', [0.0, 0.2])
def test_harmonics_are_those_of_the_simulator_that_tests_trust(off):
    """Also seen from axes that lie `off` behind those of the magnet."""
    from motor_sysid.benchmark.machine import PMSM_SHEETS

    m = PMSM_SHEETS[0].machine._replace(fifth=0.07, seventh=-0.04)
    plain = m._replace(fifth=0.0, seventh=0.0)
    p, omega = m.pole_pairs, 80.0
    for theta in np.linspace(0, 2, 17):
        x = p * theta
        form = [
            shape(m, x - k * THIRD) - shape(plain, x - k * THIRD) for k in range(3)
        ]
        i_dq = np.array([0.4, -1.3])
        given = {'omega': omega, 'theta': theta, 'turn': 0.0, 'psi_f': m.k_e / p,
                 'pole_pairs': p, 'angle_offset': -off, 'frame_error': off, 'k_5': 0.07,
                 'k_7': -0.04, 'i_d': i_dq[0], 'i_q': i_dq[1]}  # fmt: skip
        found = law_values('pmsm', 'emf_harmonics', **given)
        assert [found['voltage_d'], found['voltage_q']] == pytest.approx(
            -to_dq(m.k_e * omega * np.array(form), x - off)
        )
        assert found['torque'] == pytest.approx(m.k_e * np.dot(form, to_abc(i_dq, x - off)))


def test_a_late_angle_turns_the_axes_by_what_the_rotor_covers():
    """At one speed it is nothing but a `frame_error` that is larger by that angle."""
    motor_values = {'R': 0.5, 'L_d': 1e-3, 'L_q': 2e-3, 'psi_f': 0.01, 'pole_pairs': 4.0}
    state = {'u_d': -1.0, 'u_q': 9.0, 'i_d': 0.7, 'i_q': -1.9, 'omega': 200.0}
    given = {**motor_values, **state, 'frame_error': 0.03, 'lag': 150e-6,
             'hold_squared': 1e-8}  # fmt: skip
    found = law_values('pmsm', 'rotor_angle_lag', **given)
    own = motor('pmsm').own.laws

    def at(angle: float, name: str) -> float:
        law = own[name]
        values = {**given, 'frame_error': angle}
        return law(**{n: values[n] for n in inspect.signature(law).parameters})

    assert set(found) == {'torque', 'voltage_d', 'voltage_q'}
    for name, value in found.items():
        assert value == pytest.approx(at(0.03 + 4 * 200 * 150e-6, name) - at(0.03, name)), name


def test_a_late_voltage_is_the_same_voltage_on_axes_that_have_turned_on():
    u, turn = complex(-1.0, 9.0), 4 * 200 * 150e-6
    found = law_values(
        'pmsm', 'voltage_angle_lag', u_d=u.real, u_q=u.imag, omega=200.0, pole_pairs=4.0,
        lag=150e-6,
    )  # fmt: skip
    more = u * np.exp(-1j * turn) - u
    assert [found['voltage_d'], found['voltage_q']] == pytest.approx([more.real, more.imag])


@pytest.mark.parametrize('key', ['inductance_saturation', 'emf_harmonics'])
def test_what_turns_takes_no_power_from_the_axes_that_it_does_not_give_as_torque(key):
    """Power of the induced voltages is that of the torque, at constant currents."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        i_d, i_q, omega, theta = rng.normal(size=4) * [2, 2, 50, 3]
        given = {'i_d': i_d, 'i_q': i_q, 'omega': omega, 'theta': theta, 'turn': 0.0,
                 'di_d': 0.0, 'di_q': 0.0, 'pole_pairs': 4.0, 'psi_f': 0.01, 'L_d': 1e-3,
                 'L_q': 2e-3, 'angle_offset': 0.0, 'frame_error': 0.1, 's': 0.7,
                 'i_s': 1.3, 'k_5': 0.1, 'k_7': 0.05}  # fmt: skip
        found = law_values('pmsm', key, **given)
        power = 1.5 * (found['voltage_d'] * i_d + found['voltage_q'] * i_q)
        assert power == pytest.approx(-found['torque'] * omega, rel=1e-9)


def test_helpers_of_laws():
    x = np.concatenate([np.linspace(-3, 3, 601), [-1e4, 1e4, 0.0]])
    np.testing.assert_allclose(atan(x), np.arctan(x), atol=1e-11)
    assert atan(0.3) == pytest.approx(np.arctan(0.3), abs=1e-11)
    t = np.concatenate([[0.0], np.geomspace(1e-9, 1e4, 200)])
    np.testing.assert_allclose(settling(t, 3.0), -3.0 * np.expm1(-t / 3.0), rtol=1e-11)
    assert settling(0.3, 1e9) == pytest.approx(0.3, rel=1e-9)
    angle = np.linspace(0, 6, 50)
    a, b = 2.5 * cos(angle), 2.5 * (-0.5 * cos(angle) + np.sqrt(0.75) * sin(angle))
    np.testing.assert_allclose(amplitude(a, b), 2.5, rtol=1e-9)
