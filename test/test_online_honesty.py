"""What online estimators say of themselves: intervals from the first samples on, and limits.

Truth is the independent simulator.  Seeds are fixed.  Inductances are left out: where samples are
coarse for the current, their bias may pass their sigma.
"""

from functools import cache

import numpy as np
import pytest
from three_phase_records import pmsm_record

from motor_sysid.benchmark.estimators import compare_estimators
from motor_sysid.benchmark.perturbations import PERTURBATIONS, perturbed_run
from motor_sysid.estimation.online import Estimate, OnlineIdentifier
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Record

TIMES = (0.25, 0.5, 1.0, 2.0, 5.0)
"""Seconds of motion."""

Case = tuple[Record, dict[str, float], float, dict[str, float]]
"""Record, true values, rest before the motion in s, values that the user gives."""


def dc_case(seed: int, seconds: float) -> Case:
    run = perturbed_run(PERTURBATIONS[0], seed % 3, seconds + 0.6, seed)
    true = {n: float(run.true[n][0]) for n in ('R', 'L', 'k_t', 'J', 'b')}
    return run.record, true, 0.5, {}


def pmsm_case(seed: int, seconds: float) -> Case:
    machine, record = pmsm_record(seconds + 0.2, 2e-3, seed=seed)
    psi_f = machine.k_e / machine.pole_pairs
    true = {n: getattr(machine, n) for n in ('R', 'J', 'b', 'L_d', 'L_q')} | {'psi_f': psi_f}
    return record, true, 0.1, {'pole_pairs': machine.pole_pairs}


CASES = {'brushed_dc': dc_case, 'pmsm': pmsm_case}


@cache
def told(
    kind: str, key: str, seed: int, seconds: float
) -> list[dict[str, tuple[Estimate, float]]]:
    """Return estimates and true values after the times, from starts off by up to 65 %."""
    record, true, rest, given = CASES[kind](seed, seconds)
    rng = np.random.default_rng([seed, 9])
    start = {n: v * np.exp(0.5 * rng.uniform(-1, 1)) for n, v in true.items()}
    model = Model.base(kind, {**start, **given}, speed_sensor=SpeedSensor.DIFFERENCE)
    if kind == 'brushed_dc':
        model = model.with_effect('coulomb_friction')
    inputs = list(model.kind.inputs[0])
    outputs = [o.signal for o in model.kind.outputs if o.signal in record]
    online = OnlineIdentifier(model, key, record.dt, inputs, outputs)
    u, y = (np.column_stack([record[n] for n in names]) for names in (inputs, outputs))
    found, at = [], 0
    for moved in (t for t in TIMES if t <= seconds):
        rows = slice(at, round((moved + rest) / record.dt))
        online.update(record.time[rows], u[rows], y[rows])
        at = rows.stop
        now = online.estimate()
        found.append({name: (now[name], value) for name, value in true.items()})
    return found


def check(kind: str, key: str, seeds: range, seconds: float) -> None:
    """Intervals of what counts as known hold, and nobody is sure of what is not so."""
    runs = [told(kind, key, seed, seconds) for seed in seeds]
    for k, moved in enumerate(t for t in TIMES if t <= seconds):
        pairs = [run[k][name] for run in runs for name in run[k] if not name.startswith('L')]
        known = [(e, true) for e, true in pairs if e.identifiable]
        held = np.mean([abs(e.value - true) < 1.96 * e.sigma for e, true in known])
        assert held > 0.85, (moved, held)
        wrong = [(e, true) for e, true in pairs
                 if e.sigma < 0.05 * true and abs(e.value - true) > 0.15 * true]  # fmt: skip
        assert not wrong, moved


@pytest.mark.parametrize('kind', CASES)
def test_intervals_of_regressions_hold_from_the_first_samples_on(kind):
    """Of 15 to 25 known values at a time, 95 %: fewer than 85 % in 3 of 100 sets of seeds."""
    check(kind, 'rls', range(5), 2.0)


@pytest.mark.slow
@pytest.mark.parametrize('key', ['rls', 'rls_directional', 'compound_ls', 'window_ls'])
@pytest.mark.parametrize('kind', CASES)
def test_intervals_of_every_regression_hold_over_many_seeds(kind, key, request):
    if (kind, key) == ('pmsm', 'window_ls'):
        why = 'seed 13: after one acceleration of 0.25 s J is 17 % off at a sigma of 4.5 %'
        request.applymarker(pytest.mark.xfail(reason=why, strict=True))
    check(kind, key, range(5, 15), 5.0)


def test_a_sagging_supply_does_not_make_the_dual_filter_run_away():
    """As wrong as any other that knows no sag, but no further."""
    (sag,) = (p for p in PERTURBATIONS if p.code == 'P5')
    for score in compare_estimators([sag], 2, 6.0, keys=('dual_ekf',)):
        assert score.error < 0.35, score.motor


def test_the_gain_of_a_current_sensor_is_seen_by_nobody():
    """A motor whose current is read 5 % too small is another motor, to the last bit of noise."""
    rng = np.random.default_rng(0)
    t = 1e-3 * np.arange(1500)
    volts = np.repeat(rng.uniform(-12, 12, 15), 100)
    record = Record(t, {'voltage': volts}, {'voltage': 'V'})
    true = {'R': 1.2, 'L': 1.5e-3, 'k_t': 0.055, 'J': 8e-5, 'b': 3e-5}
    g = 0.95
    other = {'R': true['R'] / g, 'L': true['L'] / g, 'k_t': true['k_t'], 'J': true['J'] * g,
             'b': true['b'] * g}  # fmt: skip
    one, two = (simulate(Model.base('brushed_dc', v), record).outputs for v in (true, other))
    np.testing.assert_allclose(two['speed'], one['speed'], atol=1e-9 * np.max(one['speed']))
    np.testing.assert_allclose(two['current'], g * one['current'], atol=1e-9)
