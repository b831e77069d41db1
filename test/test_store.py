"""A model written and read again is the same, to the last bit; a bad file says what is wrong."""

from dataclasses import replace
import math

from hypothesis import example, given, settings, strategies
import pytest

from motor_sysid.errors import UserError
from motor_sysid.physics.effects import catalogue
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motors
from motor_sysid.physics.parameters import ParameterSet
from motor_sysid.physics.store import dump_model, load_model, parse_model, save_model


def fits(model, key):
    try:
        model.with_effect(key)
    except UserError:
        return False
    return True


@strategies.composite
def models(draw):
    key = draw(strategies.sampled_from(sorted(motors())))
    model = Model.base(
        key,
        speed_sensor=draw(strategies.sampled_from(SpeedSensor)),
        linear=draw(strategies.booleans()),
    )
    known = strategies.sampled_from(sorted(catalogue()))
    for name in draw(strategies.lists(known, unique=True, max_size=4)):
        if fits(model, name):
            model = model.with_effect(name)
    items = []
    for p in model.parameters:
        value = draw(strategies.floats(p.lower, p.upper, allow_nan=False))
        sigma = draw(strategies.none() | strategies.floats(0, math.inf, allow_nan=False))
        items.append(replace(p, value=value, sigma=sigma, free=draw(strategies.booleans())))
    notes = draw(strategies.dictionaries(strategies.text(), strategies.text(), max_size=3))
    return replace(model, parameters=ParameterSet(tuple(items)), provenance=notes)


@settings(deadline=None, max_examples=40)
@given(models())
@example(replace(Model.base('brushed_dc'), provenance={'a\x85b': '\x85', '\u2028': '\r\n'}))
def test_round_trip_is_exact(model):
    assert parse_model(dump_model(model)) == model


@pytest.mark.parametrize('key', motors())
def test_an_effect_begins_inside_its_boxes(key):
    """Without scales, too: what is written has to be read again."""
    base = Model.base(key)
    for name in catalogue():
        if fits(base, name):
            model = base.with_effect(name)
            assert parse_model(dump_model(model)) == model


def test_file_round_trip_keeps_infinite_sigma_and_leaves_no_stub(tmp_path):
    model = Model.base('brushed_dc', {'R': 1 / 3}).with_effect('coulomb_friction', {'tau_c': 0.02})
    model = model.with_estimates({}, {'R': 1e-3, 'L': math.inf}).with_provenance(data='abc')
    save_model(model, tmp_path / 'motor.yaml')
    assert load_model(tmp_path / 'motor.yaml') == model
    assert [p.name for p in tmp_path.iterdir()] == ['motor.yaml']


def test_a_hand_written_file_needs_little():
    text = 'schema: motor_sysid/model/1\nmotor: brushed_dc\nparameters: {R: 2, L: 1e-3}\n'
    model = parse_model(text)
    assert model['R'] == 2
    assert model['L'] == 1e-3
    assert model['k_t'] == Model.base('brushed_dc')['k_t']


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('motor_sysid/model/1', 'other/1', 'schema'),
        ('motor: brushed_dc', 'motor: steam', 'unknown motor `steam`'),
        ('key: coulomb_friction', 'key: magic', 'unknown effect `magic`'),
        ('unit: ohm', 'unit: mohm', "given in 'mohm'"),
        ('value: 1.5', 'value: -1.5', 'outside its range'),
        ('value: 1.5', 'value: .nan', 'NaN'),
        ('value: 1.5', 'value: big', 'give a number'),
        ('value: 1.5', 'value: 1' + 400 * '0', 'give a number'),
        ('motor: brushed_dc', 'motor: pmsm\nmotor: brushed_dc', 'key `motor` stands twice'),
        ('value: 1.5', 'valeu: 1.5', 'unknown entry of parameter `R` `valeu`'),
        ('  R:', '  R_a:', 'unknown parameter `R_a`'),
        ('speed_sensor: ideal', 'speed_sensor: good', 'ideal, difference or sampled'),
        ('linear: false', 'linear: no way', 'true or false'),
        ('schema', '{schema', 'not a YAML file'),
        ('effects:', 'efects:', 'unknown entry `efects`'),
        ('sigma: 0.25', 'sigma: -0.25', 'not negative'),
    ],
)
def test_a_bad_file_says_what_is_wrong(tmp_path, old, new, message):
    model = Model.base('brushed_dc', {'R': 1.5}).with_effect('coulomb_friction')
    text = dump_model(model.with_estimates({}, {'R': 0.25}))
    assert old in text
    path = tmp_path / 'bad.yaml'
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(UserError, match=r'bad\.yaml') as caught:
        load_model(path)
    assert message in str(caught.value)


def test_unreadable_files(tmp_path):
    with pytest.raises(UserError, match='cannot read'):
        load_model(tmp_path / 'absent.yaml')
    with pytest.raises(UserError, match='cannot write'):
        save_model(Model.base('brushed_dc'), tmp_path / 'no' / 'folder.yaml')
