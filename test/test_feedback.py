"""Noise of a sensor that a controller feeds back does not bias the last fit."""

from dataclasses import replace

import numpy as np
import pytest

from motor_sysid.benchmark.datasheets import DATA_SHEETS
from motor_sysid.benchmark.excitation import random_steps
from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.sensors import measure, Sensors
from motor_sysid.benchmark.truth import Control, run
from motor_sysid.diagnosis.fitting import bench_of
from motor_sysid.diagnosis.search import feedback
from motor_sysid.diagnosis.search.feedback import ORDER, SAMPLES, unbiased
from motor_sysid.diagnosis.search.rung import climb, judge

SHEET = next(s for s in DATA_SHEETS if '3863' in s.name and 'gear' not in s.name)
TRUTH = {'R': SHEET.R, 'k_t': SHEET.k, 'J': 2 * SHEET.J, 'b': 1e-5}
DT = 1e-3


def record(seed, *, closed=True, seconds=12.0):
    """Return a motor under speed control by a coarse encoder, or on voltage alone."""
    rng = np.random.default_rng(seed)
    plant = Plant(SHEET.R, SHEET.L, SHEET.k, TRUTH['J'], TRUTH['b'])
    slow = plant.J * plant.R / plant.k**2
    shape = random_steps(DT * np.arange(round(seconds / DT)), slow, rng)
    sensors = Sensors(500.0, 0.0, 0.006 * SHEET.current, SHEET.current / 400, 0.0, position=False)
    control = Control(0.5 * SHEET.voltage * shape, limit=SHEET.voltage)
    if closed:
        gain = 6.0 * plant.k
        control = Control(
            0.3 * SHEET.top_speed * shape, gain, gain / slow, SHEET.voltage, 0.0, sensors.counts
        )
    truth = run(plant, control, DT)
    return measure(truth, sensors, DT, rng, control.reference if closed else None)


def fitted(seed, **options):
    """Return the bench and the least output error of a linear motor."""
    bench, model = bench_of([record(seed, **options)], [], None, 'brushed_dc', {}, 0.2)
    return bench, climb(model, bench)


def errors(rung):
    """Return the errors of the parameters in standard errors."""
    known = {name: rung.model.parameters[name] for name in TRUTH}
    return np.array([(known[name].value - TRUTH[name]) / known[name].sigma for name in TRUTH])


def test_parameters_of_a_closed_loop_are_as_near_as_their_standard_errors_say():
    """In every plain fit torque constant and inertia are 2 to 4 standard errors too small.

    The seeds are fixed; 24 sound errors pass by all but 1 of 1000 draws.
    """
    plain, better = [], []
    for seed in range(6):
        bench, rung = fitted(seed)
        plain.append(errors(rung))
        better.append(errors(unbiased(rung, bench)))
    worst = [list(TRUTH).index(name) for name in ('k_t', 'J')]
    assert np.all(np.mean(plain, axis=0)[worst] < -2.0)
    assert np.all(np.abs(np.mean(better, axis=0)) < 1.3)
    assert np.sqrt(np.mean(np.square(better))) < 1.5


def test_where_one_step_does_not_lead_there_some_more_do(monkeypatch):
    """As from where teeth strike, which is far from linear: both ways end at the same place."""
    bench, rung = fitted(0)
    one = errors(unbiased(rung, bench))
    monkeypatch.setattr(feedback, '_one_step', lambda *given: None)
    some = errors(unbiased(rung, bench))
    assert np.max(np.abs(one - errors(rung))) > 1.0
    assert some == pytest.approx(one, abs=0.2)


def test_an_inductance_that_fell_to_nothing_begins_anew():
    """As in records of long samples, from which no slope leads back to it."""
    bench, rung = fitted(0)
    model = rung.model.with_values({'L': rung.model.parameters['L'].lower})
    plain = climb(model.with_free(['L'], free=False), bench)
    fallen = plain.model.with_free(['L'])
    fallen = replace(plain.result, model=fallen, covariance=rung.result.covariance)
    found = unbiased(judge(fallen, bench), bench)
    assert np.max(np.abs(errors(found))) < 2.0
    inductance = found.model.parameters['L']
    assert inductance.value == pytest.approx(SHEET.L, rel=0.02)
    assert inductance.sigma < 0.02 * SHEET.L


def test_what_is_known_of_the_certainty_stays():
    """An inductance that the data do not show is not known where it has grown a hundredfold."""
    bench, rung = fitted(0)
    found = unbiased(rung, bench)
    assert found is not rung
    shares = [
        [p.sigma / (p.value if p.logarithmic else 1.0) for p in one.model.parameters.free]
        for one in (rung, found)
    ]
    assert shares[1] == pytest.approx(shares[0])
    sigmas = [p.sigma for p in found.model.parameters.free]
    covariances = found.result.covariance, rung.result.covariance
    change = np.sqrt(np.diag(covariances[0]) / np.diag(covariances[1]))
    before = [p.sigma for p in rung.model.parameters.free]
    assert sigmas == pytest.approx(list(change * before))
    assert found.held.error_percent == pytest.approx(rung.held.error_percent, rel=0.02)


@pytest.mark.parametrize(
    'options', [{'closed': False}, {'seconds': 0.9 * SAMPLES * ORDER * DT / 0.8}]
)
def test_an_open_loop_and_a_short_record_are_left_alone(options):
    bench, rung = fitted(0, **options)
    assert unbiased(rung, bench) is rung
