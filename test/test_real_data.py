"""Real and independently simulated records: what the diagnosis says of them, in full.

The data are not part of the project; the tests skip where they are absent.  Nothing in the project
is tuned to them.
"""

import numpy as np
import pytest
import yaml

from motor_sysid.diagnosis import diagnose, Diagnosis, Verdict
from motor_sysid.physics.datasheet import load_datasheet
from motor_sysid.physics.effects import effect
from motor_sysid.recording import load

CASES = {
    'motor_a': ('quadratic_drag', Verdict.EFFECT_MISSING),
    'motor_b': ('inverter_dead_time', Verdict.EFFECT_MISSING),
    'motor_c': ('input_delay', Verdict.EFFECT_MISSING),
    'motor_d': ('coulomb_friction', Verdict.EFFECT_MISSING),
    'motor_e': (None, Verdict.COMPLETE),
    'motor_f': ('coulomb_friction', Verdict.EFFECT_MISSING),
    'motor_g': ('flexible_shaft', Verdict.EFFECT_MISSING),
    'motor_h': ('cogging_torque', Verdict.EFFECT_MISSING),
}
LONG = ('motor_a', 'motor_b', 'motor_c', 'motor_d', 'motor_f', 'motor_g')
"""Cases that take a part of `make test` out of proportion."""
PHASES = ('motor_b',)
"""Cases whose answers tell one error of all currents, where a model predicts d and q: the noise
that is read from the data stands for the truth's error."""


@pytest.mark.parametrize(
    'case', [pytest.param(c, marks=[pytest.mark.slow] * (c in LONG)) for c in sorted(CASES)]
)
@pytest.mark.timeout(600)
def test_hidden_effect_cases(case, data_dir):
    folder = data_dir / 'hidden_effect_cases' / case
    answers = yaml.safe_load((data_dir / 'hidden_effect_cases' / 'answers.yaml').read_text())
    truth = answers[case]['validation']['error_of_true_model_percent']
    floor = float(np.sqrt(np.mean(np.array(list(truth.values())) ** 2)))
    sheet = load_datasheet(folder / 'datasheet.yaml')
    train = [r for k in (1, 2) for r in load(folder / f'train_{k}.csv.gz').records]
    found = diagnose(
        train, load(folder / 'valid.csv.gz').records, motor=sheet.motor, nominal=sheet.nominal
    )
    effect, verdict = CASES[case]
    assert found.verdict is verdict
    assert found.effects == ((effect,) if effect else ())
    if case in PHASES:
        assert found.steps[-1].validation_error_percent < 1.03 * found.noise_floor_percent
        return
    assert found.steps[-1].validation_error_percent < 1.02 * floor
    assert found.noise_floor_percent == pytest.approx(floor, rel=0.03)


@pytest.fixture(scope='module')
def emps(data_dir) -> Diagnosis:
    loaded = load(data_dir / 'emps' / 'emps_train.csv.gz', 'emps')
    return diagnose(loaded.records, motor='mechanical_axis')


def test_emps_lacks_friction_and_an_offset_or_one_for_each_direction(emps):
    assert emps.verdict in (Verdict.EFFECT_MISSING, Verdict.AMBIGUOUS)
    assert emps.effects in (
        ('coulomb_friction', 'constant_load_torque'), ('asymmetric_coulomb_friction',)
    )  # no record can tell the two apart


def test_emps_free_run_error_falls_tenfold(emps):
    first, last = emps.steps[0], emps.steps[-1]
    assert first.validation_error_percent > 10 * last.validation_error_percent
    assert first.train_error_percent > 10 * last.train_error_percent


def test_emps_parameters_are_those_of_the_literature(emps):
    """Janot, Gautier, Brunot 2019: M 95.1 kg, Fv 203.5 N s/m, Fc 20.4 N."""
    assert emps.model['J'] == pytest.approx(95.1, rel=0.03)
    assert emps.model['b'] == pytest.approx(203.5, rel=0.1)
    own = emps.model.parameters.values()
    friction = [value for name, value in own.items() if 'friction.tau_c' in name]
    assert np.mean(friction) == pytest.approx(20.4, rel=0.1)
    assert emps.model.parameters['J'].unit == 'kg'


LAAS_MAP = """
time: {column: t_s, unit: s}
signals:
  current: {column: iq_A, unit: A}
  position: {column: position_rad, unit: rad}
"""


LAAS_RIVALS = (
    'coulomb_friction', 'stribeck_friction', 'gravity_load', 'torque_ripple', 'load_torque_step',
    'current_sensor_lag', 'periodic_load', 'quadratic_drag',
)  # fmt: skip


@pytest.fixture(scope='module')
def laas_map(data_dir, tmp_path_factory) -> Diagnosis:
    """Diagnose what holds a synchronous motor at each position: a turn forward, then back."""
    config = tmp_path_factory.mktemp('laas') / 'map.yaml'
    config.write_text(LAAS_MAP)
    record = load(data_dir / 'laas_cogging' / 'standstill_map.csv.gz', config).records[0]
    turn = int(np.argmax(record['position']))
    both = [record.slice(0, turn), record.slice(turn, len(record))]
    cogging = [one.key for one in effect('cogging_torque').repeated()]
    return diagnose(both, motor='inverse_axis', effects=(*cogging, *LAAS_RIVALS))


def test_laas_cogs_as_its_magnets_and_slots_tell(laas_map):
    """24 magnets and 18 slots: 72 waves a turn, the slots', and half of the magnets'."""
    assert laas_map.verdict is Verdict.EFFECT_MISSING
    assert laas_map.steps[1].model.effects == ('cogging_torque',)
    waves = [laas_map.model[f'{one.key}.n'] for one in effect('cogging_torque').repeated()]
    assert waves == [72.0, 18.0, 12.0]
    size = np.hypot(laas_map.model['cogging_torque.a_1'], laas_map.model['cogging_torque.b_1'])
    assert size == pytest.approx(0.184, rel=0.05)
    assert laas_map.model['coulomb_friction.tau_c'] == pytest.approx(0.053, rel=0.1)


def test_laas_current_error_falls_more_than_fourfold(laas_map):
    first, last = laas_map.steps[0], laas_map.steps[-1]
    assert first.validation_error_percent > 6 * last.validation_error_percent
