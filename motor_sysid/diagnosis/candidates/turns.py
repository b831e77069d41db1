"""Sums over a record for waves of every order over a turn of the rotor.

A step of the simulation takes of a wave the mean of its ends, so a wave that passes within a few
samples counts less; see `motor_sysid.physics.laws.step_share`.
"""

import numpy as np
from numpy.typing import NDArray

from motor_sysid.machine_code import kept
from motor_sysid.physics.laws import step_share
from motor_sysid.physics.native import LANES

Array = NDArray[np.float64]

FADED = 10.0
"""Angle of a wave, rad, that a step covers, from which on the wave tells nothing: its share of a
step is a thousandth."""

_LENGTHS = 4096
"""Lengths of a step that are told apart: most energies are right to half a per cent."""


@kept(nogil=True, error_model='numpy', fastmath={'reassoc', 'contract'})
def add_waves(theta, step, pull, total):  # type: ignore[no-untyped-def]
    """Add to `total` (top + 1,) the correlation of one stretch with cosine and sine of each order.

    Parameters
    ----------
    theta, step:
        (N,) rotor angle, and how far it turns in a step, rad.
    pull:
        (N,) correlation with a pulse times the carrier, summed over forces.
    """
    first_real, first_imag = np.empty(LANES), np.empty(LANES)
    real, imag = np.empty(LANES), np.empty(LANES)
    length, force = np.empty(LANES), np.empty(LANES)
    for begin in range(0, theta.size, LANES):
        for k in range(LANES):
            t = min(begin + k, theta.size - 1)
            first_real[k], first_imag[k] = np.cos(theta[t]), np.sin(theta[t])
            real[k], imag[k] = 1.0, 0.0
            length[k], force[k] = step[t], pull[t] if begin + k < theta.size else 0.0
        shortest = np.min(length)
        for n in range(1, total.size):
            if n * shortest > FADED:
                break
            cosine, sine = 0.0, 0.0
            for k in range(LANES):
                turned = real[k] * first_real[k] - imag[k] * first_imag[k]
                imag[k] = real[k] * first_imag[k] + imag[k] * first_real[k]
                real[k] = turned
                weight = step_share(n * length[k]) * force[k]
                weight = weight if n * length[k] <= FADED else 0.0
                cosine += weight * real[k]
                sine += weight * imag[k]
            total[n] += complex(cosine, sine)


def by_length(step: Array, square: Array) -> tuple[Array, Array]:
    """Sum (N,) squared carriers over steps (rad) of nearly one length.

    Returns
    -------
    (K,) lengths in rad, and sums.
    """
    place = np.minimum(step * (_LENGTHS / max(float(np.max(step)), 1e-300)), _LENGTHS - 1)
    place = place.astype(np.int64)
    size, length = (
        np.bincount(place, weights, _LENGTHS).astype(np.float64)
        for weights in (square, square * step)
    )
    there = size > 0.0
    return length[there] / size[there], size[there]


@kept(nogil=True, error_model='numpy')
def add_energy(step, square, power, energy):  # type: ignore[no-untyped-def]
    """Add to `energy` (top + 1,) that of the cosine (or sine) of each order in the outputs.

    It is the same for all steps of one length; `power` is straight between its places.

    Parameters
    ----------
    step, square:
        (K,) how far the rotor turns in a step, rad, and the squared carrier of such steps.
    power:
        (B,) energy of the whitened outputs per energy of a sine, from zero to half the rate.
    """
    bins = power.size - 1
    for k in range(step.size):
        for n in range(1, energy.size):
            if n * step[k] > FADED:
                break
            share = step_share(n * step[k])
            place = min(n * step[k] * bins / np.pi, bins - 1e-6)
            at = int(place)
            there = power[at] + (place - at) * (power[at + 1] - power[at])
            energy[n] += 0.5 * share * share * square[k] * there
