"""Fit of the frequency response: cross spectra first, then the linear motor through them.

    G(w) = S_ry(w) / S_ru(w),    G(w) = C (e^(jw dt) - A)^-1 B of the motor with held input

r is the reference where a controller followed one (the ratio of output and input to their own
would be biased by what is fed back), otherwise the input.  Frequencies are weighed by what their
coherence says of the variance.  Offsets and effects are no part of it.  (Pintelon and Schoukens,
System Identification, 2nd ed. 2012, sections 2.6 and 10.3; Wellstead 1981,
doi:10.1016/0005-1098(81)90084-4.)
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import csd

from motor_sysid.errors import UserError
from motor_sysid.estimation.batch.information import information
from motor_sysid.estimation.batch.methods.reference import moving_references, REFERENCES
from motor_sysid.estimation.batch.methods.rows import result_of
from motor_sysid.estimation.batch.methods.sampled import one_rate
from motor_sysid.estimation.batch.problem import Problem
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

KEY = 'frequency_response'

_SEGMENTS = 6
_LEAST_COHERENCE = 0.5
_SPAN = 0.25
"""Share of the sampling frequency up to which the response is used."""


def fit(problem: Problem) -> FitResult:
    """Fit the linear motor to the frequency response of all records.

    Raises
    ------
    UserError
        If the model has effects, several inputs or an own law, if records differ in their sample
        time, or if nothing coherent was recorded.
    """
    model = problem.model
    records = [stretch.record for stretch in problem.stretches]
    if model.effects:
        raise UserError(
            'a frequency response is that of a linear motor; leave out '
            f'{", ".join(model.effects)} or use another method'
        )
    if model.kind.own is not None or len(model.kind.arguments) > 1:
        raise UserError(
            f'`{KEY}` is for linear motors with one input, not for a {model.kind.title}; '
            'use `least_squares`'
        )
    dt = one_rate(records, KEY)
    angle, response, sigma = measured_response(records, model, problem.outputs)
    free = [p for p in model.parameters.free if p.lower > 0]

    def residual(z: Array) -> Array:
        values = {p.name: float(np.exp(v)) for p, v in zip(free, z, strict=True)}
        there = response_of(model.with_values(values), problem.outputs, dt, angle)
        left = (there - response) / sigma
        return np.concatenate([left.real.ravel(), left.imag.ravel()])

    bounds = np.log([p.lower for p in free]), np.log([p.upper for p in free])
    found = least_squares(residual, np.log([p.value for p in free]), bounds=bounds)
    slope = np.asarray(found.jac, dtype=np.float64)
    names, values = [p.name for p in free], np.exp(found.x)
    spread = information(slope, names, values).bound * np.sqrt(2 * found.cost / len(slope))
    fitted = model.with_values(dict(zip(names, values.tolist(), strict=True)))
    return result_of(problem, fitted, dict(zip(names, spread.tolist(), strict=True)))


def measured_response(
    records: Sequence[Record], model: Model, outputs: Sequence[str]
) -> tuple[Array, Complex, Array]:
    """Return (F,) angle per sample, (F, n_y) response and its standard deviation."""
    width = min(len(r) for r in records) // _SEGMENTS * 2
    total: Complex = np.zeros((width // 2 + 1, 3 + 2 * len(outputs)), dtype=complex)
    for record in records:
        u = record[input_signals(record, model.kind)[0]]
        names = [n for n in REFERENCES if n in record and np.ptp(record[n]) > 0]
        r = record[names[0]] if all(map(moving_references, records)) else u
        pairs = [(r, r), (r, u), (u, u)]
        pairs += [(r, record[n]) for n in outputs] + [(record[n], record[n]) for n in outputs]
        for k, (a, b) in enumerate(pairs):
            total[:, k] += len(record) * csd(a, b, nperseg=width, detrend='constant')[1]
    angle = 2 * np.pi * np.arange(len(total)) / width
    rr, ru = total[:, :1], total[:, 1:2]
    ry, yy = total[:, 3 : 3 + len(outputs)], total[:, 3 + len(outputs) :]
    coherence = np.minimum(np.abs(ry) ** 2 / np.maximum(np.abs(rr * yy), 1e-300), 0.9999)
    response = ry / ru
    count = sum(len(r) for r in records) / width
    sigma = np.abs(response) * np.sqrt((1 - coherence) / (2 * count * coherence + 1e-12))
    good = np.all(coherence > _LEAST_COHERENCE, axis=1)
    good &= (angle > 0) & (angle < 2 * np.pi * _SPAN)
    if good.sum() < 2 * len(model.parameters.free):
        raise UserError('too few frequencies are coherent; excite the motor with a broad signal')
    return angle[good], response[good], sigma[good]


def response_of(model: Model, outputs: Sequence[str], dt: float, angle: Array) -> Complex:
    """Return (F, n_y) response of the motor with a held input at angles per sample.

    A differenced speed is ``(1 - e^(-jw dt)) / dt`` times the angle.
    """
    kind = model.kind
    a, b, _ = (m[0] for m in kind.matrices(
        {name: np.array([v]) for name, v in model.parameters.values().items()}))  # fmt: skip
    n = len(a)
    whole = expm(dt * np.block([[a, b[:, :1]], [np.zeros((1, n + 1))]]))
    shown = {o.signal: kind.states.index(o.state) for o in kind.outputs}
    z = np.exp(1j * angle)[:, np.newaxis, np.newaxis]
    state = np.linalg.solve(z * np.eye(n) - whole[:n, :n], whole[np.newaxis, :n, n:])[:, :, 0]
    found = state[:, [shown[name] for name in outputs]]
    if model.speed_sensor is SpeedSensor.DIFFERENCE and 'speed' in outputs:
        difference = (1 - np.exp(-1j * angle)) / dt
        found[:, outputs.index('speed')] = difference * state[:, kind.states.index('theta')]
    return np.asarray(found)
