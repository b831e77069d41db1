"""Effects of the user's own, however they enter: none stops a diagnosis, each can be found."""

from collections.abc import Iterator
from pathlib import Path

from bench_motor import MOTOR
import numpy as np
import pytest

from motor_sysid.diagnosis import diagnose
from motor_sysid.errors import UserError
from motor_sysid.physics.effects import add_effect_file, catalogue
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

DT = 2e-3
WAVES = """
    amplitudes=(Amplitude('a', 'A', 'cosine', Scale.{scale}),
                Amplitude('b', 'A', 'sine', Scale.{scale})),
    shapes=(Shape('n', '1/rev', 'waves per turn', Scale.ONE, {starts}, 1.0, 400.0, free=False),
            {further}),
    axis='position', rotary=True, orders='n')
"""
ONCE = """
    amplitudes=(Amplitude('a', 'A', 'size', Scale.{scale}),),
    shapes=(Shape('t_0', 's', 'moment', Scale.DURATION, {starts}, 0.0, 1.0),),
    axis='time', moment='t_0', {states})
"""
CURRENT_WAVE = (
    WAVES.format(scale='CURRENT', starts='{starts}', further=''),
    'def current_sensor(theta, a, b, n):\n    return a * cos(n * theta) + b * sin(n * theta)',
)
SPEED_WAVE = (
    WAVES.format(scale='ONE', starts='{starts}', further=''),
    'def speed_sensor(omega, theta, a, b, n):\n'
    '    return omega * (a * cos(n * theta) + b * sin(n * theta))',
)
ZERO_STEP = (
    ONCE.format(scale='CURRENT', starts='{starts}', states=''),
    'def current_sensor(t, a, t_0):\n    return 0.5 * a * (1.0 + tanh((t - t_0) / 1e-3))',
)
LATE_LOAD = (
    ONCE.format(scale='TORQUE', starts='{starts}', states="states=('z',)"),
    'def torque(z, a):\n    return -a * z\n\n\n'
    'def rate_z(z, t, t_0):\n    return 2.0 * (0.5 * (1.0 + tanh((t - t_0) / 1e-3)) - z)',
)
FADING = (
    WAVES.format(
        scale='TORQUE', starts='()',
        further="Shape('w', 'rad/s', 'speed', Scale.SPEED, (0.5,), 0.01, 5.0)",
    ),
    'def torque(omega, theta, a, b, n, w):\n'
    '    return (a * cos(n * theta) + b * sin(n * theta)) * exp(-abs(omega) / w)',
)  # fmt: skip


def text(effect: tuple[str, str], starts: str) -> str:
    """Return an effect file."""
    card, law = effect
    return (
        'from numpy import cos, exp, sin, tanh\n'
        'from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape\n'
        "CARD = Card(title='mine', equation='e', symptom='s.', reference='r',\n"
        f'    enters=Enters.MECHANICAL,{card.format(starts=starts)}\n\n{law}\n'
    )


@pytest.fixture
def file(tmp_path: Path) -> Iterator[Path]:
    """Return where an effect `mine` is to be written; it is forgotten in the end."""
    yield tmp_path / 'mine.py'
    catalogue().pop('mine', None)


def recorded(values: dict[str, float]) -> Record:
    """Return a record of the motor with the effect `mine`."""
    rng = np.random.default_rng(1)
    t = DT * np.arange(3000)
    volts = rng.uniform(-9, 9, 100)[np.searchsorted(np.cumsum(rng.uniform(0.1, 0.5, 100)), t)]
    volts[:100] = 0.0
    record = Record(t, {'voltage': volts}, {'voltage': 'V'})
    model = Model.base('brushed_dc', MOTOR).with_effect('mine', values)
    seen = simulate(model, record, follow_position=False, substeps=8).outputs
    noise = {'current': ('A', 0.012), 'speed': ('rad/s', 0.1), 'position': ('rad', 1e-4)}
    for name, (unit, sigma) in noise.items():
        record = record.with_signal(name, seen[name] + sigma * rng.normal(size=t.size), unit)
    return record


@pytest.mark.parametrize(
    ('effect', 'starts', 'values'),
    [
        (CURRENT_WAVE, '(1.0, 2.0, 6.0)', {'a': 0.1, 'b': 0.1, 'n': 2.0}),
        (SPEED_WAVE, '(1.0, 2.0)', {'a': 0.01, 'b': 0.01, 'n': 1.0}),
        (ZERO_STEP, '(0.3, 0.7)', {'a': 0.2, 't_0': 3.3}),
        (LATE_LOAD, '(0.3, 0.7)', {'a': 0.01, 't_0': 2.5}),
        (FADING, '', {'a': 4e-3, 'b': 3e-3, 'n': 7.0, 'w': 60.0}),
    ],
    ids=['current wave', 'speed wave', 'zero step', 'late load', 'fading cogging'],
)
def test_it_is_found(file, effect, starts, values):
    file.write_text(text(effect, starts))
    add_effect_file(file)
    found = diagnose([recorded(values)], effects=['mine', 'constant_load_torque'])
    assert found.effects == ('mine',)
    for name, value in values.items():
        assert found.model[f'mine.{name}'] == pytest.approx(value, rel=0.1), name


@pytest.mark.parametrize(
    ('effect', 'shape'),
    [(CURRENT_WAVE, 'n'), (SPEED_WAVE, 'n'), (ZERO_STEP, 't_0'), (LATE_LOAD, 't_0')],
)
def test_what_no_data_propose_needs_starts(file, effect, shape):
    file.write_text(text(effect, '()'))
    with pytest.raises(UserError, match=f'propose values of `{shape}`; give it starts'):
        add_effect_file(file)
