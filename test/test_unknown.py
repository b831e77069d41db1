"""What the catalogue does not know: the axis on which it lives, and its shape."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
import re

from bench_motor import a_motor, CURRENT_NOISE, measure, records, voltage_profile
import numpy as np
import pytest

from motor_sysid.benchmark.cases import draw
from motor_sysid.benchmark.scenarios import named_case
from motor_sysid.diagnosis import diagnose, Verdict
from motor_sysid.diagnosis.fitting import fit_model
from motor_sysid.diagnosis.result.figures import apart, with_unit
from motor_sysid.diagnosis.result.findings import AxisShare, Unknown
from motor_sysid.diagnosis.where.shapes import shapes_of, standing_orders
from motor_sysid.diagnosis.where.unknown import _named, _nowhere, unknown_of
from motor_sysid.diagnosis.where.where import failure_of
from motor_sysid.physics.effects import add_effect_file, catalogue
from motor_sysid.signals.record import Record

SIGMAS = {'current': CURRENT_NOISE, 'speed': 2 * np.pi / 4096 / 1e-3 / np.sqrt(6)}
TAU = 6e-3

HIDDEN = {
    'coulomb_friction': {'tau_c': TAU},
    'quadratic_drag': {'k_d': 4e-7},
    'constant_load_torque': {'tau_l': TAU},
    'gravity_load': {'tau_sin': TAU, 'tau_cos': 2e-3},
    'cogging_torque': {'a_1': 4e-3, 'b_1': 3e-3, 'n': 11},
    'brush_voltage_drop': {'v_b': 0.5},
    'armature_heating': {'h': 3e-2, 't_th': 5.0},
    'input_delay': {'delay': 3.4e-3},
    'load_dependent_friction': {'mu': 0.2},
    'load_torque_step': {'tau_l': TAU, 't_on': 3.0, 'rise': 1e-3},
    'inertia_change': {'g': 0.5, 't_on': 3.0, 'rise': 1e-3},
}

DOCS = Path(__file__).resolve().parent.parent / 'docs' / 'effects.md'

SPRING = """
from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
CARD = Card(title="spring", equation="-", symptom="-", reference="-", enters=Enters.MECHANICAL,
    rotary=True, amplitudes=(Amplitude("c", "N m/rad", "stiffness", Scale.TORQUE),))
def torque(theta, c):
    return -c * theta
"""


def geared(ratio: float) -> str:
    """Return the effect file that docs/effects.md shows, for a gear."""
    (block,) = re.findall(r'```python\n(""".*?)```', DOCS.read_text(), flags=re.DOTALL)
    assert '(50.0,)' in block
    return block.replace('(50.0,)', f'({ratio!r},)')


@contextmanager
def known(folder: Path, text: str) -> Iterator[str]:
    """Have an effect of a file in the catalogue for a while."""
    (folder / 'far_load.py').write_text(text)
    add_effect_file(folder / 'far_load.py')
    try:
        yield 'far_load'
    finally:
        catalogue().pop('far_load', None)


@cache
def lacking(key: str) -> tuple[Unknown, ...]:
    """Return what the linear motor lacks on records of a motor with a hidden effect."""
    return lacking_in(records({key: HIDDEN[key]} if key else {}))


def lacking_in(data: list[Record]) -> tuple[Unknown, ...]:
    """Return what the linear motor lacks on three records, the last of them held out."""
    rung = fit_model(data[:-1], data[-1:])
    runs = (*rung.training.predictions, *rung.validation.predictions)
    failure = failure_of(rung.model, data, ('train', 'train', 'validate'), runs)
    return unknown_of(rung.model, data, failure, SIGMAS)


@pytest.mark.parametrize(
    ('key', 'equation', 'axis', 'shape'),
    [
        ('coulomb_friction', 'torque', 'speed', 'odd, constant beyond'),
        ('quadratic_drag', 'torque', 'speed', 'odd, grows with the square'),
        ('constant_load_torque', 'torque', 'constant', 'a constant'),
        ('gravity_load', 'torque', 'position', 'once per turn'),
        ('cogging_torque', 'torque', 'position', '11 waves per turn'),
        ('brush_voltage_drop', 'voltage', 'current', 'odd, constant beyond'),
        ('armature_heating', 'voltage', 'R over time', 'changes with time'),
        ('input_delay', 'voltage', 'recent input', ''),
        ('load_dependent_friction', 'torque', 'speed and current', ''),
        ('load_torque_step', 'torque', 'time in the recording', 'steps at 3 s'),
        ('inertia_change', 'torque', 'J over time in the recording', 'changes with time'),
    ],
)
def test_the_axis_and_the_shape_of_an_unknown_effect_are_named(key, equation, axis, shape):
    first = lacking(key)[0]
    assert first.equation == equation
    assert first.axis == axis
    assert first.shape.startswith(shape)
    assert first.share > 0.5
    assert first.words
    best = [a for a in first.axes if a.best]
    assert [a.axis for a in best] == [axis]
    assert best[0].certainty > 3


@pytest.mark.parametrize(
    ('key', 'amplitude', 'tolerance'),
    [
        ('coulomb_friction', TAU, 0.1),
        ('gravity_load', np.hypot(TAU, 2e-3), 0.05),
        ('cogging_torque', 5e-3, 0.05),
        ('load_torque_step', TAU, 0.05),
        ('brush_voltage_drop', 0.5, 0.25),
    ],
)
def test_its_size_is_that_of_the_hidden_effect(key, amplitude, tolerance):
    first = lacking(key)[0]
    assert abs(first.amplitude) == pytest.approx(amplitude, rel=tolerance)
    if key != 'brush_voltage_drop':
        assert with_unit(first.amplitude, first.unit) in first.words


def test_what_a_drive_does_to_the_input_is_a_function_of_it():
    rng, data = np.random.default_rng(1), []
    for kind in ('steps', 'triangle', 'sines'):
        volts = voltage_profile(kind, 6.0, rng)
        seen = measure(a_motor({}), np.where(np.abs(volts) < 1.5, 0.0, volts), rng)
        data.append(seen.with_signal('voltage', volts, 'V'))
    first = lacking_in(data)[0]
    assert (first.equation, first.axis) == ('voltage', 'input')
    assert first.shape == 'odd, grows up to 1.4 V and is gone beyond'


@pytest.mark.parametrize(
    ('shares', 'axis'),
    [
        ({'current': 0.74, 'input': 0.9, 'recent input': 0.9}, 'current'),
        ({'current': 0.1, 'input': 0.9, 'recent input': 0.9}, 'input'),
        ({'current': 0.1, 'input': 0.6, 'recent input': 0.9}, 'recent input'),
        ({'current': 0.6, 'input': 1.0, 'speed and current': 1.0}, 'input'),
        ({'current': 0.6, 'input': 0.8, 'speed and current': 1.0}, 'speed and current'),
        ({'current': 0.1, 'input': 0.1}, ''),
        ({'speed': 0.7, 'input': 0.9}, 'input'),
    ],
)
def test_the_input_is_named_where_no_state_that_follows_it_will_do(shares, axis):
    tried = [AxisShare('voltage', '', 'V', name, share, 9.0) for name, share in shares.items()]
    assert _named(tried) == axis


def test_friction_is_said_to_act_against_the_motion():
    assert 'against the motion' in lacking('coulomb_friction')[0].words


def test_a_complete_model_lives_on_no_axis():
    """Trap: every axis explains a little of noise, if it is judged on what it was fitted to."""
    for one in lacking(''):
        assert one.axis == ''
        assert one.shape == ''
        assert one.curve is None
        assert 'no more than sensor noise' in one.words
        assert all(a.share < 0.2 for a in one.axes)


@pytest.mark.parametrize('key', ['coulomb_friction', 'cogging_torque', 'quadratic_drag'])
def test_the_other_equation_is_not_blamed(key):
    other = lacking(key)[1]
    assert other.equation == 'voltage'
    assert other.axis == ''


def test_the_curve_shows_the_shape_inside_the_band():
    curve = lacking('coulomb_friction')[0].curve
    assert curve is not None
    assert curve.axis == 'speed'
    assert curve.law is not None
    assert np.corrcoef(curve.law, curve.mean)[0, 1] > 0.95
    assert np.mean(np.abs(curve.law - curve.mean) <= 2 * curve.band) > 0.8


def test_a_parameter_over_time_is_drawn_with_its_band():
    curve = lacking('inertia_change')[0].curve
    assert curve is not None
    assert (curve.quantity, curve.unit) == ('change of J', '%')
    before, after = curve.mean[curve.x < 2.3], curve.mean[curve.x > 3.8]
    assert np.mean(after) - np.mean(before) == pytest.approx(40, abs=12)
    assert np.mean(curve.mean) == pytest.approx(0, abs=1e-9)  # its own level was fitted
    assert np.all(curve.band > 0)


def test_random_forces_live_on_no_axis():
    """What nothing in the data predicts is beyond noise, and honestly no function of any axis."""
    *train, held = records({}, seed=2)
    rung = fit_model(train, [held])
    rng = np.random.default_rng(8)
    data = [
        r.with_signal('current', r['current'] + 0.2 * slow(rng, len(r)), 'A')
        for r in (*train, held)
    ]
    runs = (*rung.training.predictions, *rung.validation.predictions)
    failure = failure_of(rung.model, data, ('train', 'train', 'validate'), runs)
    voltage = next(
        u for u in unknown_of(rung.model, data, failure, SIGMAS) if u.equation == 'voltage'
    )
    assert voltage.rms > 2 * voltage.noise
    assert voltage.axis == ''
    assert 'no function of any axis' in voltage.words


@pytest.mark.parametrize(
    ('share', 'words'),
    [(0.3, 'is no function of any axis'), (0.86, 'goes most with current (86 %)')],
)
def test_what_mostly_goes_with_an_axis_is_no_function_of_none(share: float, words: str) -> None:
    best = (AxisShare('torque', 'unexplained torque', 'N m', 'current', share, 2.6),)
    one = Unknown('torque', 'unexplained torque', 'N m', 1e-3, 1e-4, '', 0.0, '', 0.0, '', best)
    assert words in _nowhere(one)


def slow(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return (count,) noise that is correlated over 30 samples."""
    return np.convolve(rng.normal(size=count), np.hanning(30) / np.sqrt(11), 'same')


def test_orders_stand_out_only_where_there_are_waves():
    rng = np.random.default_rng(4)
    angle = np.cumsum(rng.uniform(0, 0.1, 20_000))
    noise = rng.normal(size=angle.size)
    assert standing_orders(angle, noise + 2 * np.cos(7 * angle + 1))[0] == 7
    pure = [standing_orders(angle, rng.normal(size=angle.size)) for _ in range(10)]
    assert sum(map(len, pure)) < 10


def test_every_shape_has_amplitude_one_at_most_on_its_axis():
    rng = np.random.default_rng(6)
    for axis, unit, values in (
        ('speed', 'rad/s', rng.uniform(-50, 50, 4000)),
        ('position', 'rad', rng.uniform(0, 2 * np.pi, 4000)),
        ('time', 's', np.linspace(0, 9, 4000)),
        ('temperature', 'degC', rng.uniform(20, 60, 4000)),
    ):
        for shape in shapes_of(axis, unit, values, np.sin(3 * values)):
            columns = shape.columns(values)
            assert columns.shape[0] == values.size
            assert np.all(np.abs(columns) <= 1 + 1e-12), shape.words
            assert shape.words


@pytest.mark.parametrize(
    ('value', 'unit', 'text'),
    [
        (3.1e-3, 'N m', '3.1 mN m'),
        (-4.2e-7, 'N m s/rad', '-420 nN m s/rad'),
        (12.0, 'rad/s', '12 rad/s'),
        (2.5e-5, 'kg m^2', '2.5e-05 kg m^2'),
        (0.02, '1', '0.02'),
        (5000.0, 'Hz', '5000 Hz'), (163.0, '%', '163 %'),
        (1.5e-4, 's', '150 µs'),
        (0.0, 'V', '0 V'),
    ],
)
def test_numbers_have_a_prefix_where_that_is_usual(value, unit, text):
    assert with_unit(value, unit) == text


@pytest.mark.parametrize(
    ('one', 'other', 'texts'),
    [(12.3, 1.15, ('12.3', '1.15')), (14.832, 14.817, ('14.83', '14.82')),
     (14.8502, 14.8503, ('14.9', '14.9')), (10.85, 10.88, ('10.8', '10.9'))],
)  # fmt: skip
def test_two_numbers_have_digits_enough_to_differ(one, other, texts):
    assert apart(one, other) == texts


@pytest.mark.slow
def test_waves_that_only_fine_steps_follow_are_named_without_a_measured_angle():
    """In coarse ones held-out data contest the cogging: it helps in some and harms in other."""
    scenario, number = named_case('single/cogging_torque/10/0')
    case = draw(scenario, 4100, number)
    found = diagnose(case.train, case.valid, motor='brushed_dc')
    assert found.effects == ('cogging_torque',)


@pytest.mark.parametrize(
    ('file', 'values', 'shape', 'amplitude'),
    [
        (geared(5.3), {'tau_sin': TAU, 'n': 5.3}, 'once every 5.3 turns', TAU),
        (geared(23.0), {'tau_cos': TAU, 'n': 23.0}, 'once every 23 turns', TAU),
        (SPRING, {'c': 2e-5}, 'grows in proportion', 1.6e-3),
    ],
    ids=['5.3', '23', 'spring'],
)
def test_what_goes_on_across_turns_is_described(tmp_path, file, values, shape, amplitude):
    """A load behind a gear of which the motor's own position is recorded; and a spring."""
    with known(tmp_path, file) as key:
        *train, held = records({key: values})
    rung = fit_model(train, [held])
    runs = (*rung.training.predictions, *rung.validation.predictions)
    failure = failure_of(rung.model, (*train, held), ('train', 'train', 'validate'), runs)
    first = unknown_of(rung.model, (*train, held), failure, SIGMAS)[0]
    assert first.axis == 'position across turns'
    assert first.shape.startswith(shape)
    assert first.amplitude == pytest.approx(amplitude, rel=0.1)


def test_a_weight_behind_a_gear_is_named_with_the_file_that_the_docs_show(tmp_path):
    hidden = {'tau_sin': TAU, 'tau_cos': 1e-3, 'n': 5.3}
    with known(tmp_path, geared(5.3)) as key:
        *train, held = records({key: hidden})
        found = diagnose(train, [held], motor='brushed_dc')
        assert found.effects == (key,)
        for name, value in hidden.items():
            assert found.model[f'{key}.{name}'] == pytest.approx(value, rel=0.01), name
    without = diagnose(train, [held], motor='brushed_dc')
    assert without.verdict is Verdict.UNKNOWN_EFFECT
    said = without.unknown[0].words
    assert ': once every 5.3 turns, as a load behind a gear does, ' in said
