"""One contract over the whole catalogue of effects."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib import import_module
import inspect
from threading import Barrier

import numpy as np
import pytest

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import make_chain, Problem
from motor_sysid.physics.drive import Drive
from motor_sysid.physics.effect import Effect, Enters
from motor_sysid.physics.effect_file import checked
from motor_sysid.physics.effects import add_effect_file, catalogue, effect
from motor_sysid.physics.lanes import compile_effect
from motor_sysid.physics.model import Model
from motor_sysid.physics.motors import motor, motors
from motor_sysid.physics.rollout import Program
from motor_sysid.physics.scales import scales_of
from motor_sysid.physics.simulate import simulate
from motor_sysid.physics.store import dump_model, parse_model
from motor_sysid.signals.record import Record

KEYS = sorted(catalogue())
ON_DC = [key for key in KEYS if Model.base('brushed_dc').admits(catalogue()[key])]
MOTOR = {'R': 2.0, 'L': 2e-3, 'k_t': 0.05, 'J': 5e-5, 'b': 2e-5, 'omega_eps': 0.5, 'i_eps': 0.02}
PASSIVE = {
    'coulomb_friction', 'asymmetric_coulomb_friction', 'stribeck_friction', 'quadratic_drag',
    'brush_voltage_drop', 'iron_loss', 'inverter_dead_time', 'load_dependent_friction',
}  # fmt: skip
SEARCHED = {'n': 7.0, 't_on': 0.8, 'f': 2.3}
"""Values of shapes that the data are searched for."""

DESIGNED = {
    'coulomb_friction', 'asymmetric_coulomb_friction', 'stribeck_friction', 'lugre_friction',
    'load_dependent_friction', 'quadratic_drag', 'friction_drift', 'constant_load_torque',
    'load_torque_step', 'periodic_load', 'gravity_load', 'cogging_torque', 'torque_ripple',
    'flexible_shaft', 'backlash', 'inertia_change', 'input_delay', 'supply_sag',
    'driver_clipping', 'brush_voltage_drop', 'inverter_dead_time', 'drive_coast',
    'armature_heating', 'torque_constant_saturation', 'inductance_saturation', 'iron_loss',
    'current_sensor_lag', 'current_sensor_scale', 'current_sensor_offset',
    'speed_sensor_scale', 'speed_sensor_offset', 'speed_sensor_lag', 'emf_harmonics',
    'rotor_angle_lag',
    'voltage_angle_lag',
}  # fmt: skip


def a_record(seconds: float = 2.0, dt: float = 1e-3) -> Record:
    rng = np.random.default_rng(5)
    count = round(seconds / dt)
    voltage = np.repeat(rng.uniform(-8, 8, count // 100 + 1), 100)[:count]
    base = Model.base('brushed_dc', MOTOR)
    record = Record(dt * np.arange(count), {'voltage': voltage}, {'voltage': 'V'})
    run = simulate(base, record)
    for name, unit in (('current', 'A'), ('speed', 'rad/s'), ('position', 'rad')):
        record = record.with_signal(name, run.outputs[name], unit)
    return record


@pytest.fixture(scope='module')
def record() -> Record:
    return a_record()


def searched(key: str) -> dict[str, float]:
    """Return values of the shapes that the data would have to propose."""
    card = catalogue()[key].card
    return {s.name: SEARCHED[s.name] for s in card.shapes if not s.starts}


def a_strong(key: str, record: Record) -> Model:
    """Return the test motor with an effect of a tenth of its scale."""
    base = Model.base('brushed_dc', MOTOR)
    scales = scales_of('brushed_dc', base.parameters.values(), [record])
    card = catalogue()[key].card
    sizes = {a.name: a.trials[2] if a.trials else 0.1 for a in card.amplitudes}
    values = {a.name: sizes[a.name] * scales.size(a.scale) for a in card.amplitudes}
    values.update(searched(key))
    return base.with_effect(key, values, scales)


def test_every_designed_effect_is_there():
    assert set(catalogue()) >= DESIGNED


@pytest.mark.parametrize('key', KEYS)
def test_card_is_complete(key):
    one = catalogue()[key]
    card = one.card
    assert isinstance(one, Effect)
    assert isinstance(card.enters, Enters)
    assert card.title
    assert card.equation
    assert card.symptom.endswith('.')
    assert card.reference
    assert card.amplitudes, 'an effect needs a parameter that switches it off'
    assert card.axis in ('speed', 'position', 'current', 'time')
    assert checked(one).card is card
    for p in card.parameters:
        assert p.unit
        assert p.description
    for law in (*one.laws.values(), *one.rates.values()):
        assert ' in ' in (law.__doc__ or ''), 'say the unit of what the law returns'


@pytest.mark.parametrize('key', ON_DC)
def test_zero_strength_switches_it_off(key, record):
    base = Model.base('brushed_dc', MOTOR)
    off = base.with_effect(key, searched(key))
    plain, with_zero = simulate(base, record), simulate(off, record)
    for name, values in plain.outputs.items():
        size = np.max(np.abs(values))
        np.testing.assert_allclose(with_zero.outputs[name], values, atol=1e-9 * size, rtol=0)


@pytest.mark.parametrize('key', [k for k in KEYS if effect(k).card.linear])
def test_what_is_called_linear_is_linear(key):
    rng = np.random.default_rng(3)
    one = effect(key)
    moved = {*motor('brushed_dc').states, 'u', *one.card.states}
    for law in (*one.laws.values(), *one.rates.values()):
        names = list(inspect.signature(law).parameters)
        held = {name: rng.uniform(0.1, 2.0) for name in names}
        first, second = ({n: rng.normal() for n in names if n in moved} for _ in range(2))
        both = {n: 2.0 * first[n] - 3.0 * second[n] for n in first}
        alone = [law(**{**held, **part}) for part in (first, second)]
        assert law(**{**held, **both}) == pytest.approx(2.0 * alone[0] - 3.0 * alone[1])


@pytest.mark.parametrize('key', ON_DC)
def test_it_does_something(key, record):
    base = Model.base('brushed_dc', MOTOR)
    with_it, plain = (simulate(m, record).outputs for m in (a_strong(key, record), base))
    changes = [np.max(np.abs(with_it[n] - plain[n])) / np.std(plain[n]) for n in plain]
    assert max(changes) > 1e-3


@pytest.mark.parametrize('key', ON_DC)
def test_population_equals_single_runs(key, record):
    model = a_strong(key, record)
    program = Program.of(model, ['current', 'speed'])
    drive = Drive.of(record, motor('brushed_dc'))
    table = {n: np.full(40, v) for n, v in model.parameters.values().items()}
    table['J'] = table['J'] * np.linspace(0.8, 1.2, 40)
    together = program.run(table, drive, np.zeros(3), threads=2)
    for k in (0, 31, 32, 39):
        alone = program.run({n: v[k : k + 1] for n, v in table.items()}, drive, np.zeros(3))
        np.testing.assert_array_equal(together[:, :, k], alone[:, :, 0])


@pytest.mark.parametrize('key', KEYS)
def test_law_of_arrays_equals_law_of_numbers(key):
    rng = np.random.default_rng(3)
    one = catalogue()[key]
    for law in (*one.laws.values(), *one.rates.values()):
        names = list(inspect.signature(law).parameters)
        table = {name: rng.uniform(0.1, 3.0, 50) for name in names}
        whole = np.broadcast_to(law(*table.values()), 50)
        single = [law(*[float(table[n][k]) for n in names]) for k in range(50)]
        np.testing.assert_allclose(whole, single, rtol=1e-13)


@pytest.mark.parametrize('key', sorted(PASSIVE & set(KEYS)))
def test_passive_effects_never_feed_energy(key):
    rng = np.random.default_rng(4)
    one = motor('brushed_dc').taking(catalogue()[key])
    for name, law in one.laws.items():
        through = 'omega' if name == 'torque' else 'i'
        for _ in range(300):
            values = {n: rng.uniform(0.01, 2.0) for n in inspect.signature(law).parameters}
            values[through] = rng.uniform(-30, 30)
            assert law(**values) * values[through] <= 1e-12


def test_bristles_store_energy_but_make_none():
    """LuGre friction along motion by chance: what comes back was put in before."""
    rng = np.random.default_rng(8)
    one = catalogue()['lugre_friction']
    torque, rate = one.laws['torque'], one.rates['z']
    shape = {'s': 0.6, 'omega_s': 2.0, 'z_s': 0.02}
    dt, z, worst, work = 2e-6, 0.0, 0.0, 0.0
    for pulsation in rng.uniform(5, 80, 20):
        size, phase = rng.uniform(0.1, 30), rng.uniform(0, 6)
        for k in range(5000):
            omega = size * np.sin(pulsation * k * dt + phase)
            work -= torque(omega=omega, z=z, tau_c=1.0, t_b=1e-3, **shape) * omega * dt
            z += rate(omega=omega, z=z, **shape) * dt
            worst = min(worst, work)
    assert worst > -1e-6
    assert work > 1.0


@pytest.mark.parametrize('key', KEYS)
def test_units_are_consistent(key):
    """In other units of mass, time and current every law gives the same physics."""
    rng = np.random.default_rng(9)
    one = catalogue()[key]
    units = {p.name: p.unit for kind in motors().values() for p in kind.parameters}
    units |= {p.name: p.unit for p in one.card.parameters} | ARGUMENT_UNITS
    rates = {s: unit_of_law(one.rates[s]) for s in one.card.states}
    sizes = np.array([1.7, 0.6, 2.3])
    units |= {s: f'{u} s' for s, u in rates.items()}
    for name, law in (*one.laws.items(), *one.rates.items()):
        names = list(inspect.signature(law).parameters)
        here = units | ({'u': 'N m'} if name == 'torque_driven' else {})
        factors = [np.prod(sizes ** dimension(here[n])) for n in names]
        values = rng.uniform(0.1, 2.0, (20, len(names)))
        scale = np.prod(sizes ** dimension(unit_of_law(law)))
        for row in values:
            assert law(*(row * factors)) == pytest.approx(scale * law(*row), rel=1e-6), name


ARGUMENT_UNITS = {
    'i': 'A', 'omega': 'rad/s', 'theta': 'rad', 'u': 'V', 't': 's', 'di': 'A/s',
    'domega': 'rad/s^2', 'turn': 'rad', **dict.fromkeys(('i_d', 'i_q', 'i_a', 'i_b'), 'A'),
    **dict.fromkeys(('di_d', 'di_q', 'di_a', 'di_b'), 'A/s'),
    **dict.fromkeys(('u_d', 'u_q'), 'V'),
}  # fmt: skip
BASIC = {
    '1': (0, 0, 0), 'rad': (0, 0, 0), 'rev': (0, 0, 0), 'kg': (1, 0, 0), 's': (0, 1, 0),
    'A': (0, 0, 1), 'm': (0, 0, 0), 'N': (1, -2, 0), 'J': (1, -2, 0), 'W': (1, -3, 0),
    'V': (1, -3, -1), 'ohm': (1, -3, -2), 'H': (1, -2, -2), 'Hz': (0, -1, 0),
}  # fmt: skip


def unit_of_law(law) -> str:
    """Return the unit that the docstring of a law ends with."""
    return law.__doc__.strip().rsplit(' in ', 1)[1].rstrip('.')


def dimension(unit: str) -> np.ndarray:
    """Return the powers of mass, time and current in a unit such as ``N m s^2/rad^2``."""
    total = np.zeros(3)
    tail = unit.split('/', 1)[1] if '/' in unit else ''
    after = tail.split(')', 1)[1] if tail.startswith('(') else ' '.join(tail.split(' ')[1:])
    under = tail.strip('()') if tail.startswith('(') else tail.split(' ')[0]
    for sign, text in ((1, unit.split('/')[0]), (-1, under), (1, after)):
        for token in text.strip('()').split():
            name, power = [*token.split('^'), '1'][:2]
            total += sign * float(power) * np.array(BASIC[name])
    return total


@pytest.mark.parametrize('key', ON_DC)
def test_a_model_with_it_survives_a_file(key, record):
    model = a_strong(key, record)
    assert parse_model(dump_model(model)) == model


@pytest.mark.parametrize('key', ON_DC)
def test_sensitivities_match_wider_differences(key, record):
    """Slopes from the fit's own small steps against parabolas through much wider ones.

    The latter are integrated in finer steps, so that the coarse ones are judged, too; but for
    those that one step a sample does not tell well.
    """
    model = a_strong(key, record)
    own = [p.name for p in model.parameters.free if p.name.startswith(f'{key}.')]
    model = model.with_free([p.name for p in model.parameters.free if p.name not in own], False)
    outputs = ('current', 'speed')
    chain = make_chain(record, model.kind, outputs)
    problem = Problem(model, [chain], outputs)
    finer = Problem(model, [chain], outputs, substeps=1 if key in COARSE else 16)
    z = problem.vector()
    slope = problem.linearize(z)[0].slope
    usual = 1.5 if effect(key).card.strikes else 10.0
    for k, p in enumerate(problem.free):
        step = WIDER.get(p.name, usual) * problem.steps(z)[k] * np.eye(z.size)[k]
        runs = finer.simulate(z + np.array([2, 1, -1, -2])[:, np.newaxis] * step)[0]
        wide = (8 * (runs[..., 1] - runs[..., 2]) - runs[..., 0] + runs[..., 3]) / (12 * step[k])
        off = np.linalg.norm(slope[..., k] - wide, axis=0)
        size = np.linalg.norm(wide, axis=0)
        limit = ROUGH.get(p.name, 0.03)
        assert np.all(off <= limit * size + 1e-6 * np.linalg.norm(size)), p.name


WIDER = {'input_delay.delay': 0.5, 'driver_clipping.c': 3.0}
ROUGH = {
    'backlash.phi_g': 0.3, 'backlash.w_a': 0.06, 'inertia_change.t_on': 0.1,
    'load_torque_step.t_on': 0.1, 'inverter_dead_time.i_0': 0.05, 'brush_voltage_drop.v_b': 0.06,
}  # fmt: skip
"""Where the law has corners, a difference says only so much."""
COARSE = ('backlash', 'inductance_saturation')
"""Effects whose flanks meet, or whose current settles, within a step."""


@pytest.mark.parametrize('key', ON_DC)
def test_one_substep_is_close_to_many(key, record):
    """Brush drop is the stiff one: 16 electrical time constants in a sample near zero current."""
    limit = {'brush_voltage_drop': 1.5e-2, 'torque_ripple': 1e-2}.get(key, 6e-3)
    model = a_strong(key, record)
    coarse, fine = simulate(model, record), simulate(model, record, substeps=32)
    for name in ('current', 'speed'):
        error = np.std(coarse.outputs[name] - fine.outputs[name])
        assert error < limit * np.std(fine.outputs[name])


def test_an_effect_of_the_user_takes_part(tmp_path, record):
    file = tmp_path / 'coupling_ripple.py'
    file.write_text(
        '"""Torque ripple of a misaligned coupling."""\n'
        'from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale\n'
        'from motor_sysid.physics.laws import sin\n'
        'CARD = Card(title="coupling ripple", equation="tau = -m omega sin(2 theta)",\n'
        '    symptom="Twice a turn.", reference="-", enters=Enters.MECHANICAL, axis="position",\n'
        '    amplitudes=(Amplitude("m", "N m s/rad", "ripple per speed", Scale.ONE),))\n'
        'def torque(omega, theta, m):\n'
        '    """Torque in N m."""\n'
        '    return -m * omega * sin(2.0 * theta)\n'
    )
    try:
        assert add_effect_file(file).key == 'coupling_ripple'
        model = Model.base('brushed_dc', MOTOR).with_effect('coupling_ripple', {'m': 1e-5})
        before = simulate(model.without_effect('coupling_ripple'), record).outputs['speed']
        assert np.std(simulate(model, record).outputs['speed'] - before) > 0.05
    finally:
        catalogue().pop('coupling_ripple', None)


@pytest.mark.parametrize(
    ('line', 'same'),
    [
        ('-m * omega if omega * omega > 4.0 else -m * omega', '-m * omega'),
        ('-(omega // 3.0) * m', '-np.floor(omega / 3.0) * m'),
        ('-m * math.erf(omega)', None),
    ],
)
def test_a_law_that_vectors_do_not_go_through_is_called_for_each_number(
    tmp_path, record, monkeypatch, line, same
):
    """One with a branch, say; a second process that finds it compiled does not try again."""
    monkeypatch.setenv('MOTOR_SYSID_CACHE', str(tmp_path))
    speeds, effects = [], []
    for key, law in (('branching', line), ('straight', same or line)):
        file = tmp_path / f'{key}.py'
        file.write_text(
            '"""A law."""\n'
            'import math\n'
            'import numpy as np\n'
            'from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale\n'
            'CARD = Card(title="a law", equation="-", symptom="-", reference="-",\n'
            '    enters=Enters.MECHANICAL, axis="speed",\n'
            '    amplitudes=(Amplitude("m", "N m s/rad", "-", Scale.ONE),))\n'
            'def torque(omega, m):\n'
            '    """Torque in N m."""\n'
            f'    return {law}\n'
        )
        try:
            effects.append(add_effect_file(file))
            model = Model.base('brushed_dc', MOTOR).with_effect(key, {'m': 2e-5})
            speeds.append(simulate(model, record).outputs['speed'])
            plain = simulate(model.without_effect(key), record).outputs['speed']
            assert np.std(speeds[-1] - plain) > 5e-3
        finally:
            catalogue().pop(key, None)
    np.testing.assert_allclose(*speeds, rtol=1e-9, atol=1e-9)
    (tried,) = set(tmp_path.glob('lane_branching_*.py')) - set(tmp_path.glob('*_each_*'))
    tried.unlink()
    compile_effect(effects[0], ())
    assert not tried.exists()


def test_threads_that_ask_for_one_law_at_once_share_it(tmp_path, monkeypatch):
    """The first one compiles it; a fit of a new motor asks in several threads."""
    monkeypatch.setenv('MOTOR_SYSID_CACHE', str(tmp_path))
    one = catalogue()['coulomb_friction']
    one = replace(one, source=one.source + '\n# never compiled before\n')
    at_once = Barrier(4)

    def compiled(_: int) -> object:
        at_once.wait(10)
        return compile_effect(one, ('omega_eps',))

    with ThreadPoolExecutor(4) as pool:
        first, *others = pool.map(compiled, range(4))
    assert all(lanes is first for lanes in others)


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('x = 1\n', 'defines no CARD'),
        ('def torque(:\n', 'cannot be read'),
    ],
)
def test_a_bad_effect_file_is_refused_in_words(tmp_path, text, words):
    file = tmp_path / 'bad.py'
    file.write_text(text)
    with pytest.raises(UserError, match=words):
        add_effect_file(file)


CARD = """
from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale
CARD = Card(title='t', equation='e', symptom='s.', reference='r', enters={enters},
            amplitudes=({amplitudes}))
{law}
"""
SIZE = 'Amplitude("a", "N m", "d", Scale.TORQUE),'
LAW = 'def torque(omega, a):\n    return -a * omega'


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'law': 'torque = 3'}, '`torque` is no function'),
        ({'law': 'def torque(a):\n    raise ValueError("no")'}, r'`torque\(...\)` fails: V'),
        ({'law': 'def torque(a):\n    return "much"'}, r'`torque\(...\)` fails'),
        ({'law': 'def torque(omega):\n    return -omega'}, 'no law reads its parameter `a`'),
        ({'enters': 'Enters.MECHANICAL, settles="t_d"'}, '`t_d`, which is none of its shapes'),
        ({'amplitudes': ''}, 'no amplitude'),
        ({'amplitudes': 2 * SIZE}, 'two parameters are called `a`'),
        ({'enters': '"mechanical"'}, "`enters` is 'mechanical'; give one of Enters"),
    ],
)
def test_an_effect_that_cannot_be_worked_with_is_refused(tmp_path, change, words):
    file = tmp_path / 'strange.py'
    good = {'enters': 'Enters.MECHANICAL', 'amplitudes': SIZE, 'law': LAW}
    file.write_text(CARD.format(**{**good, **change}))
    with pytest.raises(UserError, match=f'effect `strange`: .*{words}'):
        add_effect_file(file)


def test_a_users_effect_bears_no_name_of_the_catalogue_and_may_repeat(tmp_path):
    good = CARD.format(enters='Enters.MECHANICAL', amplitudes=SIZE, law=LAW)
    (tmp_path / 'my.drag.py').write_text(good)
    with pytest.raises(UserError, match=r'`my\.drag`: a key has letters, digits'):
        add_effect_file(tmp_path / 'my.drag.py')
    (tmp_path / 'coulomb_friction.py').write_text(good)
    with pytest.raises(UserError, match='is an effect of the catalogue; rename the file'):
        add_effect_file(tmp_path / 'coulomb_friction.py')
    (tmp_path / 'twin.py').write_text(good.replace('enters=', 'repeats=2, enters='))
    try:
        add_effect_file(tmp_path / 'twin.py')
        assert {'twin', 'twin_2'} <= set(catalogue())
    finally:
        for key in ('twin', 'twin_2'):
            catalogue().pop(key, None)


def test_an_unknown_argument_of_a_law_is_an_error_when_loaded(tmp_path):
    file = tmp_path / 'asks_too_much.py'
    file.write_text(
        'from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale\n'
        'CARD = Card(title="t", equation="e", symptom="s.", reference="r",\n'
        '    enters=Enters.MECHANICAL, amplitudes=(Amplitude("a", "N m", "d", Scale.TORQUE),))\n'
        'def torque(omgea, a):\n    """Torque in N m."""\n    return -a * omgea\n'
    )
    with pytest.raises(UserError, match=r'asks for `omgea`, which no motor has \(.*`omega`'):
        add_effect_file(file)
    assert 'asks_too_much' not in catalogue()


def test_what_sets_in_leaves_what_was_there_and_a_wider_law_takes_its_place():
    base = Model.base('brushed_dc', MOTOR).with_effect('constant_load_torque', {'tau_l': 2e-3})
    both = base.with_effect('load_torque_step', {'tau_l': 1e-3, 't_on': 4.0})
    assert both.effects == ('constant_load_torque', 'load_torque_step')
    assert both['constant_load_torque.tau_l'] == 2e-3
    dry = Model.base('brushed_dc', MOTOR).with_effect('coulomb_friction', {'tau_c': 2e-3})
    wide = dry.with_effect('stribeck_friction', {'tau_s': 1e-3})
    assert wide.effects == ('stribeck_friction',)
    assert wide['stribeck_friction.tau_c'] == 2e-3


def test_teeth_push_and_never_pull():
    """Where they part fast, damping would hold them back; in the gap nothing acts at all."""
    push = import_module('motor_sysid.physics.effects.backlash').push
    shape = {'phi_g': 0.01, 'w_a': 500.0, 'z': 0.5}
    assert push(0.0, 0.012, 0.0, **shape) == pytest.approx(500.0**2 * 0.002)
    assert push(-1000.0, 0.012, 0.0, **shape) == 0.0
    assert push(1000.0, -0.012, 0.0, **shape) == 0.0
    assert push(-1000.0, -0.012, 0.0, **shape) < -(500.0**2) * 0.002
    assert push(1000.0, 0.009, 0.0, **shape) == 0.0


def test_a_shaft_swings_at_an_angular_frequency_on_a_linear_axis_too():
    model = Model.base('mechanical_axis', linear=True).with_effect('flexible_shaft')
    assert model.parameters['flexible_shaft.w_a'].unit == 'rad/s'
    rough = Model.base('mechanical_axis', linear=True).with_effect('stribeck_friction')
    assert rough.parameters['stribeck_friction.omega_s'].unit == 'm/s'
