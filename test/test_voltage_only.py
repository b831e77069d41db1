"""The benchmark of motors whose current is not measured."""

import pytest

from motor_sysid.benchmark.diagnosis import one, Task
from motor_sysid.benchmark.outcome import Outcome
from motor_sysid.benchmark.suites import suite_of, SUITES
from motor_sysid.benchmark.voltage_only import described, EFFECTS, KIND, owns, schedule
from motor_sysid.errors import UserError
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.model import Model


def test_a_third_of_the_cases_is_complete_and_no_name_comes_twice():
    names = schedule(126)
    assert len(set(names)) == 126
    assert names[:3] == [
        'voltage_only/complete/0', 'voltage_only/coulomb_friction/3/0',
        'voltage_only/stribeck_friction/3/0',
    ]  # fmt: skip
    assert sum('/complete/' in name for name in names) == 42
    assert {described(name).effects for name in names} == {(), *((key,) for key in EFFECTS)}


def test_what_is_hidden_is_in_the_catalogue_of_such_a_motor():
    assert all(Model.base(KIND).admits(catalogue()[key]) for key in EFFECTS)


def test_each_suite_knows_its_own_cases():
    for name, suite in SUITES.items():
        assert all(suite_of(case) is suite for case in suite.schedule(12)), name
    assert suite_of('single/coulomb_friction/3/0') is None
    assert not owns('complete/0')


@pytest.mark.parametrize('name', ['voltage_only/supply_sag/3/0', 'voltage_only/complete/3/x/1'])
def test_an_unknown_case_is_refused_with_names_that_there_are(name):
    with pytest.raises(UserError, match='names look like `voltage_only/coulomb_friction'):
        described(name)


@pytest.mark.parametrize(
    ('name', 'seed', 'named'),
    [
        ('voltage_only/complete/4', 51, ()),
        pytest.param(
            'voltage_only/speed_sensor_lag/10/0', 51, ('speed_sensor_lag',),
            marks=pytest.mark.slow,
        ),
        ('voltage_only/inertia_change/3/0', 51, ('inertia_change',)),
    ],
)
def test_cases_are_judged_beside_the_inductance_of_the_winding(name, seed, named):
    result = one(Task(name, seed))
    assert result.error == ''
    assert (result.outcome, result.named) == (Outcome.RIGHT, named)
    assert result.after < 1.1 * result.reference, 'the reference has an inductance as well'
