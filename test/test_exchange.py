"""Rivals that show up when effects are exchanged get words and figures as all others do."""

from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

from bench_motor import records
import numpy as np
import pytest
from test_trials import prepared, refitted

from motor_sysid.diagnosis.candidates.score import Scores
from motor_sysid.diagnosis.search import exchange
from motor_sysid.diagnosis.search.confusable import Compared, rivalries_of
from motor_sysid.diagnosis.search.exchange import Exchange, State, state_of
from motor_sysid.diagnosis.search.rounds import scored
from motor_sysid.diagnosis.search.rung import climb, Rung
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import SpeedSensor

FEW = ('coulomb_friction', 'quadratic_drag', 'brush_voltage_drop')


def exchange_of():
    """Return a fit of two effects to a motor that has both, and what exchanges them."""
    hidden = {'coulomb_friction': {'tau_c': 6e-3}, 'brush_voltage_drop': {'v_b': 0.5}}
    data = records(hidden, kinds=('steps', 'triangle'), seconds=3.0)
    bench, base = prepared(data, SpeedSensor.DIFFERENCE)
    both = base.model.with_effect('brush_voltage_drop', {'v_b': 0.5}, bench.scales)
    both = both.with_effect('coulomb_friction', {'tau_c': 5e-3}, bench.scales)
    rung = climb(both, bench)
    seen: dict[State, tuple[Rung, Scores]] = {}

    def score(one: Rung) -> Scores:
        scores = scored(one, bench, [effect(key) for key in FEW], lambda text: None)
        seen[state_of(one.model)] = one, replace(scores, pairs=[])
        return scores

    score(base)
    score(rung)
    gains = {'coulomb_friction': 1.0, 'brush_voltage_drop': 1e12}
    return Exchange(bench, seen, {}, gains, {}, score, lambda text: None), rung


def test_a_rival_found_by_exchange_is_told_with_what_they_share(monkeypatch):
    engine, rung = exchange_of()

    def as_good(self, key, level, scores, gain):
        trial, _ = refitted('asymmetric_coulomb_friction', engine.bench, level.rung)
        yield replace(trial, delta_bic=gain)

    monkeypatch.setattr(exchange, 'ONLY_NOISE', 0.0)
    monkeypatch.setattr(Exchange, 'substitutes', as_good)
    rivals: dict[str, tuple[str, ...]] = {}
    assert engine.better(rung, (), rivals) is None
    assert rivals == {'coulomb_friction': ('asymmetric_coulomb_friction',)}
    (one,) = rivalries_of([], rivals, engine.bench.records, engine.compared)
    assert 0.9 < one.overlap <= 1.0
    assert 'they share' in one.words
    (bare,) = rivalries_of([], rivals, engine.bench.records)
    assert np.isnan(bare.overlap)


def test_a_rival_that_falls_behind_when_the_rest_is_there_is_none_any_more():
    """Drag instead of dry friction did as well while the brushes were missing, say."""
    engine, rung = exchange_of()
    rivals = {'coulomb_friction': ('quadratic_drag',)}
    assert engine.asked_again(rung, ['coulomb_friction'], rivals) is None
    assert rivals == {'coulomb_friction': ()}


@pytest.mark.parametrize(
    ('ahead', 'keys', 'left'),
    [
        (-9.0, None, {'coulomb_friction': ('asymmetric_coulomb_friction',)}),
        (9.0, None, {'coulomb_friction': ('asymmetric_coulomb_friction',)}),
        (11.0, {'brush_voltage_drop', 'asymmetric_coulomb_friction'}, {}),
    ],
)
def test_a_rival_that_gets_ahead_takes_the_place(monkeypatch, ahead, keys, left):
    """Within 10 in BIC the two go on as rivals."""
    engine, rung = exchange_of()

    def by_so_much(self, key, level, scores):
        trial, _ = refitted(key, engine.bench, level.rung)
        return replace(trial, delta_bic=level.gain(rung, engine.bench) + ahead, note='')

    monkeypatch.setattr(Exchange, 'trial', by_so_much)
    rivals = {'coulomb_friction': ('asymmetric_coulomb_friction',)}
    other = engine.asked_again(rung, ['coulomb_friction'], rivals)
    assert (other and set(other.model.effects)) == keys
    assert rivals == left


@pytest.mark.parametrize(
    ('evidence', 'gain', 'keys'),
    [
        (0.9, 20.0, {'brush_voltage_drop', 'coulomb_friction'}),
        (0.9, 4.0, None),
        (0.7, 20.0, None),
    ],
)
def test_what_held_out_data_spoke_for_more_is_asked_again(evidence, gain, keys):
    """Drag was added for its evidence; beside the brushes friction does better, as it should."""
    engine, _ = exchange_of()
    base = next(now for (keys, _), (now, _) in engine.seen.items() if not keys)
    trials = {key: refitted(key, engine.bench, base)[0] for key in FEW[:2]}
    drag = replace(trials['quadratic_drag'], delta_bic=1000.0, gain_percent=5.0, note='')
    friction = replace(
        trials['coulomb_friction'], delta_bic=1000.0 * evidence, gain_percent=gain, note=''
    )
    engine = replace(engine, tried={state_of(base.model): [drag, friction]})
    wrong = base.model.with_effect('quadratic_drag', {}, engine.bench.scales)
    wrong = wrong.with_effect('brush_voltage_drop', {'v_b': 0.5}, engine.bench.scales)
    rung = climb(wrong, engine.bench)
    other = engine.asked_again(rung, ['quadratic_drag'], {})
    assert (other and set(other.model.effects)) == keys


def test_a_special_case_of_what_is_there_is_not_asked_again():
    """Brushes were better for the held-out data; now there is a dead time, which holds them."""
    engine, _ = exchange_of()
    base = next(now for (keys, _), (now, _) in engine.seen.items() if not keys)
    brushes, _ = refitted('brush_voltage_drop', engine.bench, base)
    drag, _ = refitted('quadratic_drag', engine.bench, base)
    drag = replace(drag, delta_bic=1000.0, gain_percent=5.0, note='')
    brushes = replace(brushes, delta_bic=990.0, gain_percent=9.0, note='')
    engine = replace(engine, tried={state_of(base.model): [drag, brushes]})
    model = base.model.with_effect('quadratic_drag', {}, engine.bench.scales)
    rung = climb(model.with_effect('inverter_dead_time', {}, engine.bench.scales), engine.bench)
    assert engine.favoured('quadratic_drag', rung) == []
    assert engine.asked_again(rung, ['quadratic_drag'], {}) is None


def test_what_only_the_training_data_speak_for_takes_no_place_and_is_no_rival(monkeypatch):
    engine, rung = exchange_of()

    def runs_worse(self, key, level, scores, gain):
        trial, _ = refitted('asymmetric_coulomb_friction', engine.bench, level.rung)
        held = replace(rung.held, error_percent=1.03 * rung.held.error_percent)
        yield replace(trial, delta_bic=2 * gain, rung=replace(trial.rung, held=held))

    monkeypatch.setattr(exchange, 'ONLY_NOISE', 0.0)
    monkeypatch.setattr(Exchange, 'substitutes', runs_worse)
    monkeypatch.setattr(Exchange, 'best_pair', lambda *_: None)
    rivals: dict[str, tuple[str, ...]] = {}
    assert engine.better(rung, (), rivals) is None
    assert rivals == {}


@pytest.mark.parametrize(('share', 'taken'), [(0.97, False), (0.93, True)])
def test_a_pair_that_only_adds_an_effect_must_help_as_a_further_one(monkeypatch, share, taken):
    """Here what takes the place of dry friction holds it: it must bring 5 %."""
    engine, rung = exchange_of()
    held = replace(rung.held, error_percent=share * rung.held.error_percent)
    monkeypatch.setattr(exchange, 'ONLY_NOISE', 0.0)
    monkeypatch.setattr(Exchange, 'substitutes', lambda *_: iter(()))
    monkeypatch.setattr(Exchange, 'best_pair', lambda *_: replace(rung, held=held))
    assert (engine.better(rung, (), {}) is not None) is taken


@pytest.mark.parametrize(
    ('sensor', 'held', 'taken'),
    [
        (SpeedSensor.IDEAL, 0.9, True), (SpeedSensor.IDEAL, 0.995, False),
        (SpeedSensor.DIFFERENCE, 0.9, False),
    ],
)  # fmt: skip
def test_what_was_chosen_for_another_speed_sensor_is_asked_again(monkeypatch, sensor, held, taken):
    """A single effect, too: of what has the same evidence, what runs clearly better goes first."""
    engine, both = exchange_of()
    slim = both.model.without_effect('brush_voltage_drop').with_speed_sensor(sensor)
    rung = climb(slim, engine.bench)
    assert engine.chosen_blindly('coulomb_friction', rung) is (sensor is SpeedSensor.IDEAL)

    def as_good(self, key, level, scores, gain):
        trial, _ = refitted('asymmetric_coulomb_friction', engine.bench, level.rung)
        error = held * rung.held.error_percent
        run = replace(trial.rung, held=replace(rung.held, error_percent=error))
        yield replace(trial, delta_bic=gain, rung=run)

    monkeypatch.setattr(Exchange, 'substitutes', as_good)
    engine.gains['coulomb_friction'] = 1e12
    engine.score(rung)
    other = engine.found(rung, (), {})
    assert (other is not None) is taken
    assert other is None or other.model.effects == ('asymmetric_coulomb_friction',)


@pytest.mark.parametrize(('damping', 'taken'), [(0.05, True), (2.0, False)])
def test_what_comes_to_the_limit_of_what_makes_sense_takes_no_place(monkeypatch, damping, taken):
    """A shaft that hardly swings is none; what brought it in was superfluous in the end."""
    engine, rung = exchange_of()
    model = rung.model.with_effect('flexible_shaft', {'z': damping}, engine.bench.scales)
    swinging = replace(rung, result=replace(rung.result, model=model))
    monkeypatch.setattr(Exchange, 'found', lambda *_: rung)
    monkeypatch.setattr(exchange, 'pruned', lambda *_, **options: swinging)
    assert (engine.better(rung, (), {}) is swinging) is taken


def test_what_two_alike_fits_share_is_all():
    run = ({'speed': np.sin(np.arange(50.0))},)
    still = ({'speed': np.zeros(50) + 1e-3},)
    model = prepared(records({}, kinds=('steps',), seconds=1.0), SpeedSensor.DIFFERENCE)[1].model
    rivals = {'coulomb_friction': ('quadratic_drag',)}
    pair = {('coulomb_friction', 'quadratic_drag'): Compared(still, run, run, (model, model))}
    (one,) = rivalries_of([], rivals, [], pair)
    assert one.overlap == pytest.approx(1.0)
    assert one.regime == ''


def test_what_takes_a_place_does_not_bring_back_what_it_took_the_place_of():
    engine, rung = exchange_of()
    slim, _ = engine.without(rung, 'coulomb_friction')
    both = replace(rung, result=replace(rung.result, model=rung.model.with_effect(
        'quadratic_drag', {'k_d': 1e-9}, engine.bench.scales
    )))  # fmt: skip
    trial, _ = refitted('quadratic_drag', engine.bench, slim)
    placed = exchange._beside(replace(trial, rung=both), slim)
    assert set(placed.rung.model.effects) == {'brush_voltage_drop', 'quadratic_drag'}


def test_where_the_last_fit_needs_no_effect_any_more_the_model_before_is_the_last(monkeypatch):
    module = import_module('motor_sysid.diagnosis.engine')

    def fitted(*effects):
        return SimpleNamespace(model=SimpleNamespace(effects=effects))

    base, one = fitted(), fitted('quadratic_drag')
    monkeypatch.setattr(module, 'exact', lambda rung, bench: (rung, bench))
    monkeypatch.setattr(module, 'why_needless', lambda *_: '')
    monkeypatch.setattr(module, 'is_doubted', lambda *_: True)
    monkeypatch.setattr(module, 'pruned', lambda *_, **options: fitted())
    monkeypatch.setattr(module, 'relieved', lambda ladder, *_: ladder[-1][0])
    engine = SimpleNamespace(bench=None, gains={}, notes=[], tell=None)
    engine.put_last = lambda *args: module.Engine.put_last(engine, *args)
    ladder = [(base, []), (one, [])]
    module.Engine.settle(engine, ladder, ())
    assert ladder == [(base, [])]


@pytest.mark.parametrize(('rise', 'left'), [(0.0, 'coulomb'), (1e-3, 'stribeck')])
def test_a_friction_that_does_not_rise_in_the_last_fit_is_the_narrower_one(
    monkeypatch, rise, left
):
    """Its size is told, that of the rise is nothing."""
    module = import_module('motor_sysid.diagnosis.engine')
    engine, rung = exchange_of()
    risen = rung.model.without_effect('coulomb_friction').with_effect(
        'stribeck_friction', {'tau_c': 6e-3, 'tau_s': rise, 'omega_s': 5.0}, engine.bench.scales
    )
    sure = {f'stribeck_friction.{name}': 1e-6 for name in ('tau_c', 'tau_s')}
    told = replace(rung, result=replace(rung.result, model=risen.with_estimates({}, sure)))
    asked = []
    monkeypatch.setattr(module, 'exact', lambda one, bench: (one, bench))
    monkeypatch.setattr(module, 'why_needless', lambda *_: '')
    monkeypatch.setattr(module, 'relieved', lambda ladder, *_: ladder[-1][0])
    monkeypatch.setattr(module, 'polish', lambda one, bench: one)

    def slimmer(one, *_, **options):
        asked.append(one)
        return rung if one is told else one

    monkeypatch.setattr(module, 'pruned', slimmer)
    settling = SimpleNamespace(bench=engine.bench, gains={}, notes=[], tell=None)
    settling.round = lambda slim, base: (slim, [])
    settling.put_last = lambda *args: module.Engine.put_last(settling, *args)
    base, _ = next(iter(engine.seen.values()))
    ladder = [(base, []), (told, [])]
    module.Engine.settle(settling, ladder, ())
    assert f'{left}_friction' in ladder[-1][0].model.effects
    assert bool(asked) is (left == 'coulomb')
