"""A diagnosis made by hand: a DC motor with Coulomb friction and cogging, and its ladder.

The plant and three models M0 (linear), M1 (and Coulomb friction), M2 (and cogging) run side by
side on the same voltage; errors, evidence and shares are computed from what comes out.  Only what
the page does not depend on (gains in BIC, the also-rans) is made up.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.curves import Curve, Where
from motor_sysid.diagnosis.result.result import Candidate, Diagnosis, Step, Verdict
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Provenance, Record

Array = NDArray[np.float64]

R, L, K, J, B = 1.6, 2e-3, 0.05, 8e-5, 6e-5
TAU_C, COGGING, ORDER = 1.1e-2, 6.5e-3, 7
B_BASE = 2.4e-4
EPS = 1.0
NOISE = {'speed': 0.35, 'current': 0.02}


def voltage_profile(time: Array) -> Array:
    """Return a voltage that creeps, steps and sweeps, (N,) V."""
    third = (time[-1] + time[1]) / 15
    own = time % third
    slow = 5 * np.sin(2 * np.pi * own / third)
    steps = np.array([2, 6, -3, -7, 1, 5, -6, 0.8, 4, -2, 7])[(time / third * 8).astype(int) % 11]
    sweep = 2.0 + 3 * np.sin(2 * np.pi * (0.5 + 4 * own / third) * own)
    place = (time / third).astype(int) % 3
    return np.select([place == 0, place == 1], [slow, steps], sweep)


def lanes(voltage: Array, dt: float) -> dict[str, Array]:
    """Run M0, M1, M2 (the plant's equations) side by side; each signal is (3, N)."""
    b = np.array([B_BASE, B, B])
    coulomb, cogging = np.array([0, TAU_C, TAU_C]), np.array([0, 0, COGGING])
    decay = np.exp(-dt * R / L)
    i, w, th = np.zeros(3), np.zeros(3), np.zeros(3)
    out = np.empty((3, 3, len(voltage)))
    for k, u in enumerate(voltage):
        out[:, 0, k], out[:, 1, k], out[:, 2, k] = i, w, th
        steady = (u - K * w) / R
        i = steady + (i - steady) * decay
        load = coulomb * np.tanh(w / EPS) + cogging * np.sin(ORDER * th)
        w = w + dt / J * (K * i - b * w - load)
        th = th + dt * w
    return {'current': out[:, 0], 'speed': out[:, 1], 'position': out[:, 2]}


def binned(axis: Array, value: Array, edges: Array) -> tuple[Array, Array, Array]:
    """Return centres, means and 95 % half widths."""
    index = np.digitize(axis, edges) - 1
    rows = [value[index == k] for k in range(len(edges) - 1)]
    mean = np.array([row.mean() if len(row) > 3 else np.nan for row in rows])
    wide = [2 * row.std() / np.sqrt(len(row)) if len(row) > 3 else np.nan for row in rows]
    return (edges[1:] + edges[:-1]) / 2, mean, np.array(wide)


def build_diagnosis(seconds: float = 20.0, rate: float = 1000.0, seed: int = 1) -> Diagnosis:
    """Return the finished diagnosis of one record whose last fifth is held out."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, seconds, 1 / rate)
    voltage = voltage_profile(time)
    runs = lanes(voltage, 1 / rate)
    measured = {n: runs[n][2] + NOISE[n] * rng.standard_normal(len(time)) for n in NOISE}
    reference = np.round(runs['speed'][2], -1)
    record = Record(
        time,
        {'voltage': voltage, **measured, 'position': runs['position'][2],
         'speed_reference': reference},
        {'voltage': 'V', 'current': 'A', 'speed': 'rad/s', 'position': 'rad',
         'speed_reference': 'rad/s'},
        Provenance('bags/hidden_friction.mcap'),
    )  # fmt: skip
    train, valid = record.split(0.2)
    cut = len(train)
    predictions = [
        tuple({n: runs[n][m][s] for n in runs} for s in (slice(0, cut), slice(cut, None)))
        for m in range(3)
    ]
    models = _models()
    steps = tuple(
        _step(m, models[m], predictions[m], (train, valid), runs, rng) for m in range(3)
    )
    steps = tuple(
        replace(step, candidates=_candidates(m, steps)) for m, step in enumerate(steps)
    )
    floor = _percent({n: NOISE[n] * np.ones(2) for n in NOISE}, valid)['all']
    return Diagnosis(
        Verdict.EFFECT_MISSING,
        ('coulomb_friction', 'cogging_torque'),
        steps,
        floor,
        {**NOISE, 'position': 1e-4},
        (
            'A constant torque against the motion is missing: the unexplained torque is a step '
            'at zero speed.',
            'A torque with 7 waves per turn is missing.',
            'With both, what remains is sensor noise.',
        ),
        (train, valid),
        ('train', 'validate'),
        None,
        4.2,
        ('`L` is known to 4 % only: the record has little current ripple.',),
    )


def _models() -> tuple[Model, Model, Model]:
    values = {'R': R, 'L': L, 'k_t': K, 'J': J}
    sigmas = {'R': 0.004, 'L': 8e-5, 'k_t': 3e-5, 'J': 2e-7, 'b': 2e-6}
    m0 = Model.base('brushed_dc', {**values, 'b': B_BASE}).with_estimates({}, sigmas)
    m1 = m0.with_values({'b': 1.02 * B, 'R': 1.001 * R}).with_effect('coulomb_friction')
    m1 = m1.with_estimates({'coulomb_friction.tau_c': TAU_C}, {'coulomb_friction.tau_c': 7e-5})
    m2 = m1.with_effect('cogging_torque', {'b_1': COGGING, 'n': ORDER})
    more = {f'cogging_torque.{n}': 5e-5 for n in ('a_1', 'b_1', 'a_2', 'b_2')}
    return (m0, *(m.with_estimates({}, {**sigmas, **s}) for m, s in ((m1, {}), (m2, more))))


def _percent(errors: dict[str, Array], record: Record) -> dict[str, float]:
    each = {
        n: 100 * float(np.sqrt(np.mean(e**2)) / np.sqrt(np.mean(record[n] ** 2)))
        for n, e in errors.items()
    }
    return {**each, 'all': float(np.sqrt(np.mean(np.square(list(each.values())))))}


def _step(
    m: int,
    model: Model,
    predictions: tuple[dict[str, Array], ...],
    records: tuple[Record, Record],
    runs: dict[str, Array],
    rng: np.random.Generator,
) -> Step:
    train, valid = (
        _percent({n: record[n] - prediction[n] for n in NOISE}, record)
        for record, prediction in zip(records, predictions, strict=True)
    )
    error = records[1]['speed'] - predictions[1]['speed']
    edges = np.linspace(-150, 150, 13)
    index = np.digitize(records[1]['speed'], edges) - 1
    squares = np.array([np.sum(error[index == k] ** 2) for k in range(12)])
    counts = np.array([np.sum(index == k) for k in range(12)])
    with np.errstate(invalid='ignore', divide='ignore'):
        rms = 100 * np.sqrt(squares / counts) / np.sqrt(np.mean(records[1]['speed'] ** 2))
    where = Where('speed', 'rad/s', edges, rms, squares / squares.sum(), counts / counts.sum())
    return Step(
        model,
        train['all'],
        valid['all'],
        {n: valid[n] for n in NOISE},
        predictions,
        (where,),
        _curves(m, runs, rng),
    )


def _curves(m: int, runs: dict[str, Array], rng: np.random.Generator) -> tuple[Curve, ...]:
    speed, angle = runs['speed'][2], np.mod(runs['position'][2], 2 * np.pi)
    torque = 2e-3 * rng.standard_normal(len(speed))
    torque += ((B_BASE - B) * speed - TAU_C * np.tanh(speed / EPS)) * (m < 1)
    torque -= COGGING * np.sin(ORDER * angle) * (m < 2)
    by_speed = binned(speed, torque, np.linspace(-120, 120, 42))
    by_angle = binned(angle, torque, np.linspace(0, 2 * np.pi, 72))
    by_current = binned(runs['current'][2], torque, np.linspace(-2, 2, 30))
    step = (B_BASE - B) * by_speed[0] - TAU_C * np.tanh(by_speed[0] / EPS) if m < 1 else None
    wave = -COGGING * np.sin(ORDER * by_angle[0]) if m < 2 else None
    return (
        Curve('speed', 'rad/s', 'unexplained torque', 'N m', *by_speed, step),
        Curve('position', 'rad', 'unexplained torque', 'N m', *by_angle, wave),
        Curve('current', 'A', 'unexplained torque', 'N m', *by_current),
    )


def _candidates(m: int, steps: tuple[Step, ...]) -> tuple[Candidate, ...]:
    now = steps[m]
    then = steps[min(m + 1, 2)]
    shares = {
        'stribeck_friction': (0.94, 'mechanical', 0, True, ''),
        'constant_load_torque': (0.987, 'mechanical', 0, False, 'gain in only 2 of 5 stretches'),
        'quadratic_drag': (0.71, 'mechanical', 0, False, 'unphysical sign'),
        'brush_voltage_drop': (1.01, 'electrical', 2, False, 'no gain'),
        'input_delay': (1.003, 'input', 2, False, 'no gain'),
        'armature_heating': (1.0, 'electrical', 2, False, 'not excited by this record'),
    }
    rest = [
        _also_ran(key, factor, place, now, now.curves[curve], passes and m == 0, note)
        for key, (factor, place, curve, passes, note) in shares.items()
    ]
    if m == 2:
        return tuple(replace(c, validation_error_percent=1.002 * now.validation_error_percent,
                             delta_bic=-8.0, note=c.note or 'no gain') for c in rest)  # fmt: skip
    key, name, value = (
        ('coulomb_friction', 'tau_c', TAU_C) if m == 0 else ('cogging_torque', 'b_1', -COGGING)
    )
    found = Candidate(
        key, effect(key).card.title, 'mechanical',
        'tau = -tau_c sign(omega)' if m == 0 else 'tau = a cos(n theta) + b sin(n theta)',
        12_629.0 / (1 + 3 * m), then.train_error_percent, then.validation_error_percent,
        {name: (value, 'N m', 7e-5)}, (), True, '', now.curves[m],
    )  # fmt: skip
    others = [found, *rest]
    if m == 0:
        others.insert(3, _also_ran('cogging_torque', 0.99, 'mechanical', now, now.curves[1], False,
                                   'gain below 1 %'))  # fmt: skip
    return tuple(others)


def _also_ran(
    key: str, factor: float, place: str, now: Step, curve: Curve, passes: bool, note: str
) -> Candidate:
    confusable = ('coulomb_friction',) if key == 'stribeck_friction' else ()
    return Candidate(
        key, effect(key).card.title, place, 'tau = c f(omega)',
        1500 * (1 - factor), factor * now.train_error_percent,
        factor * now.validation_error_percent, {'c': (-3.9e-4, 'N m', 5e-5)}, confusable, passes,
        note, replace(curve, law=np.full_like(curve.x, np.nanmean(curve.mean))),
    )  # fmt: skip
