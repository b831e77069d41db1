"""What counts hide of a law with waves over a turn: standard errors for positions in counts.

A law sees the angle that an encoder shows, up to half a count away from where the rotor is; and a
rotor that rests stays as far away as it came to rest.  A wave that is seen through counts of width
q is smaller by ``sin(x) / x`` with ``x = h n q / 2`` for its harmonic h.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.estimation.batch import Chain
from motor_sysid.physics.effect import Amplitude, arguments, Effect, Law
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.lattice import lattice

Array = NDArray[np.float64]

POINTS = 256
"""Angles within a wave at which a law is looked at."""

SAME = 0.1
"""Relative difference in what is hidden of two amplitudes that belong to one harmonic."""


def with_blur(model: Model, chains: Sequence[Chain]) -> Model:
    """Return a fitted model whose waves over a turn have what counts hide in standard errors.

    What is hidden of one amplitude of a harmonic may turn up as the other.
    """
    waves = [key for key in model.effects if effect(key).card.orders]
    count = width_of_count(chains) if waves else 0.0
    found = {}
    for key in waves if count else ():
        hidden = _hidden(model, model.effect(key), count)
        for name, share in hidden.items():
            p = model.parameters[f'{key}.{name}']
            alike = [other for other, s in hidden.items() if abs(s - share) <= SAME * share]
            size = float(np.hypot.reduce([model[f'{key}.{other}'] for other in alike]))
            if p.free and p.sigma is not None:
                found[p.name] = float(np.hypot(p.sigma, share * size))
    return model.with_estimates({}, found)


def width_of_count(chains: Sequence[Chain]) -> float:
    """Return the width (rad) of a count of the position that laws see, 0 if there are none."""
    widths = [0.0]
    for position in (s.drive.position for chain in chains for s in chain):
        found = lattice(np.diff(position)) if position.size else None
        widths.append(found.step if found else 0.0)
    return max(widths)


def _hidden(model: Model, one: Effect, count: float) -> dict[str, float]:
    """Return the name of each amplitude to the share of its wave that counts hide."""
    law = next((law for law in one.laws.values() if 'theta' in arguments(law)), None)
    if law is None:
        return {}
    waves = model[f'{one.key}.{one.card.orders}']
    theta = 2 * np.pi / waves * np.arange(POINTS) / POINTS
    seen = np.sinc(0.5 * waves * count / np.pi * np.arange(POINTS // 2 + 1))
    hidden = {}
    for amplitude in one.card.amplitudes:
        power = np.abs(np.fft.rfft(_wave(law, one, amplitude, theta, waves))) ** 2
        total = float(np.sum(power[1:]))
        if total > 0.0:
            hidden[amplitude.name] = 1.0 - float(power[1:] @ seen[1:]) / total
    return hidden


def _wave(law: Law, one: Effect, amplitude: Amplitude, theta: Array, waves: float) -> Array:
    """Return a law at the angles (N,), with one amplitude 1 and the others 0."""
    own = {a.name: 0.0 for a in one.card.amplitudes}
    own |= {amplitude.name: 1.0, one.card.orders: waves, 'turn': 0.0}
    names = arguments(law)
    return np.array([
        law(*(angle if name == 'theta' else own.get(name, 1.0) for name in names))
        for angle in theta
    ])  # fmt: skip
