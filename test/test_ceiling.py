"""The ceiling: a complete model is at it, a model that lacks friction is below, and says so."""

import json
from pathlib import Path
import re

from bench_motor import a_motor, MOTOR, records
import numpy as np
import pytest

from motor_sysid.cli import main
from motor_sysid.diagnosis.ceiling import ceiling, MODEL, words
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import refit
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.store import save_model
from motor_sysid.structures import KINDS

FRICTION = {'coulomb_friction': {'tau_c': 0.03}}
SOME = ('arx', 'ss', 'network')
PAGE = (Path(__file__).resolve().parent.parent / 'docs' / 'structures.md').read_text()


@pytest.fixture(scope='module')
def data():
    return records(FRICTION, ('steps',), seconds=4.0)


def fitted(data, *effects):
    values = {name: MOTOR[name] for name in ('R', 'L', 'k_t', 'J', 'b')}
    model = Model.base('brushed_dc', {**values, 'omega_eps': 0.3},
                       speed_sensor=SpeedSensor.DIFFERENCE)  # fmt: skip
    for key in effects:
        model = model.with_effect(key, {'tau_c': 0.02})
    return refit(model, [r.split(0.2)[0] for r in data], 'least_squares').model


def test_a_complete_model_is_at_the_ceiling(data):
    found = ceiling(fitted(data, 'coulomb_friction'), data, kinds=SOME)
    assert found.share_percent > 99.9
    assert found.best['speed'] == MODEL
    assert 'no structure explains more' in ' '.join(words(found))


def test_a_model_that_lacks_friction_is_below_a_network(data):
    found = ceiling(fitted(data), data, kinds=SOME)
    assert found.share_percent < 99.5
    assert found.best['speed'] != MODEL
    model, best = found.rows[0], next(r for r in found.rows if r.key == found.best['speed'])
    assert best.errors_percent['speed'] < 0.7 * model.errors_percent['speed']
    assert 'times smaller' in ' '.join(words(found))
    assert {row.key for row in found.rows} == {MODEL, *SOME}


def test_questions_that_have_no_answer(data):
    model = a_motor({})
    with pytest.raises(UserError, match='unknown structure `magic`'):
        ceiling(model, data, kinds=('magic',))
    with pytest.raises(UserError, match='leaves too little'):
        ceiling(model, data, kinds=SOME, hold_back=0.001)


def test_data_are_prepared_as_for_a_fit(data):
    """A stray sample says nothing of a model; a motion that is given is derived first."""
    (record,) = data
    model = fitted(data, 'coulomb_friction')
    speed = record['speed'].copy()
    speed[3700] += 300.0
    clean, stray = (
        ceiling(model, [one], kinds=('arx',)).rows[0].errors_percent['speed']
        for one in (record, record.with_signal('speed', speed, 'rad/s'))
    )
    assert stray == pytest.approx(clean, rel=0.02)
    axis = Model.base('inverse_axis', {'J': 2.6e-5, 'b': 1.3e-5, 'k_t': 0.046})
    assert ceiling(axis, data, kinds=('arx',)).share_percent > 0.0


def test_on_the_command_line(data, tmp_path, capsys):
    path, model, result = tmp_path / 'run.csv', tmp_path / 'model.yaml', tmp_path / 'out.json'
    (record,) = data
    header = ','.join(['time [s]', *(f'{n} [{record.units[n]}]' for n in record)])
    table = np.column_stack([record.time, *record.signals.values()])
    np.savetxt(path, table, delimiter=',', header=header, comments='')
    save_model(fitted(data), model)
    assert main(['compare', str(model), 'none.csv', '--ceiling', 'nope']) == 2
    assert 'unknown structure `nope`' in capsys.readouterr().err
    assert main(['compare', str(model), str(path), '--hold-back', '0.3']) == 2
    assert 'is the part that --ceiling judges on; give that, too' in capsys.readouterr().err
    assert main(['compare', str(model), str(path), '--ceiling', 'arx', '--json', str(result)]) == 0
    said = capsys.readouterr().out
    assert re.search(r'your physical model explains [\d.]+ % of what any model explains', said)
    told = json.loads(result.read_text())['ceiling']
    assert [row['key'] for row in told['models']] == [MODEL, 'arx']
    assert 0 < told['share_percent'] <= 100


def test_the_example_of_the_page_runs(data, tmp_path, monkeypatch, capsys):
    (block,) = re.findall(r'```python\n(.*?)```', PAGE, flags=re.DOTALL)
    (record,) = data
    header = ','.join(['time [s]', *(f'{n} [{record.units[n]}]' for n in record)])
    monkeypatch.chdir(tmp_path)
    table = np.column_stack([record.time, *record.signals.values()])
    np.savetxt('run1.csv', table, delimiter=',', header=header, comments='')
    exec(compile(block, 'structures.md', 'exec'), {})
    assert re.search(r'free-run error [\d.]+ %', capsys.readouterr().out)


def test_the_page_lists_every_structure():
    assert re.findall(r'^\| `(\w+)` \|', PAGE, flags=re.MULTILINE) == list(KINDS)
