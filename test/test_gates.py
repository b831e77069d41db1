"""What an effect must not gain by: a noise model, a sensor, a law that is pushed to its limit."""

from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

from bench_motor import MOTOR as BENCH_MOTOR
from bench_motor import records
import numpy as np
import pytest
from scipy.signal import lfilter

from motor_sysid.diagnosis.search import rung as rungs
from motor_sysid.diagnosis.search.bench import base_fit, make_bench, with_scales
from motor_sysid.diagnosis.search.gain import Gain, is_certain, is_in_few
from motor_sysid.diagnosis.search.gates import (
    gate_note,
    gone,
    misfit_of_laws,
    TAKES_OVER,
    TOO_LITTLE,
    TRIFLE,
    UNCERTAIN,
    UNPHYSICAL,
    why_idle,
)
from motor_sysid.diagnosis.search.rounds import accounted
from motor_sysid.diagnosis.search.rung import (
    climb,
    profile_cost,
    with_better_sensor,
    within_reach,
)
from motor_sysid.diagnosis.search.sense import is_impossible, is_nonsense, senseless
from motor_sysid.diagnosis.search.trial import Level
from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.estimation.batch import coloured, white
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.physics.scales import scales_of
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

MOTOR = {'R': 1.2, 'L': 1.5e-3, 'k_t': 0.055, 'J': 8e-5, 'b': 3e-5}


def fitted(*, differenced: bool, noise: float = 1.0):
    """Return the bench and the fit of a linear motor; speed is shown or differenced."""
    t = 1e-3 * np.arange(4000)
    rng = np.random.default_rng(2)
    volts = np.repeat(rng.uniform(-12, 12, 80), 50)
    drive = Record(t, {'voltage': volts}, {'voltage': 'V'})
    run = simulate(Model.base('brushed_dc', MOTOR), drive)
    angle = run.outputs['position']
    speed = np.diff(angle, prepend=angle[0]) / 1e-3 if differenced else run.outputs['speed']
    columns = {
        'voltage': volts,
        'current': run.outputs['current'] + 0.02 * noise * rng.standard_normal(t.size),
        'speed': speed + 0.3 * noise * rng.standard_normal(t.size),
    }
    record = Record(t, columns, {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'})
    kind = motor('brushed_dc')
    bench = make_bench([record], [], kind)
    base = base_fit([record], kind, bench.train, bench.outputs, {}).model
    bench = with_scales(bench, base)
    return bench, climb(base, bench)


def test_nothing_is_certain_of_stretches_too_short_to_whiten():
    """Pieces of 50 samples hold back ten each; a noise model looks back as far."""
    part = np.random.default_rng(0).standard_normal((10, 1))
    before, after = (
        Comparison(5.0, {}, (), (scale * part,) * 5, (np.ones((10, 1)),) * 5)
        for scale in (9.0, 1.0)
    )
    assert not is_certain(before, after, coloured([np.tile(part, (40, 1))], 12))
    assert is_certain(before, after, white([part]))


def noise_model(rung):
    """Return one that differs from the fit's own: as if the dictionary left other noise."""
    return coloured([part - 0.9 * np.roll(part, 1, axis=0) for part in rung.training.residuals], 8)


def test_a_noise_model_is_not_counted_for_an_effect():
    bench, rung = fitted(differenced=False)
    weighting = noise_model(rung)
    level = Level.of(rung, bench, weighting)
    assert level.cost <= profile_cost(rung, bench, weighting)[0]
    # The same model with one parameter that does nothing gains nothing, however it is fitted.
    again = climb(rung.model, bench, weighting)
    assert level.gain(again, bench) < 0.01 * bench.threshold


@pytest.mark.parametrize('differenced', [True, False])
def test_the_wrong_speed_sensor_is_found_out(differenced):
    bench, rung = fitted(differenced=differenced)
    right = SpeedSensor.DIFFERENCE if differenced else SpeedSensor.IDEAL
    other = SpeedSensor.IDEAL if differenced else SpeedSensor.DIFFERENCE
    assert rung.model.speed_sensor is right
    wrong = climb(replace(rung.model, speed_sensor=other), bench)
    assert with_better_sensor(wrong, bench, rung.result.weighting).model.speed_sensor is right
    assert with_better_sensor(rung, bench, rung.result.weighting) is rung


def test_half_a_sample_that_passes_for_noise_is_told_by_the_errors():
    """An input that is late is half a sample less so where speeds are differences."""
    rng = np.random.default_rng(4)
    drive = Record(
        4e-3 * np.arange(4000), {'torque': np.repeat(rng.uniform(-12, 12, 200), 20)},
        {'torque': 'N m'},
    )  # fmt: skip
    axis = Model.base('mechanical_axis', {'J': 0.2, 'b': 0.4})
    run = simulate(axis.with_effect('input_delay', {'delay': 10.4e-3}), drive)
    shown = run.outputs['speed'] + 0.001 * rng.standard_normal(4000)
    record = drive.with_signal('speed', shown, 'rad/s')
    bench = make_bench([record], [], axis.kind)
    late = axis.with_effect('input_delay', {'delay': 8.4e-3})
    wrong = climb(late.with_speed_sensor(SpeedSensor.DIFFERENCE), bench)
    weighting = coloured(wrong.training.residuals, 12)
    found = with_better_sensor(wrong, bench, weighting)
    assert found.model.speed_sensor is SpeedSensor.IDEAL
    assert found.model['input_delay.delay'] == pytest.approx(10.4e-3, rel=0.01)
    assert with_better_sensor(found, bench, weighting) is found


@pytest.mark.parametrize(
    ('key', 'stays'), [('speed_sensor_offset', True), ('coulomb_friction', False)]
)
def test_counts_do_not_take_the_place_of_an_offset_that_explains_more(key, stays):
    """They have no room for one: while it is missing, any sensor may seem better than that."""
    bench, rung = fitted(differenced=True)
    weighting = rung.result.weighting
    wrong = climb(replace(rung.model, speed_sensor=SpeedSensor.IDEAL), bench)
    much = profile_cost(wrong, bench, weighting)[0]
    variant = SimpleNamespace(effect=effect(key))
    scored = [SimpleNamespace(variant=variant, gain=0.99 * much, allowed=True)]
    assert (with_better_sensor(wrong, bench, weighting, scored) is wrong) is stays
    refused = [SimpleNamespace(variant=variant, gain=0.99 * much, allowed=False)]
    assert with_better_sensor(wrong, bench, weighting, refused) is not wrong


def test_a_parameter_that_is_far_off_takes_two_steps_where_noise_is_low(monkeypatch):
    bench, rung = fitted(differenced=True, noise=0.1)
    weighting, far = rung.result.weighting, {'L': 1.5 * rung.model['L']}
    most = rungs.HOPELESS * profile_cost(rung, bench, weighting)[0]
    assert within_reach(rung.model.with_values(far), bench, weighting, most)
    monkeypatch.setattr(rungs, 'STEPS', 1)
    assert not within_reach(rung.model.with_values(far), bench, weighting, most)
    assert within_reach(rung.model, bench, weighting, most)


@pytest.mark.parametrize('stepwise', [True, False])
def test_the_filter_of_a_drive_is_told_from_one_ahead_of_the_samples(stepwise):
    """It takes the speed sample by sample; the other one is reckoned in steps of 0.1 ms."""
    fine, lag = 1e-4 * np.arange(40_000), 4e-3
    rng = np.random.default_rng(2)
    volts = np.repeat(rng.uniform(-12, 12, 80), 500)
    drive = Record(fine, {'voltage': volts}, {'voltage': 'V'})
    run = simulate(Model.base('brushed_dc', MOTOR), drive)
    speed, dt = (run.outputs['speed'][::10], 1e-3) if stepwise else (run.outputs['speed'], 1e-4)
    share = 1 - np.exp(-dt / lag)
    late = lfilter([share], [1, share - 1], speed)
    columns = {
        'voltage': volts[::10],
        'current': run.outputs['current'][::10] + 0.005 * rng.standard_normal(4000),
        'speed': (late if stepwise else late[::10]) + 0.05 * rng.standard_normal(4000),
    }
    record = Record(fine[::10], columns, {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'})
    kind = motor('brushed_dc')
    bench = make_bench([record], [], kind)
    base = base_fit([record], kind, bench.train, bench.outputs, {}).model
    bench = with_scales(bench, base)
    model = base.with_effect('speed_sensor_lag', {'lag': lag})
    right, wrong = SpeedSensor.SAMPLED, SpeedSensor.IDEAL
    if not stepwise:
        right, wrong = wrong, right
    rung, other = (climb(replace(model, speed_sensor=one), bench) for one in (right, wrong))
    weighting = rung.result.weighting
    assert with_better_sensor(rung, bench, weighting) is rung
    assert with_better_sensor(other, bench, weighting).model.speed_sensor is right
    assert rung.model['speed_sensor_lag.lag'] == pytest.approx(lag, rel=0.02)
    assert SpeedSensor.SAMPLED not in bench.other_sensors(base), 'without a filter it is the same'


def test_counts_are_no_sensor_of_a_model_with_an_offset():
    """They have no room for it, so whatever they gain, they take away what is there."""
    bench, rung = fitted(differenced=False)
    model = replace(rung.model, speed_sensor=SpeedSensor.IDEAL)
    assert SpeedSensor.DIFFERENCE in bench.other_sensors(model)
    shifted = model.with_effect('speed_sensor_offset', {'o': 1.0}, bench.scales)
    assert SpeedSensor.DIFFERENCE not in bench.other_sensors(shifted)


def test_a_speed_sensor_that_a_brief_fit_speaks_against_is_not_fitted_in_full(monkeypatch):
    bench, rung = fitted(differenced=False)
    briefly = []

    def noted(*args, **options):
        briefly.append(options.get('briefly', False))
        return climb(*args, **options)

    monkeypatch.setattr(rungs, 'HOPELESS', np.inf)  # so that it is tried at all
    monkeypatch.setattr(rungs, 'climb', noted)
    assert with_better_sensor(rung, bench, rung.result.weighting) is rung
    assert briefly == [True]


def note(
    model,
    key,
    *,
    gain=1.0,
    certain=True,
    deep=False,
    inherits=False,
    further=True,
    steady=1.0,
    sigmas=0.1,
    trained=4.9,
    mends=False,
    delta=1000.0,
    tied=0.0,
    held=(5.0, 4.9),
    threshold=20.0,
    before=(),
):
    old = SimpleNamespace(
        model=SimpleNamespace(effects=('cogging_torque',) if further else (), parameters=before),
        training=SimpleNamespace(error_percent=5.0),
        held=SimpleNamespace(error_percent=held[0]),
    )
    variant = SimpleNamespace(effect=effect(key), inherits=inherits)
    scored = SimpleNamespace(variant=variant, overlap=0.0)
    spread = np.diag([(sigmas * p.value) ** 2 for p in model.parameters.free])
    size = np.sqrt(np.diag(spread))
    spread += tied * (np.outer(size, size) - spread)
    result = SimpleNamespace(covariance=spread)
    new = SimpleNamespace(
        model=model,
        training=SimpleNamespace(error_percent=trained),
        result=result,
        held=SimpleNamespace(error_percent=held[1]),
    )
    gained = Gain(delta, threshold, 20.0, gain, steady, certain, deep, mends)
    return gate_note(scored, new, old, gained, duration=10.0)


def with_effect(key, values, others=()):
    t = 1e-3 * np.arange(1000)
    wave = np.sin(9 * t)
    columns = {'voltage': 12 * wave, 'current': wave, 'speed': 200 * wave}
    units = {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'}
    scales = scales_of('brushed_dc', MOTOR, [Record(t, columns, units)])
    model = Model.base('brushed_dc', MOTOR)
    for other in others:
        model = model.with_effect(other, others[other], scales)
    return model.with_effect(key, values, scales)


@pytest.mark.parametrize(
    ('values', 'beside', 'says'),
    [
        ({'d_c': -1e-4}, (), UNPHYSICAL),
        ({'d_c': 1e-4}, (), ''),
        ({'d_v': -2e-6}, (), ''),
        ({'d_v': -4e-6}, (), UNPHYSICAL),
        ({'d_v': -4e-6, 't_d': 5.0}, (), ''),
        ({'d_v': -8e-6, 't_d': 5.0}, (), UNPHYSICAL),
        ({'d_c': -1e-4}, ('coulomb_friction',), ''),
        ({'d_c': -3e-4}, ('coulomb_friction',), UNPHYSICAL),
    ],
)
def test_friction_does_not_drift_below_nothing(values, beside, says):
    """Within 10 s: b is 3e-5, and Coulomb friction, where there is some, 2 mN m.

    What settles within 5 s falls 4.3 times as much as it does in the first second.
    """
    model = with_effect('friction_drift', values, {key: {'tau_c': 2e-3} for key in beside})
    assert note(model, 'friction_drift', gain=10.0, sigmas=0.01) == says


@pytest.mark.parametrize(('hertz', 'sense'), [(0.1, False), (0.15, True)])
def test_what_does_not_come_back_within_a_record_is_no_periodic_load(hertz, sense):
    model = with_effect('periodic_load', {'a': 1e-3, 'b': 0.0, 'f': hertz})
    found = senseless(model, 'periodic_load', 8.0)
    assert found == ('' if sense else 'swings less than once within a record')


@pytest.mark.parametrize(('share', 'free', 'sense'), [
    (0.0, True, False), (0.5, True, True), (0.0, False, True),
])  # fmt: skip
def test_friction_that_drifts_no_more_once_a_record_has_begun_is_no_drift(share, free, sense):
    """It is friction; of the shortest time constant that a drift may have, and a fit chose it."""
    model = with_effect('friction_drift', {'d_c': 1e-3})
    p = model.parameters['friction_drift.t_d']
    model = model.with_values({p.name: p.lower + share * p.lower}).with_free([p.name], free=free)
    found = senseless(model, 'friction_drift', 8.0)
    assert found == ('' if sense else 'has come to its end as a record begins')


@pytest.mark.parametrize(('moment', 'sense'), [(0.0, False), (0.07, False), (0.09, True)])
def test_what_is_there_from_the_start_of_a_record_on_does_not_set_in(moment, sense):
    model = with_effect('load_torque_step', {'tau_l': 1e-3, 't_on': moment})
    found = senseless(model, 'load_torque_step', 8.0)
    assert found == ('' if sense else 'is there from the start of a record on')
    assert is_nonsense(model, 'load_torque_step', 8.0) is not sense
    assert not is_impossible(model, 'load_torque_step', 8.0)


def test_a_last_effect_that_makes_no_sense_in_the_last_fit_is_taken_back():
    old = with_effect('coulomb_friction', {'tau_c': 1e-3})
    model = old.with_effect('periodic_load', {'a': 1e-3, 'b': 0.0, 'f': 0.05})
    why = why_idle(last_fit(model, 2.0), last_fit(old, 5.0), 'periodic_load', 10.0)
    assert why == 'swings less than once within a record'


def test_a_ratio_at_its_limit_means_another_law():
    shaft = with_effect('flexible_shaft', {'r': 0.5, 'w_a': 200.0, 'z': 0.05})
    assert note(shaft, 'flexible_shaft', gain=10.0) == ''
    p = shaft.parameters['flexible_shaft.z']
    over = shaft.with_values({'flexible_shaft.z': p.upper})
    assert 'damping ratio' in note(over, 'flexible_shaft', gain=10.0)


def test_a_friction_that_does_not_rise_near_standstill_is_coulomb_friction():
    flat = with_effect('stribeck_friction', {'tau_c': 1e-3, 'tau_s': 0.0})
    assert 'nothing but Coulomb friction' in note(flat, 'stribeck_friction', gain=10.0)
    risen = with_effect('stribeck_friction', {'tau_c': 1e-3, 'tau_s': 1e-3})
    assert note(risen, 'stribeck_friction', gain=10.0) == ''


@pytest.mark.parametrize(('tau_c', 'expected'), [(1e-3, ''), (0.0, UNPHYSICAL)])
def test_a_rise_of_friction_without_friction_is_no_stribeck_friction(tau_c, expected):
    model = with_effect('stribeck_friction', {'tau_c': tau_c, 'tau_s': 6e-4, 'omega_s': 3.0})
    assert note(model, 'stribeck_friction', gain=10.0) == expected


@pytest.mark.parametrize(('plus', 'minus', 'expected'), [(1e-3, 0.0, ''), (0.0, 0.0, UNPHYSICAL)])
def test_friction_in_one_direction_alone_is_friction(plus, minus, expected):
    values = {'tau_c_plus': plus, 'tau_c_minus': minus}
    model = with_effect('asymmetric_coulomb_friction', values)
    assert note(model, 'asymmetric_coulomb_friction', gain=10.0) == expected


def test_what_widens_a_law_needs_more_than_a_certain_trifle():
    model = with_effect('quadratic_drag', {'k_d': 1e-8})
    assert note(model, 'quadratic_drag', gain=1.0) == ''
    assert '1.0 % only' in note(model, 'quadratic_drag', gain=1.0, inherits=True)
    assert note(model, 'quadratic_drag', gain=2.5, inherits=True) == ''
    assert note(model, 'quadratic_drag', gain=1.0, inherits=True, mends=True) == ''


def test_what_is_far_above_the_noise_counts_in_an_error_that_is_nearly_all_noise():
    model = with_effect('quadratic_drag', {'k_d': 1e-8})
    assert '0.2 % only' in note(model, 'quadratic_drag', gain=0.2)
    assert note(model, 'quadratic_drag', gain=0.2, deep=True) == ''


@pytest.mark.parametrize(
    ('gain', 'held', 'told'),
    [
        (0.01, (5.755, 5.7549), False),  # a neighbour does as well
        (0.2, (0.0500, 0.0499), True),  # small beside the signal, not beside the error
        (0.05, (35.20, 35.17), True),  # sqrt(35.20^2 - 35.17^2) = 1.5 % of the signal
        (-0.3, (5.0, 5.015), False),
    ],
)
def test_what_changes_the_held_out_error_by_next_to_nothing_is_not_named(gain, held, told):
    model = with_effect('quadratic_drag', {'k_d': 1e-8})
    found = note(model, 'quadratic_drag', gain=gain, held=held, further=False)
    assert (found == '') is told


@pytest.mark.parametrize('gain', [0.0, -0.3, -40.0])
def test_no_error_is_said_to_fall_that_does_not(gain):
    model = with_effect('quadratic_drag', {'k_d': 1e-8})
    assert note(model, 'quadratic_drag', gain=gain) == f'{TOO_LITTLE} nothing'


def test_an_amplitude_that_may_be_nothing_is_not_named_whatever_its_evidence():
    model = with_effect('quadratic_drag', {'k_d': 1e-8})
    assert note(model, 'quadratic_drag', gain=10.0, sigmas=0.3) == ''
    assert 'from nothing' in note(model, 'quadratic_drag', gain=10.0, sigmas=0.4)
    assert note(model, 'quadratic_drag', gain=11.0, sigmas=0.4, delta=1001.0) == ''
    beside = {'gain': 11.0, 'sigmas': 0.4, 'threshold': 500.0}  # laws of the model are inexact
    assert note(model, 'quadratic_drag', delta=1001.0, **beside) == ''
    assert 'from nothing' in note(model, 'quadratic_drag', delta=999.0, **beside)


@pytest.mark.parametrize(
    ('before', 'error', 'sigma', 'idle'),
    [
        ('coulomb_friction', 4.8, 0.6, True), ('coulomb_friction', 4.8, 0.4, False),
        ('coulomb_friction', 4.7, 0.6, False), ('', 4.98, 0.6, True), ('', 4.9, 0.6, False),
        ('', 4.98, np.inf, True), ('', 4.9, np.inf, True), ('', 4.7, np.inf, False),
    ],
)  # fmt: skip
def test_what_may_be_nothing_in_the_last_fit_and_does_next_to_nothing_is_idle(
    before, error, sigma, idle
):
    """A first effect must bring 1 % of the error, a further one 5 %, and one that is not seen."""
    old = with_effect(before, {'tau_c': 1e-3}) if before else Model.base('brushed_dc', MOTOR)
    model = old.with_effect('quadratic_drag', {'k_d': 1e-8})
    model = model.with_estimates({}, {'quadratic_drag.k_d': sigma * 1e-8})
    found = why_idle(last_fit(model, error), last_fit(old, 5.0), 'quadratic_drag', 10.0)
    assert found == (UNCERTAIN if idle else '')


@pytest.mark.parametrize(
    ('held', 'has', 'goes'),
    [(4.8, 'stribeck_friction', True), (4.4, 'stribeck_friction', False), (4.8, '', False)],
)
def test_what_in_the_end_takes_all_of_a_known_friction_goes_again(held, has, goes):
    """Iron loss took over the viscous friction beside a Stribeck friction of another form."""
    old = (
        with_effect(has, {'tau_c': 1e-3, 'tau_s': 1e-3})
        if has
        else Model.base('brushed_dc', MOTOR)
    )
    old = old.with_estimates({}, {'b': 0.02 * MOTOR['b']})
    model = old.with_effect('iron_loss', {'k_x': 1e-6})
    model = model.with_values({'b': model.parameters['b'].lower})
    model = model.with_estimates({}, {'iron_loss.k_x': 1e-8})
    why = why_idle(last_fit(model, held), last_fit(old, 5.0), 'iron_loss', 10.0)
    assert why.endswith(TAKES_OVER) is goes


def last_fit(model, held, training=5.0):
    return SimpleNamespace(
        model=model,
        held=SimpleNamespace(channel_percent={'speed': held}, error_percent=held),
        training=SimpleNamespace(error_percent=training),
    )


@pytest.mark.parametrize(
    ('before', 'key', 'held', 'training', 'why'),
    [
        ('coulomb_friction', 'quadratic_drag', 4.998, 4.998, TRIFLE),
        ('coulomb_friction', 'quadratic_drag', 4.99, 5.0, ''),
        ('coulomb_friction', 'quadratic_drag', 4.998, 4.99, ''),
        ('coulomb_friction', 'quadratic_drag', 5.01, 4.99, ''),
        ('', 'quadratic_drag', 4.998, 5.0, ''),  # the gates have asked for more
        ('coulomb_friction', 'armature_inductance', 5.0, 5.0, ''),  # every motor has one
    ],
)
def test_a_further_effect_that_lowers_no_error_to_speak_of_is_idle(
    before, key, held, training, why
):
    """Either falls by 0.2 % of the signal at least, or the held-out one by a thousandth."""
    kind = 'brushed_dc_reduced' if key == 'armature_inductance' else 'brushed_dc'
    values = {p.name: MOTOR.get(p.name, 1.0) for p in motor(kind).parameters}
    old = Model.base(kind, values)
    old = old.with_effect(before, {'tau_c': 1e-3}) if before else old
    name = effect(key).card.amplitudes[0].name
    model = old.with_effect(key, {name: 1e-6})
    model = model.with_estimates({}, {f'{key}.{name}': 1e-8})
    assert why_idle(last_fit(model, held, training), last_fit(old, 5.0), key, 10.0) == why


def test_an_amplitude_counts_for_its_shapes_as_they_are():
    """Where a shape is hardly known, its amplitude is not either: that says nothing of nothing."""
    model = with_effect('inductance_saturation', {'s': 0.2, 'i_s': 1.0})
    key = 'inductance_saturation'
    assert 'from nothing' in note(model, key, gain=10.0, sigmas=0.4)
    assert note(model, key, gain=10.0, sigmas=0.4, tied=0.9) == ''


def test_what_halves_the_training_error_need_not_help_everywhere():
    model = with_effect('quadratic_drag', {'k_d': 1e-8})
    rare = {'gain': 10.0, 'certain': False, 'steady': 0.6}
    assert 'harms in other' in note(model, 'quadratic_drag', **rare)
    assert note(model, 'quadratic_drag', **rare, trained=2.4) == ''


def test_an_amplitude_on_its_bound_is_there_if_it_halves_the_training_error():
    """Held-out data in which currents are small tell next to nothing of a saturation."""
    model = with_effect('torque_constant_saturation', {'a': 1.3, 'i_k': 2.0})
    assert model.parameters['torque_constant_saturation.a'].on_bound
    sure = {'gain': 4.0, 'delta': 1001.0, 'further': False}
    assert 'from nothing' in note(model, 'torque_constant_saturation', **sure)
    assert note(model, 'torque_constant_saturation', **sure, trained=2.4) == ''
    less = {**sure, 'delta': 999.0}
    assert 'from nothing' in note(model, 'torque_constant_saturation', **less, trained=2.4)


def test_a_neighbour_accounts_for_less_than_the_truth_does():
    """Iron loss and dry friction, both against the motion, under the noise of the sensors."""
    data = records({'coulomb_friction': {'tau_c': 6e-3}}, kinds=('steps', 'triangle'), seconds=3.0)
    bench = make_bench(data, [], motor('brushed_dc'))
    start = Model.base('brushed_dc', {**BENCH_MOTOR, 'omega_eps': 0.4})
    bench = with_scales(bench, start)
    base = climb(start, bench)
    right = climb(base.model.with_effect('coulomb_friction', {'tau_c': 5e-3}), bench)
    wrong = climb(base.model.with_effect('iron_loss', {'k_x': 1e-4}), bench)
    noise = right.result.weighting
    assert accounted(base, right, bench, noise) > 0.99
    assert 0.5 < accounted(base, wrong, bench, noise) < 0.95
    assert accounted(base, base, bench, noise) == 0.0


@pytest.mark.parametrize(
    ('has', 'further', 'inherits', 'least'),
    [
        ('coulomb_friction', 'iron_loss', False, 400.0),  # both are functions of speed
        ('stribeck_friction', 'iron_loss', False, 2500.0),  # the form of that one is a habit
        ('speed_sensor_scale', 'quadratic_drag', False, 400.0),  # and what a sensor adds is one
        ('speed_sensor_offset', 'quadratic_drag', False, 0.0),  # but nothing depends on a constant
        ('input_delay', 'current_sensor_lag', False, 400.0),  # a delay has no law to be right
        ('coulomb_friction', 'cogging_torque', False, 0.0),  # one of position
        ('coulomb_friction', 'stribeck_friction', True, 0.0),  # the same law, mended
        ('periodic_load', 'friction_drift', False, 400.0),  # both read the clock
        ('periodic_load', 'flexible_shaft', False, 0.0),  # memory does not
        ('flexible_shaft', 'current_sensor_lag', False, 400.0),  # both remember
    ],
)
def test_the_misfit_of_a_law_is_no_further_function_of_the_same_thing(
    has, further, inherits, least
):
    model = with_effect(has, {effect(has).card.amplitudes[0].name: 1e-3})
    variant = SimpleNamespace(
        effect=effect(further), inherits=inherits, model=with_effect(further, {})
    )
    found = misfit_of_laws(SimpleNamespace(variant=variant), model, 1e6, ('current', 'speed'), 0.1)
    assert found == pytest.approx(least)


@pytest.mark.parametrize(
    ('has', 'turn', 'least'),
    [
        ('coulomb_friction', 0.1, 0.0),  # 2.4 rad of the wave within a sample: it is one
        ('coulomb_friction', 0.2, 400.0),
        ('lugre_friction', 0.2, 2500.0),
        ('quadratic_drag', 0.2, 0.0),  # that is nothing near standstill
    ],
)
def test_a_wave_that_is_seen_near_standstill_alone_may_be_the_misfit_of_dry_friction(
    has, turn, least
):
    """Of 396 waves per turn, a motor sampled every 5 ms showed those below 1.6 rad/s."""
    model = with_effect(has, {effect(has).card.amplitudes[0].name: 1e-5})
    waves = with_effect('cogging_torque', {'n': 24.0})
    variant = SimpleNamespace(effect=effect('cogging_torque'), inherits=False, model=waves)
    outputs = ('current', 'speed')
    found = misfit_of_laws(SimpleNamespace(variant=variant), model, 1e6, outputs, turn)
    assert found == pytest.approx(least)


@pytest.mark.parametrize(('after', 'passes'), [(5.0, True), (5.09, True), (5.2, False)])
@pytest.mark.parametrize('further', [True, False])
def test_what_spoils_the_held_out_error_does_not_pass_for_one_channel(after, passes, further):
    """The small error of one channel may fall while the large one of another rises."""
    model = with_effect('quadratic_drag', {'k_d': 1e-8})
    found = note(model, 'quadratic_drag', gain=5.5, further=further, held=(5.0, after))
    assert (found == '') is passes


@pytest.mark.parametrize(('outputs', 'least'), [(('current', 'speed'), 0.0), (('speed',), 400.0)])
def test_the_current_tells_a_misfit_of_the_voltage_from_a_torque(outputs, least):
    """A bridge that coasts and drag are both functions of speed."""
    model = with_effect('drive_coast', {'a': 0.5})
    drag = SimpleNamespace(effect=effect('quadratic_drag'), inherits=False, model=model)
    found = misfit_of_laws(SimpleNamespace(variant=drag), model, 1e6, outputs, 0.1)
    assert found == pytest.approx(least)


@pytest.mark.parametrize(
    ('held', 'missed'), [((60.0, 5.0), False), ((60.0, 10.0), True), ((40.0, 3.0), True)]
)
def test_what_a_wild_model_knew_of_a_friction_is_not_missed(held, missed):
    """Currents that saturate the magnets look like a friction a hundred times too large."""
    known = Model.base('brushed_dc', MOTOR).with_estimates({}, {'b': 0.01 * MOTOR['b']})
    new = with_effect('torque_constant_saturation', {'a': 0.5, 'i_k': 1.0})
    new = new.with_values({'b': new.parameters['b'].lower})
    found = note(new, 'torque_constant_saturation', gain=80.0, further=False, held=held,
                 before=known.parameters)  # fmt: skip
    assert found.endswith(TAKES_OVER) is missed
    assert missed or found == ''


def test_what_takes_the_place_of_the_back_emf_is_none():
    old = with_effect('quadratic_drag', {'k_d': 1e-8}).with_estimates({}, {'k_t': 1e-3})
    new = old.with_values({'k_t': old.parameters['k_t'].lower})
    assert gone(new, old) == 'k_t (torque constant, and back-EMF constant)'
    assert gone(old.with_values({'k_t': 0.9e-3 * old['k_t']}), old), 'next to nothing'
    assert gone(old, old) == ''
    assert gone(new, old.with_estimates({}, {'k_t': 0.04})) == ''  # it was not known
    known = old.with_estimates({}, {'L': 0.01 * old['L']})
    least = old.parameters['L'].lower
    assert gone(known.with_values({'L': least}), known) == '', 'too small to be seen'


@pytest.mark.parametrize(
    ('share', 'sigma', 'beside', 'missed'),
    [(5e-3, 0.02, True, True), (5e-3, 1e-3, True, False), (5e-3, 0.02, False, False),
     (0.02, 0.05, True, False)],
)  # fmt: skip
def test_a_further_effect_does_not_do_away_with_a_friction_that_was_known(
    share, sigma, beside, missed
):
    """Iron loss beside Stribeck friction took in a friction whose shape was not quite right."""
    old = with_effect('stribeck_friction', {}) if beside else Model.base('brushed_dc', MOTOR)
    b = old['b']
    old = old.with_estimates({}, {'b': 0.05 * b})
    new = old.with_values({'b': share * b}).with_estimates({}, {'b': sigma * b})
    assert (gone(new, old) != '') is missed


@pytest.mark.parametrize(('frequency', 'says'), [(0.05, 'less than once'), (0.2, '')])
def test_a_periodic_load_comes_back_within_a_record(frequency, says):
    """The record of `note` lasts 10 s."""
    model = with_effect('periodic_load', {'a': 1e-3, 'b': 1e-3, 'f': frequency})
    assert says in note(model, 'periodic_load', gain=20.0, further=False)
    assert bool(says) == bool(note(model, 'periodic_load', gain=20.0, further=False))


@pytest.mark.parametrize(
    ('held', 'exactly', 'why', 'has'),
    [
        (4.98, 4.978, TRIFLE, 'coulomb_friction'),  # the fit before was as good, in fine steps
        (4.98, 5.0, '', 'coulomb_friction'),
        (4.7, 4.698, '', 'coulomb_friction'),  # lowers it by much: that fit is not made again
        (4.7, 4.698, TRIFLE, 'brush_voltage_drop'),  # but where the sign of the current holds it
        (4.4, 4.398, '', 'brush_voltage_drop'),
    ],
)
def test_what_makes_up_for_a_fit_that_was_not_exact_is_needless(
    monkeypatch, held, exactly, why, has
):
    module = import_module('motor_sysid.diagnosis.search.needless')
    old = with_effect(has, {effect(has).card.amplitudes[0].name: 1e-3})
    model = old.with_effect('quadratic_drag', {'k_d': 1e-8})
    model = model.with_estimates({}, {'quadratic_drag.k_d': 1e-10})
    monkeypatch.setattr(module, 'exact', lambda rung, bench: (last_fit(old, exactly), bench))
    bench = SimpleNamespace(scales=SimpleNamespace(duration=10.0))
    before = last_fit(old, 5.0)
    assert module.why_needless(last_fit(model, held), before, bench) == why
    assert module.why_needless(before, last_fit(model, held), bench) == ''  # it has no more


@pytest.mark.parametrize(
    ('in_one', 'in_all', 'few'), [(180.0, 0.0, True), (180.0, 0.4, True), (20.0, 0.4, False)]
)
def test_what_is_gained_in_one_sample_may_be_a_jump_put_into_another(in_one, in_all, few):
    """Of 4000 samples with a noise of 1, and an error in each of them or in one more."""
    rng = np.random.default_rng(5)
    noise = rng.standard_normal((4000, 2))
    error = in_all * np.sign(rng.standard_normal((4000, 2)))
    error[1234, 0] = in_one
    before, after = (
        Comparison(5.0, {}, (), (residual,), (np.ones((4000, 2)),))
        for residual in (noise + error, noise)
    )
    assert is_in_few(before, after, white([noise])) is few
    assert not is_in_few(after, before, white([noise])), 'what rises is gained nowhere'
