"""What the benchmark draws: sound motors, the same every time, in the mixture that it names."""

from collections import Counter
from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from unittest.mock import patch

from benchmark_tools import result
import numpy as np
import pytest

from motor_sysid.benchmark import cases, reference
from motor_sysid.benchmark.answers import start_values, true_base_values, true_effect_values
from motor_sysid.benchmark.cases import draw
from motor_sysid.benchmark.datasheets import DATA_SHEETS, geared
from motor_sysid.benchmark.diagnosis import offered
from motor_sysid.benchmark.hidden import HIDE
from motor_sysid.benchmark.hidden_sensors import HIDE_SENSOR
from motor_sysid.benchmark.scenarios import (
    case_name,
    Category,
    named_case,
    pairs,
    Scenario,
    schedule,
)
from motor_sysid.errors import UserError
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.model import Model, SpeedSensor

COUNT = 2000

LONG = cases._setting


def drawn(scenario, seed=1, number=2):
    """Draw a case with records of two seconds."""
    with patch.object(cases, '_setting', lambda rng: replace(LONG(rng), duration=2.0)):
        return draw(scenario, seed, number)


short = cache(drawn)


@pytest.mark.parametrize('sheet', DATA_SHEETS, ids=lambda s: s.name)
def test_a_data_sheet_agrees_with_itself(sheet):
    assert sheet.source
    stall = sheet.k * sheet.voltage / sheet.R
    assert sheet.torque < stall
    electrical, mechanical = sheet.L / sheet.R, sheet.J * sheet.R / sheet.k**2
    assert 1e-6 < electrical < mechanical < 0.1
    top_rpm = sheet.top_speed * 60 / (2 * np.pi)
    assert 100 < top_rpm < 20_000


def test_a_gear_keeps_power_and_time_constants():
    motor = DATA_SHEETS[3]
    slow = geared(motor, 10, (0.1, 1.0), (1000,), (200,))
    assert slow.torque * slow.top_speed == pytest.approx(motor.torque * motor.top_speed)
    assert slow.J * slow.R / slow.k**2 == pytest.approx(motor.J * motor.R / motor.k**2)


def test_the_mixture_is_what_the_documentation_says():
    drawn = [scenario for scenario, _ in schedule(COUNT)]
    count = Counter(s.category for s in drawn)
    assert count[Category.COMPLETE] == COUNT / 4
    assert count[Category.SINGLE] == 3 * COUNT / 8
    assert count[Category.PAIR] == COUNT / 8
    assert count[Category.WITHHELD] == COUNT / 4
    single = {(s.effects[0], s.size) for s in drawn if s.category is Category.SINGLE}
    keys = {*HIDE, *HIDE_SENSOR}
    assert single == {(key, size) for key in keys for size in (0.01, 0.03, 0.1)}


def test_a_longer_benchmark_begins_like_a_shorter_one():
    assert list(schedule(100)) == list(schedule(300))[:100]
    names = [case_name(*one) for one in schedule(COUNT)]
    assert len(set(names)) == COUNT


def test_a_case_has_a_name_that_finds_it():
    for scenario, number in schedule(200):
        assert named_case(case_name(scenario, number)) == (scenario, number)
    for wrong in ('', 'complete', 'complete/x', 'single/coulomb_friction/3', 'single/magic/3/0'):
        with pytest.raises(UserError, match='no case'):
            named_case(wrong)


def test_pairs_do_not_undo_each_other():
    found = pairs(['coulomb_friction', 'stribeck_friction', 'cogging_torque'])
    assert ('coulomb_friction', 'cogging_torque') in found
    assert ('coulomb_friction', 'stribeck_friction') not in found


def test_what_is_withheld_is_not_offered_in_a_more_general_form():
    left = offered(Scenario(('coulomb_friction',), 0.1, withheld=True))
    assert 'coulomb_friction' not in left
    assert 'stribeck_friction' not in left
    assert 'cogging_torque' in left
    assert offered(Scenario(('coulomb_friction',), 0.1)) == list(catalogue())


def test_a_case_is_drawn_the_same_twice_and_is_sound():
    scenario = Scenario(('stribeck_friction', 'cogging_torque'), 0.03)
    one, other = (drawn(scenario, 3, 5) for _ in range(2))
    assert [r.digest() for r in one.train] == [r.digest() for r in other.train]
    assert one.train[0].digest() != drawn(scenario, 4, 5).train[0].digest()
    assert one.train[0].digest() != drawn(scenario, 3, 6).train[0].digest()
    assert len(one.train) == 2
    assert len(one.valid) == 1
    for record in (*one.train, *one.valid):
        assert record.duration == pytest.approx(2.0, abs=2 * record.dt)
        assert np.all(record['voltage'][: int(0.4 / record.dt)] == record['voltage'][0])
        assert np.ptp(record['speed']) > 0


def test_records_take_10_to_15_seconds():
    durations = {LONG(np.random.default_rng(k)).duration for k in range(100)}
    assert (min(durations), max(durations)) == (10.0, 15.0)


@pytest.mark.parametrize('key', [*HIDE, *HIDE_SENSOR])
def test_every_effect_can_be_hidden_and_is_seen(key):
    case = short(Scenario((key,), 0.1))
    assert all(np.all(np.isfinite(record[name])) for record in case.train for name in record)
    plain = short(Scenario(())).setting
    same = (plain.sheet, plain.plant, plain.sensors)
    assert (plain.sheet, case.setting.plant, case.setting.sensors) != same


@pytest.mark.parametrize('key', sorted({*HIDE, *HIDE_SENSOR} & set(catalogue())))
def test_true_values_belong_to_parameters_of_the_effect(key):
    case = short(Scenario((key,), 0.1))
    own = {p.name for p in catalogue()[key].card.parameters}
    start = start_values(case, key)
    assert start is None or set(start) <= own
    for name, value in true_effect_values(case).items():
        assert name.split('.')[1] in own
        assert np.isfinite(value)


def test_the_scale_of_the_current_sensor_hides_in_the_base_parameters():
    case = short(Scenario(('current_sensor_scale',), 0.1))
    plant, scale = case.setting.plant, case.setting.sensors.current_scale
    assert abs(scale - 1) == pytest.approx(0.1)
    assert true_base_values(case)['R'] == pytest.approx(plant.R / scale)
    assert true_base_values(case)['J'] == pytest.approx(plant.J * scale)
    assert true_base_values(case, ('current_sensor_scale',))['R'] == plant.R


@pytest.mark.parametrize(
    ('key', 'sensor'),
    [('speed_sensor_offset', SpeedSensor.IDEAL), ('coulomb_friction', SpeedSensor.DIFFERENCE)],
)
def test_the_true_structure_has_a_sensor_that_takes_it(key, sensor, monkeypatch):
    """Counts have no offset: a diagnosis that began with them is compared with one that has."""
    case, begun = short(Scenario((key,), 0.1)), []

    def fit_model(train, valid, *, model, effects, lent):
        begun.append((model, effects))
        return SimpleNamespace(model=model, validation=SimpleNamespace(error_percent=1.0))

    monkeypatch.setattr(reference, 'fit_model', fit_model)
    base = Model.base('brushed_dc', speed_sensor=SpeedSensor.DIFFERENCE)
    diagnosis = SimpleNamespace(steps=[SimpleNamespace(model=base)], lent=False)
    found = reference.with_reference(result((key,)), case, diagnosis)
    ((model, unstarted),) = begun
    assert model.speed_sensor is sensor
    assert {*model.effects, *unstarted} == {key}
    assert model['R'] == pytest.approx(case.setting.plant.R, rel=1e-3)
    assert found.reference == 1.0
