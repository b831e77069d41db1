"""Diagnoses of other machines and of other records, for the page to cope with."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from fake_diagnosis import build_diagnosis
import numpy as np

from motor_sysid.diagnosis.result.curves import ChannelError, Curve, Map
from motor_sysid.diagnosis.result.findings import (
    AxisShare,
    BlindSpot,
    Difference,
    InRecord,
    Unknown,
)
from motor_sysid.diagnosis.result.result import Diagnosis, Step, Verdict
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Provenance, Record


def several_records() -> Diagnosis:
    """Return the usual diagnosis with two training records and a third one to validate."""
    whole = build_diagnosis(20.0)
    train, valid = whole.records
    half = len(train) // 2
    sources = ('run/train_1.csv', 'run/train_2.csv', 'run/valid.csv')
    parts = (train.slice(0, half), train.slice(half, len(train)), valid)
    records = tuple(
        replace(part, time=part.time + 1.7e9, provenance=Provenance(source))
        for part, source in zip(parts, sources, strict=True)
    )
    steps = tuple(
        replace(
            step,
            predictions=(
                {n: v[:half] for n, v in step.predictions[0].items()},
                {n: v[half:] for n, v in step.predictions[0].items()},
                step.predictions[1],
            ),
        )
        for step in whole.steps
    )
    return replace(
        whole, records=records, roles=('train', 'train', 'validate'), steps=steps,
        verdict=Verdict.UNKNOWN_EFFECT, effects=(),
        reasons=('The residual repeats every 0.8 s, and no effect of the catalogue does that.',),
        experiment={'what': 'hold 20 rad/s for 30 s', 'why': 'to see whether it is periodic'},
        differences=(of_the_load(sources),),
    )  # fmt: skip


def many_records(count: int = 12) -> Diagnosis:
    """Return the usual diagnosis with its data in many recordings, a third of them held out."""
    whole = build_diagnosis(20.0)
    fitted = count - count // 3
    edges = [np.linspace(0, len(r), n + 1).astype(int).tolist()
             for r, n in zip(whole.records, (fitted, count - fitted), strict=True)]  # fmt: skip
    cuts = [(k, slice(a, b)) for k, own in enumerate(edges) for a, b in pairwise(own)]
    records = tuple(
        replace(whole.records[k].slice(rows.start, rows.stop), provenance=Provenance(f'{n}.csv'))
        for n, (k, rows) in enumerate(cuts)
    )
    steps = tuple(
        replace(step, predictions=tuple(
            {name: values[rows] for name, values in step.predictions[k].items()}
            for k, rows in cuts
        ))
        for step in whole.steps
    )  # fmt: skip
    roles = tuple(whole.roles[k] for k, _ in cuts)
    return replace(whole, records=records, roles=roles, steps=steps)


def of_the_load(sources: Sequence[str]) -> Difference:
    """Return a load that is another in the second record, which was not searched."""
    values = (
        InRecord(sources[0], 1e-3, 1e-3, 1e-3, True),
        InRecord(sources[1], 4e-3, 3.9e-3, 4.1e-3, False),
        InRecord(sources[2], 1.1e-3, 0.9e-3, 1.3e-3, True),
    )
    words = 'constant_load_torque.tau_l (load torque) is not the same in all records'
    return Difference('constant_load_torque.tau_l', 'load torque', 'N m', values, words)


def linear_axis() -> Diagnosis:
    """Return a sledge: force in, position out, no current and no speed; viscous, then dry."""
    time = np.arange(0, 20, 1e-2)
    force = 30 * np.sin(2 * np.pi * 0.4 * time) * (1 + 0.5 * np.sin(0.7 * time))
    positions = []
    for friction in (0.0, 12.0):
        speed = place = 0.0
        track = np.empty(len(time))
        for k, f in enumerate(force):
            track[k] = place
            speed += 1e-2 / 20 * (f - (40 - friction) * speed - friction * np.tanh(speed / 1e-3))
            place += 1e-2 * speed
        positions.append(track)
    noise = 2e-6 * np.random.default_rng(2).standard_normal(len(time))
    record = Record(
        time,
        {'force': force, 'position': positions[1] + noise, 'position_reference': positions[1]},
        {'force': 'N', 'position': 'm', 'position_reference': 'm'},
        Provenance('emps_train.csv.gz'),
    )
    train, valid = record.split(0.2)
    cut = len(train)
    base = Model.base('mechanical_axis', {'J': 20.0, 'b': 40.0}, linear=True)
    models = (base, base.with_values({'b': 28.0}).with_effect('coulomb_friction', {'tau_c': 12.0}))
    steps = tuple(
        Step(model, error, error, {'position': error},
             ({'position': track[:cut]}, {'position': track[cut:]}))
        for model, track, error in zip(models, positions, (31.0, 0.02), strict=True)
    )  # fmt: skip
    return Diagnosis(
        Verdict.EFFECT_MISSING, ('coulomb_friction',), steps, 0.019, {'position': 2e-6},
        ('Dry friction is missing.',), (train, valid), ('train', 'validate'),
    )  # fmt: skip


def three_phases() -> Diagnosis:
    """Return a machine with three voltages and currents; its model is not the matter here."""
    time = np.arange(0, 2, 1e-3)
    phases = {name: 2 * np.pi * k / 3 for k, name in enumerate('abc')}
    voltages = {f'voltage_{n}': 10 * np.cos(30 * time - p) for n, p in phases.items()}
    currents = {f'current_{n}': 2 * np.cos(30 * time - p - 0.4) for n, p in phases.items()}
    speed = 15 + np.sin(6 * time)
    units = {**dict.fromkeys(voltages, 'V'), **dict.fromkeys(currents, 'A'), 'speed': 'rad/s'}
    record = Record(time, {**voltages, **currents, 'speed': speed}, units)
    guess = {n: 0.9 * v for n, v in {**currents, 'speed': speed}.items()}
    step = Step(Model.base('brushed_dc'), 10.0, 10.0, dict.fromkeys(guess, 10.0), (guess,))
    return Diagnosis(Verdict.INSUFFICIENT_DATA, (), (step,), 1.0, {}, (), (record,), ('validate',))


def awkward() -> Diagnosis:
    """Return a diagnosis of the worst taste: no noise figures, diverging model, odd names."""
    time = np.cumsum(np.random.default_rng(0).uniform(1e-3, 5e-2, 300))
    speed = np.sin(time)
    speed[100:140] = np.nan
    diverged = np.full(300, np.inf)
    diverged[:5] = 1e300
    record = Record(
        time,
        {'voltage': np.zeros(300), 'speed': speed, 'hall_sector': np.ones(300)},
        {'voltage': 'V', 'speed': 'rad/s', 'hall_sector': '1'},
        Provenance('</script><script>document.title="owned"</script>'),
    )
    nothing = np.full(3, np.nan)
    curve = Curve('time', 's', 'unexplained voltage', 'V', np.arange(3.0), nothing, nothing)
    step = Step(Model.base('brushed_dc_reduced'), np.nan, np.inf, {}, ({'speed': diverged},),
                curves=(curve,))  # fmt: skip
    reason = 'a < b & "c" > d: </script><img src=x onerror=alert(1)>'
    return Diagnosis(
        Verdict.AMBIGUOUS, (), (step,), 0.0, {}, (reason,), (record,), ('train',),
        seconds=float('nan'),
    )  # fmt: skip


def tiny() -> Diagnosis:
    """Return a record of two samples."""
    record = Record(np.array([0.0, 1.0]), {'speed': np.zeros(2)}, {'speed': 'rad/s'})
    step = Step(Model.base('brushed_dc_reduced'), 0.0, 0.0, {'speed': 0.0},
                ({'speed': np.zeros(2)},))  # fmt: skip
    return Diagnosis(Verdict.COMPLETE, (), (step,), 0.0, {}, (), (record,), ('validate',))


def unknown_shape() -> Diagnosis:
    """Return a diagnosis with everything that tells where and what: maps, bands, an unknown."""
    whole = build_diagnosis(10.0)
    base = whole.steps[0]
    edges_x, edges_y = np.linspace(-100, 100, 6), np.linspace(-2, 2, 5)
    value = 5e-3 * np.outer(np.linspace(-1, 1, 4), np.linspace(-1, 1, 5))
    value[0, 0] = np.nan
    axes = ('speed', 'rad/s', 'current', 'A')
    maps = (
        Map(*axes, 'speed error', 'rad/s', edges_x, edges_y, np.abs(value) * 400, value * 0 + 0.1),
        Map(*axes, 'current error', 'A', edges_x, edges_y, np.abs(value) * 9, value * 0 + 1e-3),
        Map(*axes, 'unexplained torque', 'N m', edges_x, edges_y, value, value * 0 + 2e-3),
    )
    rms = np.linspace(0.3, 2.0, 12)
    rms[3] = np.nan
    channels = {
        'speed': ChannelError('rad/s', 1.1, rms, 0.8 * rms, 1.3 * rms, 1e-5),
        'current': ChannelError('A', 0.02, 0.02 + 0 * rms, 0.01 + 0 * rms, 0.03 + 0 * rms, 0.6),
    }
    curves = (
        replace(base.curves[0], chance=1e-9),
        replace(base.curves[1], chance=0.4, law=None),
        base.curves[2],
    )
    step = replace(
        base, maps=maps, curves=curves, where=(replace(base.where[0], channels=channels),)
    )
    shares = (('speed', 0.93, True), ('recent input', 0.6, False), ('time', 0.02, False))
    found = Unknown(
        'torque', 'unexplained torque', 'N m', 4e-3, 1e-3, 'speed', 0.93,
        'odd, constant beyond 2 rad/s', 1.1e-2,
        'The unexplained torque looks like a function of speed: odd, constant beyond 2 rad/s.',
        tuple(AxisShare('torque', 'unexplained torque', 'N m', a, v, 9.0, b)
              for a, v, b in shares),
        curves[0],
    )  # fmt: skip
    quiet = replace(
        found, quantity='unexplained voltage', axis='', shape='', curve=None, axes=(),
        words='The unexplained voltage is no more than sensor noise makes.',
    )  # fmt: skip
    spot = BlindSpot('one_direction', ('b',), (), 'It turns one way only.', 'record both')
    return replace(
        whole, verdict=Verdict.UNKNOWN_EFFECT, effects=(), steps=(step,),
        reasons=('Something is missing.', found.words), unknown=(found, quiet),
        blind_spots=(spot,),
    )  # fmt: skip
