"""Models for other tools: the numbers are right there, and what has no place is said."""

from dataclasses import replace
import json
import math
from pathlib import Path
import re
import shlex
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from scipy.linalg import expm
import yaml

from motor_sysid.cli import main
from motor_sysid.control.pid import Pid, PidGains
from motor_sysid.errors import UserError
from motor_sysid.export import export, FORMATS, Settings, title_of, uses_of
from motor_sysid.export.linear import linear_plant
from motor_sysid.export.pid import margins, worst_margins
from motor_sysid.export.rigid import drive, rigid
from motor_sysid.export.words import spread
from motor_sysid.physics.effects import catalogue, effect
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motors
from motor_sysid.physics.stepper import Stepper
from motor_sysid.physics.store import save_model

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / 'docs' / 'export.md').read_text()
VALUES = {'R': 1.2, 'L': 1e-3, 'k_t': 0.05, 'J': 8e-5, 'b': 2e-5}
BASE = Model.base('brushed_dc', VALUES)
DRY = BASE.with_effect('coulomb_friction', {'tau_c': 0.01})
STRIBECK = {'tau_c': 0.01, 'tau_s': 0.005, 'omega_s': 5.0}
SHAFT = {'r': 0.5, 'w_a': 200.0, 'z': 0.05}
ALL = Settings(gear=2.0, supply=24.0, top_speed=200.0, rate=1000.0)


def coefficients(model: Model, settings: Settings | None = None) -> dict[str, float]:
    """Return the feedforward by name."""
    found = yaml.safe_load(export(model, 'feedforward', settings).text)['coefficients']
    return {name: entry['value'] for name, entry in found.items()}


def test_feedforward_is_the_balance_of_the_motor() -> None:
    found = coefficients(DRY, Settings(gear=3.0))
    assert found == pytest.approx(
        {
            'k_s': 0.01 * 1.2 / 0.05,
            'k_v': 3.0 * (0.05 + 2e-5 * 1.2 / 0.05),
            'k_a': 3.0 * 8e-5 * 1.2 / 0.05,
            'k_c': 0.0,
        }
    )


def test_feedforward_moves_a_motor_as_wanted() -> None:
    motor = DRY.with_effect('gravity_load', {'tau_sin': 0.02, 'tau_cos': -0.01})
    motor = motor.with_effect('constant_load_torque', {'tau_l': 0.004}).with_values({'L': 1e-5})
    k, plant, dt = coefficients(motor), Stepper(motor, dt=2e-4), 2e-4
    time = np.arange(dt, 1.0, dt)
    speed, slope = 60.0 * np.sin(3.0 * time) ** 2, 180.0 * np.sin(6.0 * time)
    angle = np.cumsum(speed) * dt
    error = []
    for v, a, position in zip(speed, slope, angle, strict=True):
        u = k['k_s'] * np.sign(v) + k['k_v'] * v + k['k_a'] * a + k['k_c']
        u += k['k_g_sin'] * math.sin(position) + k['k_g_cos'] * math.cos(position)
        plant.step([u])
        error.append(plant.state['omega'] - v)
    assert np.sqrt(np.mean(np.square(error))) < 0.02 * np.sqrt(np.mean(speed**2))


def test_a_voltage_model_and_the_whole_motor_have_one_feedforward() -> None:
    reduced = Model.base('brushed_dc_reduced', {'k_v': 0.05048, 'k_a': 8e-5 * 24.0})
    reduced = reduced.with_effect('coulomb_friction', {'tau_c': 0.24})
    assert coefficients(reduced) == pytest.approx(coefficients(DRY), rel=1e-6)
    with pytest.raises(UserError, match='no torque in N m; record the current'):
        export(reduced, 'mujoco')


def test_friction_is_the_closest_line_over_the_speeds_that_matter() -> None:
    model = BASE.with_effect('stribeck_friction', STRIBECK)
    with pytest.raises(UserError, match='give --top-speed'):
        rigid(model)
    body = rigid(model, 100.0)
    speeds = np.linspace(0.5, 100.0, 200)
    torque = 0.01 + 0.005 / (1 + (speeds / 5.0) ** 2) + 2e-5 * speeds
    slope, level = np.polyfit(speeds, torque, 1)
    assert slope < 2e-5, 'the peak at low speed tilts the line'
    assert (body.damping, body.dry) == pytest.approx((slope, level), rel=1e-6)
    missed = np.std(torque - slope * speeds - level) / np.sqrt(np.mean(torque**2))
    assert body.misfit == pytest.approx(missed, rel=1e-3)


def test_bristles_are_bent_as_they_are_at_a_steady_speed() -> None:
    bristles = {'tau_c': 0.01, 's': 0.5, 'omega_s': 5.0, 'z_s': 0.05, 't_b': 1e-3}
    lugre = rigid(BASE.with_effect('lugre_friction', bristles), 100.0)
    stribeck = rigid(BASE.with_effect('stribeck_friction', STRIBECK), 100.0)
    assert (lugre.damping, lugre.dry) == pytest.approx(
        (stribeck.damping, stribeck.dry), rel=1e-6
    )


def test_friction_of_two_directions_is_its_mean_and_a_constant() -> None:
    given = {'tau_c_plus': 0.012, 'tau_c_minus': 0.008}
    body = rigid(BASE.with_effect('asymmetric_coulomb_friction', given))
    assert (body.dry, body.constant) == pytest.approx((0.01, -0.002))
    assert rigid(DRY).constant == 0.0


@pytest.mark.parametrize('key', ['flexible_shaft', 'backlash'])
def test_the_load_behind_a_shaft_turns_with_the_motor(key: str) -> None:
    given = {**SHAFT, **({'phi_g': 0.01} if key == 'backlash' else {})}
    body = rigid(DRY.with_effect(key, given))
    assert body.inertia == pytest.approx(1.5 * 8e-5)
    assert any(catalogue()[key].card.title in note for note in body.left_out)


def strong(model: Model, key: str) -> Model:
    """Return the model with an effect of usual size."""
    card = catalogue()[key].card
    given = {one.name: 1e-3 for one in card.amplitudes}
    shapes = {s.name: max([*s.starts, s.lower, 1e-3][0], 1e-3) for s in card.shapes}
    return model.with_effect(key, {**given, **shapes})


def pairs() -> list[tuple[str, str]]:
    """Return every motor kind with every effect that it may have."""
    return [
        (kind, key)
        for kind in motors()
        for key, one in catalogue().items()
        if Model.base(kind).admits(one) and not one.after
    ]


@pytest.mark.parametrize(('kind', 'key'), pairs())
def test_an_effect_is_in_a_format_or_said_to_be_left_out(kind: str, key: str) -> None:
    plain, title = Model.base(kind), catalogue()[key].card.title
    model = strong(plain, key)
    for name in FORMATS:
        if name == 'pid' and key.startswith('current_sensor'):
            continue  # the current is not in the loop of the speed
        try:
            made, without = export(model, name, ALL), export(plain, name, ALL)
        except UserError:
            continue
        assert made.text.strip()
        assert not re.search(r'\bnan\b', made.text), name
        figures = [re.sub(r'.*(±|Written|DC motor|not in it).*', '', text, flags=re.I)
                   for text in (made.text, without.text)]  # fmt: skip
        told = any(title in note for note in made.left_out)
        assert told or figures[0] != figures[1], f'{name} says nothing of `{key}`'


@pytest.mark.parametrize('kind', sorted(motors()))
def test_every_motor_has_a_format_and_others_say_why_not(kind: str) -> None:
    made, refused = [], []
    for name in FORMATS:
        try:
            made.append(export(Model.base(kind), name, ALL))
        except UserError as problem:
            refused.append(str(problem))
    assert made
    assert all(re.search(r'give|export|record|fit', words, flags=re.I) for words in refused)


def test_matrices_run_as_the_motor_does() -> None:
    model = BASE.with_effect('flexible_shaft', SHAFT)
    model = model.with_effect('speed_sensor_lag', {'lag': 3e-3})
    found = json.loads(export(model, 'state_space', Settings(rate=500.0)).text)
    a, b, c = (np.array(found[name]) for name in ('A_d', 'B_d', 'C'))
    plant, x = Stepper(model, dt=2e-3), np.zeros(len(a))
    random = np.random.default_rng(1)
    for u in random.normal(0, 6, 200):
        x = a @ x + b[:, 0] * u
        plant.step([u])
        own = [plant.state[n] for n in ('i', 'omega', 'theta')]
        np.testing.assert_allclose(x[:3], own, rtol=1e-6, atol=1e-9)
    names = [state['name'] for state in found['states']]
    speed = (c @ x)[1]
    assert speed == pytest.approx(x[names.index('omega_f')], rel=1e-3)
    poles = np.array(found['poles'])
    assert np.all(poles[:, 0] <= 1e-9)
    a_c, step = np.array(found['A']), 2e-3
    np.testing.assert_allclose(expm(a_c * step), a, atol=1e-9)


def test_a_delay_is_told_and_counts_in_the_margins() -> None:
    late = BASE.with_effect('input_delay', {'delay': 4e-3})
    assert json.loads(export(late, 'state_space').text)['input_delay'] == 4e-3
    gains = PidGains(0.5, 5.0)
    prompt, delayed = margins(BASE, gains, 1e-3), margins(late, gains, 1e-3)
    lost = math.degrees(prompt.crossover * 4e-3)
    assert delayed.phase == pytest.approx(prompt.phase - lost, abs=0.5)
    assert delayed.gain < prompt.gain


def test_counts_differenced_over_a_sample_cost_half_of_it() -> None:
    dt, gains = 4e-3, PidGains(0.05, 0.5)
    counted = replace(BASE, speed_sensor=SpeedSensor.DIFFERENCE)
    own, late = margins(BASE, gains, dt), margins(counted, gains, dt)
    lost = math.degrees(own.crossover * dt / 2)
    assert lost > 1.5
    assert late.phase == pytest.approx(own.phase - lost, abs=0.1 * lost)
    assert not export(counted, 'pid', ALL).left_out


def swing(model: Model, gains: PidGains, dt: float) -> float:
    """Return how much the error of the running loop grows from one third to the last."""
    plant, pid = Stepper(model, dt=dt), Pid(gains)
    command, errors = 0.0, []
    for _ in range(900):
        measured = plant.state['omega']
        plant.step([command])  # acts one sample after it was measured
        command = pid.step(1.0, measured, dt)
        errors.append(abs(1.0 - measured))
    return max(errors[600:]) / max(errors[300:600])


def test_the_gain_margin_is_where_the_running_loop_begins_to_swing() -> None:
    dt, gains = 2e-3, PidGains(0.4, 4.0)
    model = BASE.with_effect('flexible_shaft', {'r': 0.5, 'w_a': 120.0, 'z': 0.3})
    gain = margins(model, gains, dt).gain
    assert 1.0 < gain < 100.0
    for factor, swings in ((0.9, False), (1.1, True)):
        more = PidGains(factor * gain * gains.kp, factor * gain * gains.ki)
        assert (swing(model, more, dt) > 1.0) is swings


def test_the_worst_margins_hang_on_how_well_the_motor_is_known() -> None:
    gains, dt = PidGains(0.5, 5.0), 1e-3
    known, vague = (BASE.with_estimates({}, {'J': s * 8e-5}) for s in (0.001, 0.2))
    own = margins(BASE, gains, dt)
    assert worst_margins(BASE, gains, dt) == own, 'nothing is known to be uncertain'
    assert worst_margins(known, gains, dt).phase == pytest.approx(own.phase, abs=0.5)
    assert worst_margins(vague, gains, dt).phase < own.phase - 2.0


@pytest.mark.parametrize('format_', ['feedforward', 'mujoco', 'urdf', 'c_header'])
def test_what_commutation_takes_is_told_as_left_out(format_: str) -> None:
    """At 0.3 N m it costs this motor a fifth of the speed that feedforward promises."""
    said = export(Model.base('bldc_six_step'), format_, ALL).left_out
    assert 'what a brushless motor on a six-step drive does beyond its linear core' in said
    for kind in ('pmsm', 'bldc', 'pmsm_q', 'brushed_dc'):
        assert not any('beyond' in note for note in export(Model.base(kind), 'urdf', ALL).left_out)


def test_gains_ask_for_a_rate_and_a_loop_that_crosses_over() -> None:
    with pytest.raises(UserError, match='--rate'):
        export(BASE, 'pid')
    with pytest.raises(UserError, match=r'would swing at 10 Hz .* longer --closed-loop-time'):
        export(BASE, 'pid', Settings(rate=10.0, closed_loop_time=1e-3))
    assert margins(BASE, PidGains(1e6), 1e-2).phase == 0.0, 'it never falls below one'
    found = yaml.safe_load(export(BASE, 'pid', ALL).text)['/**']['ros__parameters']
    assert found['voltage_limit'] == 24.0
    slow = Settings(rate=1000.0, closed_loop_time=0.5)
    gentle = yaml.safe_load(export(BASE, 'pid', slow).text)['/**']['ros__parameters']
    assert gentle['kp'] < found['kp']
    assert 'voltage_limit' not in gentle


@pytest.mark.parametrize(('rate', 'time'), [(10_000.0, 0.5), (1e6, 20.0)])
def test_a_slow_loop_at_a_fast_rate_is_a_good_one(rate: float, time: float) -> None:
    text = export(BASE, 'pid', Settings(rate=rate, closed_loop_time=time)).text
    found = re.search(r'phase margin (\d+) degrees.* crossover (\S+) rad/s', text)
    assert found is not None
    assert float(found[1]) == pytest.approx(90, abs=1)
    assert float(found[2]) == pytest.approx(1 / time, rel=0.05)


@pytest.mark.parametrize('kind', ['brushed_dc', 'pmsm_q', 'bldc', 'bldc_six_step'])
def test_the_node_takes_the_gains(kind: str, tmp_path: Path) -> None:
    rclpy_parameter = pytest.importorskip('rclpy.parameter', reason='rclpy is not installed')
    nodes = pytest.importorskip('motor_sysid.nodes.pid')
    path = tmp_path / 'pid.yaml'
    path.write_text(export(Model.base(kind), 'pid', ALL).text)
    found = rclpy_parameter.parameter_dict_from_yaml_file(str(path), use_wildcard=True)
    given = {n: rclpy_parameter.parameter_value_to_python(one.value) for n, one in found.items()}
    settings = nodes.PidSettings(**given)
    assert all(type(getattr(settings, n)) is type(getattr(nodes.PidSettings(), n)) for n in given)
    assert settings.gains().upper == 24.0


def test_an_axis_driven_by_torque_has_no_node() -> None:
    text = export(Model.base('mechanical_axis'), 'pid', ALL).text
    assert 'the node `pid` commands no torque' in text
    assert set(yaml.safe_load(text)['/**']['ros__parameters']) == {'kp', 'ki', 'kd'}


@pytest.mark.parametrize('kind', ['pmsm', 'bldc'])
def test_a_motor_with_three_phases_is_driven_by_its_current(kind: str) -> None:
    model = Model.base(kind)
    driven = drive(model)
    assert (driven.signal, driven.unit, driven.emf) == ('current', 'A', 0.0)
    assert coefficients(model)['k_a'] == pytest.approx(model['J'] / driven.torque)
    found = yaml.safe_load(export(model, 'pid', ALL).text)['/**']['ros__parameters']
    assert found['command'] == 'current'
    assert found['current_limit'] == 24.0


def test_a_linear_axis_is_a_slide() -> None:
    axis = Model.base('mechanical_axis', {'J': 90.0, 'b': 200.0}, linear=True)
    axis = axis.with_effect('coulomb_friction', {'tau_c': 20.0})
    joint = ElementTree.fromstring(export(axis, 'mujoco').text).find('.//joint')
    assert joint is not None
    given = {name: joint.get(name) for name in ('type', 'armature', 'damping')}
    assert given == {'type': 'slide', 'armature': '90.0', 'damping': '200.0'}
    assert float(joint.get('frictionloss', 0)) == pytest.approx(20.0)
    assert drive(axis).signal == 'force'
    assert 'prismatic' in export(axis, 'urdf').text


def test_urdf_is_xml_and_tells_what_the_supply_allows() -> None:
    text = export(DRY.with_provenance(data='a--b--.csv'), 'urdf', ALL).text
    joint = ElementTree.fromstring(text)
    limit, dynamics = joint.find('limit'), joint.find('dynamics')
    assert limit is not None
    assert dynamics is not None
    assert float(dynamics.get('damping', 0)) == pytest.approx(4 * 2e-5)
    assert float(limit.get('effort', 0)) == pytest.approx(2 * 24 * 0.05 / 1.2)
    plant = Stepper(DRY, dt=1e-3)
    for _ in range(3000):
        plant.step([24.0])
    assert float(limit.get('velocity', 0)) == pytest.approx(plant.state['omega'] / 2, rel=1e-3)


def test_a_current_limits_no_speed() -> None:
    model, five = Model.base('pmsm'), Settings(supply=5.0)
    with pytest.raises(UserError, match='5 A limits the torque and no speed; give --top-speed'):
        export(model, 'urdf', five)
    text = export(model, 'urdf', Settings(supply=5.0, top_speed=300.0, gear=3.0)).text
    assert 'velocity="100.0"' in text


def test_a_header_with_steps_tells_the_delay() -> None:
    late = DRY.with_effect('input_delay', {'delay': 2e-3})
    assert 'u[k] acts 0.002 s after' in export(late, 'c_header', Settings(rate=500.0)).text
    assert 'u[k] acts' not in export(DRY, 'c_header', Settings(rate=500.0)).text


def test_notes_of_any_text_break_no_format() -> None:
    model = DRY.with_provenance(data='a*/b', by='one\nint x;\n--')
    assert export(model, 'c_header').text.count('*/') == export(DRY, 'c_header').text.count('*/')
    for name in ('mujoco', 'urdf'):
        ElementTree.fromstring(export(model, name).text)
    for name in ('feedforward', 'pid'):
        assert yaml.safe_load(export(model, name, ALL).text)
    lines = export(model, 'matlab').text.splitlines()
    assert all(line.startswith(('%', 'motor.')) for line in lines)


def test_bodies_of_the_simulator_are_taken_off() -> None:
    with pytest.raises(UserError, match='more than all that turned with the motor, 8e-05'):
        export(DRY, 'mujoco', Settings(body_inertia=1e-3))
    joint = ElementTree.fromstring(export(DRY, 'mujoco', Settings(body_inertia=3e-5)).text)
    found = joint.find('.//joint')
    assert found is not None
    assert float(found.get('armature', 0)) == pytest.approx(5e-5)


def test_mujoco_moves_as_the_model_does() -> None:
    mujoco = pytest.importorskip('mujoco', reason='mujoco is not installed')
    motor = DRY.with_values({'L': 1e-5})
    text = export(motor, 'mujoco', Settings(gear=10.0, body_inertia=1e-3)).text
    defaults = text[text.index('<default>') : text.rindex('</mujoco>')]
    world = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="0.0002" gravity="0 0 0" integrator="implicitfast"/>{defaults}'
        '<worldbody><body><joint name="j" class="motor" axis="0 0 1"/>'
        '<inertial pos="0 0 0" mass="1" diaginertia="0.001 0.001 0.001"/></body></worldbody>'
        '<actuator><general class="motor" joint="j"/></actuator></mujoco>'
    )
    data, plant = mujoco.MjData(world), Stepper(motor, dt=2e-4)
    shown, speed = [], []
    for k in range(5000):
        command = 6.0 if k < 2500 else -3.0
        data.ctrl[0] = command
        mujoco.mj_step(world, data)
        plant.step([command])
        shown.append(10.0 * data.qvel[0])
        speed.append(plant.state['omega'])
    off = np.subtract(shown, speed)
    assert np.sqrt(np.mean(off**2)) < 0.01 * np.sqrt(np.mean(np.square(speed)))


@pytest.mark.parametrize(('compiler', 'standard'), [('gcc', 'c99'), ('g++', 'c++11')])
def test_the_header_compiles_and_steps(tmp_path: Path, compiler: str, standard: str) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f'no {compiler}')
    header = export(DRY, 'c_header', Settings(name='wheel', rate=1000.0)).text
    (tmp_path / 'wheel.h').write_text(header)
    source = tmp_path / ('wheel.c' if compiler == 'gcc' else 'wheel.cpp')
    source.write_text(
        '#include <stdio.h>\n#include "wheel.h"\n#include "wheel.h"\n'
        'int main(void) { double x[3] = {0, 0, 0};\n'
        'for (int k = 0; k < 50; k++) { double y[3];\n'
        'for (int i = 0; i < 3; i++) { y[i] = WHEEL_BD[i][0] * 6.0;\n'
        'for (int j = 0; j < 3; j++) y[i] += WHEEL_AD[i][j] * x[j]; }\n'
        'for (int i = 0; i < 3; i++) x[i] = y[i]; }\n'
        'printf("%.12g %.12g %.12g\\n", x[1], WHEEL_FF_K_S, WHEEL_COULOMB_FRICTION_TAU_C);\n'
        'return 0; }\n'
    )
    flags = ['-Wall', '-Wextra', '-Werror', '-pedantic', f'-std={standard}']
    program = tmp_path / 'program'
    subprocess.run([compiler, *flags, str(source), '-o', str(program)], check=True)
    said = subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout
    plant = Stepper(BASE, dt=1e-3)
    for _ in range(50):
        plant.step([6.0])
    assert [float(n) for n in said.split()] == pytest.approx(
        [plant.state['omega'], 0.24, 0.01], rel=1e-8
    )


@pytest.mark.parametrize(('key', 'symbol'), [('belt-größe', 'belt_gr__e'), ('_belt', 'p_belt')])
def test_a_users_effect_may_bear_a_name_that_code_does_not_take(
    key: str, symbol: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(catalogue(), key, replace(effect('coulomb_friction'), key=key))
    model = BASE.with_effect(key, {'tau_c': 0.01})
    header, script = (export(model, to, ALL).text for to in ('c_header', 'matlab'))
    assert f'#define MOTOR_{symbol.upper()}_TAU_C 0.01 ' in header
    assert f'motor.{symbol}_tau_c = 0.01;' in script


def test_the_script_has_the_same_matrices() -> None:
    model = DRY.with_effect('input_delay', {'delay': 2e-3})
    text = export(model, 'matlab', Settings(name='wheel', rate=100.0)).text
    plant = linear_plant(model)
    for letter in 'ABCD':
        (rows,) = re.findall(rf'^wheel\.{letter} = \[(.*)\];$', text, flags=re.MULTILINE)
        found = [[float(n) for n in row.split(',')] for row in rows.split(';')]
        np.testing.assert_allclose(found, getattr(plant, letter.lower()), rtol=1e-11)
    assert 'wheel.input_delay = 0.002;' in text
    assert 'c2d(wheel.sys, 0.01)' in text
    assert '% Not in it:\n%   Coulomb friction: not linear\n' in text


def test_the_script_runs(tmp_path: Path) -> None:
    if shutil.which('octave-cli') is None:
        pytest.skip('no octave-cli (with the package control)')
    model = BASE.with_effect('flexible_shaft', SHAFT)
    model = model.with_effect('input_delay', {'delay': 2e-3})
    script = export(model, 'matlab', Settings(name='wheel', rate=100.0)).text
    end = 'disp(size(wheel.sysd.a)); disp(wheel.sys.InputName{1});'
    (tmp_path / 'run.m').write_text(f'pkg load control\n{script}{end}\n')
    command = ['octave-cli', '--no-gui', '-q', str(tmp_path / 'run.m')]
    said = subprocess.run(command, capture_output=True, text=True, check=False)
    assert said.stdout.split() == ['5', '5', 'voltage'], said.stderr


def test_what_the_data_do_not_tell_makes_a_figure_unknown() -> None:
    model = DRY.with_estimates({}, {'R': 0.012, 'coulomb_friction.tau_c': math.inf})
    made = yaml.safe_load(export(model, 'feedforward').text)['coefficients']
    assert made['k_s']['sigma'] == math.inf
    assert made['k_a']['sigma'] == pytest.approx(0.01 * made['k_a']['value'])
    unseen = DRY.with_estimates({}, {'R': 0.012, 'L': math.inf})
    other = yaml.safe_load(export(unseen, 'feedforward').text)['coefficients']
    assert all(math.isfinite(one['sigma']) for one in other.values()), 'L is in none of them'
    at_edge = BASE.with_estimates({'R': 1e4}, {'R': 10.0})
    assert spread(at_edge, lambda m: {'R': m['R']})['R'] == pytest.approx(10.0)


@pytest.mark.parametrize(
    ('given', 'word'),
    [
        ({'gear': 0.0}, 'gear ratio 0'),
        ({'gear': 1e300}, r'gear ratio 1e\+300 must be from 1e-09 to 1e\+09'),
        ({'body_inertia': 1e300}, r'or above 1e\+09'),
        ({'supply': -1.0}, 'supply -1'),
        ({'rate': math.inf}, 'rate inf'),
        ({'top_speed': math.nan}, 'top speed nan'),
        ({'body_inertia': -1e-3}, 'must not be negative'),
        ({'name': '2nd'}, 'no identifier'),
        ({'name': 'räder'}, 'no identifier'),
    ],
)
def test_settings_that_make_no_sense_are_refused(given: dict[str, float], word: str) -> None:
    with pytest.raises(UserError, match=word):
        Settings(**given)


@pytest.mark.parametrize(
    ('to', 'name', 'word'),
    [
        ('matlab', 'end', 'name `end` is taken in MATLAB; take another, such as `end_motor`'),
        ('matlab', 'ss', 'is taken in MATLAB'),
        ('matlab', '_motor', 'in MATLAB a name begins with a letter'),
    ],
)
def test_names_that_mean_something_else_are_refused(to: str, name: str, word: str) -> None:
    with pytest.raises(UserError, match=word):
        export(DRY, to, Settings(name=name))
    assert name in export(DRY, 'mujoco', Settings(name=name)).text


@pytest.mark.parametrize('to', FORMATS)
def test_a_format_looks_at_what_it_says(to: str) -> None:
    source = (ROOT / 'motor_sysid' / 'export' / f'{to}.py').read_text()
    assert set(re.findall(r'settings\.(\w+)', source)) <= set(uses_of(to))


def test_options_that_a_format_does_not_look_at_are_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for to, *option in (
        ['feedforward', '--rate', '500'], ['pid', '--name', 'left'], ['matlab', '--gear', '1'],
        ['state_space', '--top-speed', '9'],
    ):  # fmt: skip
        assert main(['export', 'model.yaml', '--to', to, *option]) == 2
        assert f'{option[0]} does nothing with --to {to}, which takes' in capsys.readouterr().err


def test_unknown_formats_and_motors_without_a_linear_part() -> None:
    with pytest.raises(UserError, match='did you mean `mujoco`'):
        export(DRY, 'mujco')
    with pytest.raises(UserError, match='turns with the angle'):
        export(Model.base('bldc'), 'state_space')
    with pytest.raises(UserError, match='has its motion as input'):
        export(Model.base('inverse_axis'), 'mujoco')


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Change into a folder with a model."""
    monkeypatch.chdir(tmp_path)
    save_model(DRY.with_estimates({}, {'R': 0.01}), 'model.yaml')
    return tmp_path


def test_the_page_runs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (shell,) = (b for b in re.findall(r'```sh\n(.*?)```', PAGE, flags=re.DOTALL))
    for line in shell.splitlines():
        program, *arguments = shlex.split(line)
        assert program == 'motor-sysid'
        assert main(arguments) == 0, line
    assert {'pid.yaml', 'left_wheel.xml', 'motor.h'} <= {p.name for p in folder.iterdir()}
    (code,) = re.findall(r'```python\n(.*?)```', PAGE, flags=re.DOTALL)
    capsys.readouterr()
    exec(compile(code, 'export.md', 'exec'), {})
    said = capsys.readouterr().out
    assert 'k_s' in said
    assert 'not in it:\n  the current takes' in said
    assert all(f'| `{name}` |' in PAGE for name in FORMATS)


def test_the_verb_writes_and_tells(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['export', 'model.yaml', '--to', 'feedforward', '--json', '-']) == 0
    said = capsys.readouterr()
    document = json.loads(said.out)
    assert document['schema'] == 'motor_sysid/export/1'
    assert yaml.safe_load(document['text'])['command'] == 'voltage [V]'
    assert document['left_out'][0] in said.err
    assert main(['export', 'model.yaml', '--to', 'pid']) == 2
    assert 'error: a controller runs in steps' in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(['export', '--help'])
    said = capsys.readouterr()
    assert all(title_of(name) in said.out for name in FORMATS)
