"""Brushless motors on six-step drives: the model, its commutation, and what is told of it."""

from functools import cache

import numpy as np
import pytest

from motor_sysid.benchmark import three_phase_cases
from motor_sysid.benchmark.three_phase_cases import draw, schedule, ThreePhaseCase
from motor_sysid.benchmark.three_phase_judge import described, owns
from motor_sysid.benchmark.three_phase_rig import Sensors
from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.diagnosis.search.bench import prepared_parts
from motor_sysid.diagnosis.search.motor_kind import choose_kind, told_kind
from motor_sysid.errors import UserError
from motor_sysid.estimation.online import OnlineIdentifier
from motor_sysid.physics.datasheet import load_datasheet
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.effect_file import load_effect
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.physics.rollout import Program
from motor_sysid.signals.hall import (
    angle_offset_of,
    electrical_angle_of,
    pole_pairs_of,
    sector_codes,
    within_sectors,
)
from motor_sysid.signals.phases import hall_sector, SECTOR
from motor_sysid.signals.record import Record

KIND = motor('bldc_six_step')
IDEAL = Sensors(1e-9, 0.0, 1e-9, np.zeros(3))
DIODES = 1.4


@cache
def case(name: str, seconds: float = 3.0, *, ideal: bool = False) -> ThreePhaseCase:
    """Return a case of the independent simulator, which knows phases and legs."""
    with pytest.MonkeyPatch.context() as patch:
        if ideal:
            patch.setattr(three_phase_cases, '_sensors', lambda sheet, rng: IDEAL)
        return draw(name, 0, seconds)


def true_values(one: ThreePhaseCase) -> dict[str, float]:
    m = one.hidden.machine
    return {'R': 2 * m.R, 'L': 2 * m.L_d, 'k_t': 2 * m.k_e, 'J': m.J, 'b': m.b}


def true_model(one: ThreePhaseCase) -> Model:
    more = {'pole_pairs': one.hidden.machine.pole_pairs, 'v_free': one.sheet.supply + DIODES}
    values = {**true_values(one), **more}
    model = Model.base('bldc_six_step', values, speed_sensor=SpeedSensor.DIFFERENCE)
    if one.hidden.dead:
        dead = {'v_d': 2 * one.hidden.dead, 'i_0': one.hidden.band}
        model = model.with_effect('inverter_dead_time', dead)
    return model


def errors(model: Model, record: Record, substeps: int) -> np.ndarray:
    """Return the RMS errors of current and speed, in units of the signals."""
    program = Program.of(model, ('current', 'speed'))
    values = {name: np.array([model[name]]) for name in program.names}
    out = program.run(values, Drive.of(record, model.kind), np.zeros((1, 3)), substeps=substeps)
    measured = np.column_stack([record['current'], record['speed']])
    left = measured - out[:, :, 0]
    return np.sqrt(np.mean(left**2, axis=0) / np.mean(measured**2, axis=0))


@pytest.mark.parametrize(
    ('name', 'most'),
    [('six_step/complete/0', 0.001), ('six_step/inverter_dead_time/10/0', 0.015)],
)
def test_it_is_what_phases_legs_and_diodes_do(name, most):
    """The true parameters follow a simulation of the three phases, without any fit."""
    one = case(name, ideal=True)
    for record in (*one.train, *one.valid):
        current, speed = errors(true_model(one), record, 4)
        assert current < most
        assert speed < most


def test_sectors_and_a_speed_take_the_place_of_an_encoder():
    """The rotor's angle is that of the model, within the sector that is shown."""
    one = case('six_step/complete/0', ideal=True)
    halls = [r.select([n for n in r if n != 'position']) for r in (*one.train, *one.valid)]
    records, _ = prepared_parts(halls, (), one.motor, one.nominal)
    for record in records:
        width = SECTOR / one.nominal['pole_pairs']
        assert record.step_of('position') == pytest.approx(width, rel=1e-5)
        assert np.all(errors(true_model(one), record, 4) < [0.01, 1e-4])


def test_a_position_that_is_compared_stays_within_its_count():
    """Where laws of the motor read it: commutation is there to the sample."""
    one = case('six_step/complete/0')
    model, record = true_model(one), one.train[0]
    program = Program.of(model, ('current', 'position'))
    values = {name: np.array([model[name]]) for name in program.names}
    drive = Drive.of(record, model.kind)
    out = program.run(values, drive, np.zeros((1, 3)), substeps=8)
    assert np.max(np.abs(out[:, 1, 0] - record['position'])) < drive.count


def test_one_step_between_two_commutations_is_nearly_enough():
    one = case('six_step/complete/0', ideal=True)
    assert np.all(errors(true_model(one), one.train[0], 1) < 0.01)


def test_a_motor_without_commutation_is_far_off():
    one = case('six_step/complete/0', ideal=True)
    plain = Model.base('brushed_dc', true_values(one), speed_sensor=SpeedSensor.DIFFERENCE)
    assert errors(plain, one.train[0], 4)[0] > 100 * errors(true_model(one), one.train[0], 4)[0]


def test_the_current_halves_where_a_sector_begins():
    """A shaft that is turned passes 30 degrees half a sample before the second sample."""
    model = Model.base(
        'bldc_six_step', {'R': 1.0, 'L': 1e-2, 'k_t': 1e-6, 'J': 1e3, 'pole_pairs': 1.0}
    )
    program = Program.of(model, ('current',))
    angle = np.pi / 6 + 0.02 * (np.arange(4) - 1.5)
    values = {name: np.array([model[name]]) for name in program.names}
    drive = Drive(np.zeros((4, 1)), 1e-4, position=angle)
    i = program.run(values, drive, np.array([1.0, 0.0, 0.0]))[:, 0, 0]
    fades = np.exp(-1e-4 / 1e-2)
    assert i == pytest.approx([1.0, fades, 0.5 * fades**2, 0.5 * fades**3], rel=1e-6)


def test_any_law_may_move_a_state_at_once():
    """A file of one's own: a detent that takes half of the speed at each full turn."""
    from types import ModuleType

    source = (
        'import numpy as np\n'
        'from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale\n'
        "CARD = Card('detent', 'omega -> (1 - s) omega', 'steps', 'none', Enters.MECHANICAL,\n"
        "            (Amplitude('s', '1', 'share', Scale.ONE, 1.0, positive=True),))\n"
        'def jump_omega(omega, theta, theta_before, s):\n'
        '    passed = np.floor(theta / 6.283185307) - np.floor(theta_before / 6.283185307)\n'
        '    return -s * omega * np.abs(passed)\n'
    )
    module = ModuleType('detent')
    exec(source, module.__dict__)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('motor_sysid.physics.effect.inspect.getsource', lambda _: source)
        one = load_effect('detent', module)
    program = Program(motor('brushed_dc'), [one], ('speed',))
    model = Model.base('brushed_dc', {'b': 1e-12, 'k_t': 1e-6, 'J': 1.0})
    values = {n: np.array([model[n]]) for n in program.names if n != 'detent.s'}
    values['detent.s'] = np.array([0.0, 0.5])
    values = {n: np.broadcast_to(v, 2) for n, v in values.items()}
    speed = program.run(values, Drive(np.zeros((12, 1)), 0.1), np.array([0.0, 10.0, 0.0]))
    assert speed[-1, 0, 0] == pytest.approx(10.0, rel=1e-6)
    assert speed[-1, 0, 1] == pytest.approx(5.0, rel=1e-6)


def test_parameters_are_recovered_from_a_start_that_is_read_from_the_records():
    one = case('six_step/complete/0', 5.0)
    found = diagnose(one.train, one.valid, motor=one.motor, nominal=one.nominal, effects=[
        'coulomb_friction', 'quadratic_drag',
    ])  # fmt: skip
    assert found.verdict is Verdict.COMPLETE
    assert found.effects == ()
    for name, value in true_values(one).items():
        assert found.model[name] == pytest.approx(value, rel=0.01 if name != 'b' else 0.1), name


@pytest.mark.slow
def test_the_supply_is_fitted_where_no_sheet_tells_it():
    one = case('six_step/complete/0')
    told = fit_model(one.train, one.valid, motor=one.motor, nominal=one.nominal).model
    assert told['v_free'] == one.sheet.supply
    untold = {name: value for name, value in one.nominal.items() if name != 'v_free'}
    fitted = fit_model(one.train, one.valid, motor=one.motor, nominal=untold).model
    assert max(np.max(np.abs(r['voltage'])) for r in one.train) < 0.9 * one.sheet.supply
    assert fitted['v_free'] == pytest.approx(one.sheet.supply + DIODES, rel=0.1)


def test_hidden_friction_is_named():
    one = case('six_step/coulomb_friction/10/0', 4.0)
    found = diagnose(one.train, one.valid, motor=one.motor, nominal=one.nominal)
    assert found.verdict is Verdict.EFFECT_MISSING
    assert found.effects == ('coulomb_friction',)
    true = one.hidden.machine.tau_c
    assert found.model['coulomb_friction.tau_c'] == pytest.approx(true, rel=0.02)
    assert found.steps[-1].validation_error_percent < 1.2 * found.noise_floor_percent


def test_offsets_of_the_phases_have_their_sign(monkeypatch):
    """Three sensors, one in each phase, of which the current of the pair shows two at a time."""
    offsets = np.array([0.3, -0.1, 0.05])
    sensors = Sensors(2 * np.pi / 8192, 0.005, 0.002, offsets)
    monkeypatch.setattr(three_phase_cases, '_sensors', lambda sheet, rng: sensors)
    one = draw('six_step/complete/0', 0, 2.0)
    nominal = {'pole_pairs': one.hidden.machine.pole_pairs}
    model = fit_model(one.train[:1], motor='bldc_six_step', nominal=nominal).model
    a, b, c = offsets
    assert model['current_offset_a'] == pytest.approx(a - c, abs=0.01)
    assert model['current_offset_b'] == pytest.approx(b - c, abs=0.01)


def test_signals_tell_the_kind_and_pole_pairs():
    one = case('six_step/complete/0', 4.0)
    assert told_kind(one.train, None) == 'bldc_six_step'
    assert told_kind(one.train, 'brushed_dc') == 'brushed_dc'
    assert told_kind([r.select(['voltage', 'current', 'speed']) for r in one.train], None) is None
    records, _ = prepared_parts(one.train, (), 'bldc_six_step', {})
    assert choose_kind(records, 'bldc_six_step') is KIND
    begun = KIND.start(records, {})
    assert begun['pole_pairs'] == one.hidden.machine.pole_pairs
    assert begun['k_t'] == pytest.approx(true_values(one)['k_t'], rel=0.05)


def test_regressions_refuse_and_filters_follow():
    one = case('six_step/complete/0', 4.0)
    start = {name: 1.3 * value for name, value in true_values(one).items()}
    records, _ = prepared_parts(one.train, (), 'bldc_six_step', one.nominal)
    pairs = one.hidden.machine.pole_pairs
    offset = angle_offset_of(records, pairs)
    model = Model.base(
        'bldc_six_step', {**start, 'pole_pairs': pairs, 'angle_offset': offset},
        speed_sensor=SpeedSensor.DIFFERENCE,
    )  # fmt: skip
    outputs = ['current', 'speed', 'position']
    with pytest.raises(UserError, match='use `ekf`'):
        OnlineIdentifier(model, 'rls', 1e-3, ['voltage'], outputs)
    for estimator in ('ekf', 'ukf'):
        online = OnlineIdentifier(model, estimator, 1e-3, ['voltage'], outputs)
        record = records[0]
        online.update(
            record.time, record['voltage'], np.column_stack([record[name] for name in outputs])
        )
        found = online.estimate()
        for name in ('R', 'k_t', 'J'):
            assert found[name].value == pytest.approx(true_values(one)[name], rel=0.03), name


def hall_record(pairs: float, offset: float, step: float, start: int) -> Record:
    """Return a shaft that swings over two turns, its encoder and its Hall sectors."""
    time = 1e-3 * np.arange(4000)
    theta = 2 * np.pi * np.sin(2.0 * time) + 0.3
    sector = hall_sector(pairs * theta + offset) - 1 + start
    signals = {
        'position': step * np.floor(theta / step), 'hall_sector': sector.astype(np.float64)
    }
    return Record(time, signals, {'position': 'rad', 'hall_sector': '1'})


@pytest.mark.parametrize('start', [0, 1])
@pytest.mark.parametrize('offset', [0.0, 1.0, -2.5])
def test_pole_pairs_and_offset_are_read_from_the_sectors(offset, start):
    step = 2 * np.pi / 2000
    record = hall_record(7.0, offset, step, start)
    assert pole_pairs_of([record]) == 7
    found = angle_offset_of([record], 7.0)
    assert found == pytest.approx(offset + 7.0 * step / 2, abs=0.2 * 7.0 * step), 'half a count'
    inside = within_sectors(record, 7.0, found)
    assert np.max(np.abs(inside['position'] - record['position'])) < 1.1 * step
    for end in (-step / 2, step / 2):
        place = (7.0 * (inside['position'] + end) + found) / SECTOR - 0.5
        assert np.all(np.floor(place) % 6 == sector_codes(record['hall_sector']) - 1)
    assert inside.step_of('position') == pytest.approx(step)
    assert Drive.of(inside.with_signal('voltage', 0 * inside.time, 'V'), KIND).count > 0
    assert angle_offset_of([inside], 7.0) == pytest.approx(found, abs=1e-6)


def test_the_side_of_an_edge_is_that_of_the_sector_where_a_count_lies_across_it():
    """Slow turns at large currents, which are half as large a sample too early or too late.

    A count that means both sides made errors of up to 1.8 A here.
    """
    one = draw('six_step/complete/3', 16)
    records, _ = prepared_parts(one.train, (), one.motor, one.nominal)
    pairs = one.hidden.machine.pole_pairs
    model = true_model(one).with_values({'angle_offset': angle_offset_of(records, pairs)})
    program = Program.of(model, ('current',))
    values = {name: np.array([model[name]]) for name in program.names}
    drive, start = Drive.of(records[0], KIND), np.zeros((1, 3))
    current = program.run(values, drive, start, substeps=4)[:, 0, 0]
    assert np.max(np.abs(records[0]['current'])) > 4.0
    assert np.max(np.abs(current - records[0]['current'])) < 0.2


def test_sectors_are_counted_from_zero_or_one():
    assert list(sector_codes(np.array([0.0, 5.0]))) == [1, 6]
    assert list(sector_codes(np.array([1.0, 6.0]))) == [1, 6]
    with pytest.raises(UserError, match='goes from 0 to 6'):
        sector_codes(np.array([0.0, 6.0]))
    codes = np.repeat(np.tile(np.arange(6.0), 4), 5)
    assert np.ptp(electrical_angle_of(codes, 1e-3 * np.arange(codes.size))) > 20.0


def test_a_speed_tells_how_many_sectors_are_passed_between_two_samples():
    """A turn of up to four sectors in a sample, whose sectors alone could be any turn."""
    time = 1e-3 * np.arange(2000)
    speed = 4.0 * SECTOR / 1e-3 * np.sin(2 * np.pi * time)
    angle = 4.0 * SECTOR / 1e-3 * (1 - np.cos(2 * np.pi * time)) / (2 * np.pi) + 1.0
    sectors = hall_sector(angle).astype(np.float64)
    noise = np.random.default_rng(1).normal(0.0, 0.2 * SECTOR / 1e-3, time.size)
    off = electrical_angle_of(sectors, time, speed + noise) - angle
    assert np.max(np.abs(off)) < SECTOR
    with pytest.raises(UserError, match='record faster or with the speed'):
        electrical_angle_of(sectors, time)
    with pytest.raises(UserError, match=r'where the speed tells .* check `pole_pairs`'):
        electrical_angle_of(7.0 - sectors, time, 0.1 * speed)


@pytest.mark.parametrize('wrong', ['gray', 'backward', 'pairs'])
def test_sectors_that_do_not_go_with_the_position_are_refused(wrong):
    record, pairs = hall_record(3.0, 0.0, 1e-3, 1), 3.0
    sector, position = record['hall_sector'], record['position']
    if wrong == 'gray':
        gray = np.array([5.0, 4.0, 6.0, 2.0, 3.0, 1.0])
        record = record.with_signal('hall_sector', gray[sector.astype(int) - 1], '1')
    elif wrong == 'backward':
        record = record.with_signal('position', -position, 'rad')
    else:
        pairs = 4.0
    with pytest.raises(UserError, match='in the order of a forward turn'):
        angle_offset_of([record], pairs)


def test_without_sectors_the_offset_is_none_and_pairs_are_asked_for():
    record = hall_record(3.0, 0.0, 1e-3, 1).select(['position'])
    assert angle_offset_of([record], 3.0) == 0.0
    with pytest.raises(UserError, match='give `pole_pairs`'):
        pole_pairs_of([record])
    assert within_sectors(record, 3.0, 0.0) is record


SHEET = """
motor_type: {kind}
supply_voltage_V: 24.0
nominal:
  {resistance}: 2.0
  inductance_line_line_H: 0.002
  back_emf_constant_line_line_Vs_per_rad: 0.04
  pole_pairs: 4
"""


@pytest.mark.parametrize(
    ('kind', 'resistance', 'expected', 'inductance'),
    [
        ('bldc_six_step', 'resistance_line_line_ohm', 2.0, 0.002),
        ('bldc_six_step', 'phase_resistance_ohm', 4.0, 0.002),
        ('bldc', 'resistance_line_line_ohm', 1.0, 0.001),
    ],
)
def test_data_sheets_tell_phases_or_terminals(tmp_path, kind, resistance, expected, inductance):
    path = tmp_path / 'sheet.yaml'
    path.write_text(SHEET.format(kind=kind, resistance=resistance))
    sheet = load_datasheet(path)
    assert sheet.motor == kind
    assert sheet.nominal['R'] == expected
    assert sheet.nominal['L'] == inductance
    assert sheet.nominal['v_free'] == 24.0
    assert sheet.nominal.get('k_t') == (0.04 if kind == 'bldc_six_step' else None)
    path.write_text(SHEET.replace('motor_type: {kind}', '').format(resistance=resistance))
    assert load_datasheet(path, kind).nominal == sheet.nominal, 'as the command line names it'


def test_the_benchmark_draws_both_kinds_and_complete_ones():
    names = schedule(120)
    assert len(set(names)) == 120
    assert names[:4] == [
        'six_step/complete/0', 'pmsm/complete/0', 'six_step/coulomb_friction/3/0',
        'pmsm/coulomb_friction/3/0',
    ]  # fmt: skip
    assert sum('/complete/' in name for name in names) == 40
    assert not any(name.startswith('six_step/emf_harmonics') for name in names)
    assert all(owns(name) for name in names)
    assert not owns('complete/0')
    assert described('pmsm/cogging_torque/10/3').effects == ('cogging_torque',)
    with pytest.raises(UserError, match='names look like'):
        draw('six_step/emf_harmonics/3/0', 0)


def test_a_synchronous_motor_of_the_benchmark_is_that_of_the_model():
    one = case('pmsm/complete/0', ideal=True)
    m = one.hidden.machine
    model = Model.base('pmsm', {
        'R': m.R, 'L_d': m.L_d, 'L_q': m.L_q, 'psi_f': m.k_e / m.pole_pairs, 'J': m.J, 'b': m.b,
        'pole_pairs': m.pole_pairs,
    }, speed_sensor=SpeedSensor.DIFFERENCE)  # fmt: skip
    program = Program.of(model, ('current_d', 'current_q', 'speed'))
    values = {name: np.array([model[name]]) for name in program.names}
    for record in one.train:
        out = program.run(values, Drive.of(record, model.kind), np.zeros((1, 4)), substeps=4)
        for k, name in enumerate(program.outputs):
            left = record[name] - out[:, k, 0]
            assert np.std(left) < 1e-3 * np.std(record[name]), name
