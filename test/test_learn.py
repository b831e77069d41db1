"""Laws that are learned from data: where, how well, how they are kept, and when they are refused.

The motors are integrated by a Runge-Kutta method of the test's own; their strange torques are in
no catalogue.
"""

from functools import cache
import json
from pathlib import Path
import re
import shlex

import numpy as np
import pytest
from strange_motor import DT, LAWS, MOTOR, recorded, torque, volts

from motor_sysid.cli import main
from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.fitting import bench_of
from motor_sysid.diagnosis.learn import beyond_range, learn, Learned, learned_on
from motor_sysid.diagnosis.result.findings import Unknown
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import Prior
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.effects import catalogue, effect, LEARNED
from motor_sysid.physics.laws import KNOTS
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.rollout import Program
from motor_sysid.physics.simulate import simulate
from motor_sysid.physics.stepper import Stepper
from motor_sysid.physics.store import dump_model, load_model, parse_model
from motor_sysid.recording.save import write_record
from motor_sysid.signals.record import Record

PAGE = (Path(__file__).parents[1] / 'docs/learned.md').read_text(encoding='utf-8')
TABLES = [key for key in LEARNED if key != 'learned_torque_position']


def start() -> Model:
    return Model.base(
        'brushed_dc', {**MOTOR, 'omega_eps': 0.5, 'i_eps': 2e-3},
        speed_sensor=SpeedSensor.DIFFERENCE,
    )  # fmt: skip


@cache
def records(law: str, seed: int = 2) -> tuple[Record, Record]:
    rng = np.random.default_rng(seed)
    return recorded(law, volts(6.0, rng), rng), recorded(law, volts(4.0, rng), rng)


def on_axis(law: str, equation: str, axis: str, hold: bool = True) -> Learned:
    """Learn on an axis that is given."""
    train, held = records(law)
    bench, base = bench_of([train], [held], start(), None, {}, 0.2)
    nan = float('nan')
    lacking = Unknown(equation, 'unexplained torque', 'N m', 3e-3, 1e-4, axis, 1.0, '', nan, '',
                      ())  # fmt: skip
    return learned_on(base, lacking, bench, hold)


@cache
def latched() -> Learned:
    return on_axis('latch', 'torque', 'speed')


def test_a_strange_drag_is_learned_and_the_held_out_error_falls_to_the_noise():
    found = latched()
    assert found.model is not None, found.reason
    assert found.after.validation.error_percent < 0.3 * found.before.validation.error_percent
    assert 'valid for speed from -1' in found.reason
    assert found.model.provenance['learned_torque_speed'] in found.reason
    law = effect('learned_torque_speed').laws['torque']
    own = {p.name.split('.')[1]: p.value for p in found.model.parameters if '.' in p.name}
    speed = np.linspace(-120, 120, 97)
    # viscous friction and a law over speed share what is linear: only their sum is seen
    learned = law(speed, **own) - found.model['b'] * speed
    truth = np.array([torque(LAWS.index('latch'), w, 0.0) - MOTOR['b'] * w for w in speed])
    assert np.sqrt(np.mean((learned - truth) ** 2)) < 6e-4
    for name in ('R', 'k_t', 'J'):
        assert found.model[name] == pytest.approx(MOTOR[name], rel=0.01)


def test_with_the_learned_law_nothing_is_missing_any_more():
    train, held = records('latch')
    found = diagnose([train], [held], model=latched().model, effects=['coulomb_friction'])
    assert found.verdict is Verdict.COMPLETE


def test_a_cam_is_learned_over_the_position():
    found = on_axis('cam', 'torque', 'position')
    assert found.model is not None, found.reason
    assert found.after.validation.error_percent < 0.7 * found.before.validation.error_percent
    law = effect('learned_torque_position').laws['torque']
    own = {p.name.split('.')[1]: p.value for p in found.model.parameters if '.' in p.name}
    angle = np.linspace(0, 2 * np.pi, 60)
    truth = np.array([torque(LAWS.index('cam'), 0.0, x) for x in angle])
    assert np.sqrt(np.mean((law(angle, 0.0, **own) - truth) ** 2)) < 6e-4


@pytest.mark.parametrize(('equation', 'axis'), [('torque', 'current'), ('voltage', 'speed')])
def test_a_law_on_the_wrong_axis_is_refused(equation, axis):
    """A cam is no function of current or speed: more parameters alone do not predict."""
    found = on_axis('cam', equation, axis)
    assert found.model is None
    assert found.reason.startswith('refused: ')


def test_a_diagnosis_that_finds_nothing_or_names_an_effect_leaves_nothing_to_learn():
    rng = np.random.default_rng(4)
    train = recorded('plain', volts(5.0, rng), rng)
    found = learn([train], motor='brushed_dc', effects=['gravity_load'])
    assert found.model is None
    assert found.reason == 'nothing is learned: the diagnosis says complete'
    pulled = recorded('weight', volts(5.0, rng), rng)
    found = learn([pulled], motor='brushed_dc', effects=['gravity_load', 'coulomb_friction'])
    assert found.model is None
    assert 'the diagnosis says effect missing (gravity_load)' in found.reason


def filled(key: str) -> Model:
    """Return the motor with a learned law of random values."""
    rng = np.random.default_rng(3)
    card = effect(key).card
    size = 4e-3 if 'torque' in key else 0.3
    values = {a.name: size * float(rng.standard_normal()) for a in card.amplitudes}
    if card.shapes:
        values |= {'back': 60.0 if 'speed' in key else 1.0, 'ahead': 90.0, 'fade': 20.0}
    return start().with_effect(key, values).with_provenance(**{key: 'valid somewhere'})


@pytest.mark.parametrize('key', LEARNED)
def test_a_learned_model_is_the_same_in_a_file_alone_in_a_crowd_and_step_by_step(key):
    model, record = filled(key), records('latch')[1].slice(0, 1500)
    again = parse_model(dump_model(model))
    assert again == model
    alone = simulate(again, record, ['current', 'speed'], follow_position=False)
    drive = Drive.of(record, model.kind, follow_position=False)
    values = {n: np.full(40, v) for n, v in model.parameters.values().items()}
    values['R'] = values['R'] * np.linspace(1.0, 1.2, 40)
    crowd = Program.of(model, ('current', 'speed')).run(
        values, drive, np.array([0.0, 0.0, record['position'][0]])
    )
    for j, name in enumerate(('current', 'speed')):
        np.testing.assert_array_equal(crowd[:, j, 0], alone.outputs[name])
    stepper = Stepper(model, DT)
    stepper.reset(theta=float(record['position'][0]))
    for u in record['voltage'][:200]:
        stepper.step(float(u))
    assert stepper.outputs['current'] - model['current_offset'] == pytest.approx(
        alone.outputs['current'][200], rel=1e-9
    )
    assert np.max(np.abs(alone.outputs['speed'])) > 10


@pytest.mark.parametrize('key', TABLES)
def test_a_table_has_its_values_at_the_knots_and_ends_as_it_says(key):
    model = filled(key)
    own = {p.name.split('.')[1]: p.value for p in model.parameters if p.name.startswith(key)}
    (law,) = effect(key).laws.values()
    for k, knot in enumerate(KNOTS):
        assert law(knot * own['ahead'], **own) == pytest.approx(own[f'p_{k}'])
        if k:
            assert law(-knot * own['back'], **own) == pytest.approx(own[f'm_{k}'])
    last = own['p_12']
    assert law(own['ahead'] + 10.0, **own) == pytest.approx(0.5 * last)
    assert law(own['ahead'] + 30.0, **own) == 0.0
    assert law(own['ahead'] + 1e4, **{**own, 'fade': 1e12}) == pytest.approx(last)


def test_a_law_that_is_not_held_falls_to_zero_and_what_lies_beyond_is_told():
    found = on_axis('latch', 'torque', 'speed', hold=False)
    assert found.model is not None
    assert 'zero beyond' in found.reason
    assert found.model['learned_torque_speed.fade'] < 30
    rng = np.random.default_rng(1)
    faster = recorded('latch', 1.5 * volts(2.0, rng), rng)
    (words,) = beyond_range(found.model, [faster])
    assert re.search(r'[1-9]\d % of the time of these data lies beyond', words)
    assert beyond_range(found.model, list(records('latch'))) == []


def test_learned_laws_are_fixed_afterwards_and_no_diagnosis_tries_them():
    model = latched().model
    assert not any(p.free for p in model.parameters if p.name.startswith('learned'))
    assert model.parameters['R'].free
    assert not set(LEARNED) & set(catalogue())
    with pytest.raises(UserError, match='needs'):
        Model.base('mechanical_axis').with_effect('learned_voltage_current')


def test_a_prior_of_another_model_says_nothing():
    free = start().parameters.free
    prior = Prior(('x',), np.ones(1), np.eye(1))
    mean, precision = prior.placed(free, np.ones(len(free)))
    assert not mean.any()
    assert not precision.any()


@pytest.mark.timeout(300)
def test_the_example_of_the_page_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name, record in zip(('run', 'other'), records('latch'), strict=True):
        write_record(record, Path(f'{name}.csv'))
    learned, compared = re.findall(r'^motor-sysid (.*)$', PAGE, re.MULTILINE)
    assert main([*shlex.split(learned), '--json', 'found.json']) == 0
    said = capsys.readouterr().out
    assert 'learned the unexplained torque over speed' in said
    model = load_model('learned.yaml')
    assert model.effects == ('learned_torque_speed',)
    found = json.loads(Path('found.json').read_text())
    assert found['learned']
    assert found['verdict'] == 'unknown_effect'
    before, after = found['validation_error_percent']
    assert after < 0.4 * before
    assert main(shlex.split(compared)) == 0
    error = float(re.search(r'^error ([\d.]+) %', capsys.readouterr().out, re.MULTILINE).group(1))
    assert error == pytest.approx(after, rel=0.1)
