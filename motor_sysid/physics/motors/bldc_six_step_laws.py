"""What happens at once where a six-step drive passes the current from one phase to the next.

With ``i = (i_into - i_out)/2`` of the two phases that drive, the star point drops out, and

    L di/dt = u - R i - k_t omega      (L, R, k_t between two terminals)

holds even while the phase that was just left still frees itself of its current through the diodes.
Where the drive commutates, one of the two phases is another one, which carries nothing yet: the
current between them is half of what it was, whatever the drive, the speed and the motor are.

The phase that was left goes on making torque until it is free; with ``2/3 (v_f/2 + k_t omega/2)``
across its inductance that is an impulse of ``3/8 k_t L i^2 / (v_f + k_t omega)``.  Both hold where
a phase is free before the next commutation.
(Derived here from the phase equations; `test/test_six_step.py` compares with their simulation.
On the torque while a phase frees itself: Carlson, Lajoie-Mazenc and Fagundes, IEEE Trans. Ind.
Appl. 28 (1992) 632, Analysis of torque ripple due to phase commutation in brushless DC machines.)
"""

import numpy as np

from motor_sysid.physics.effect import Card, Enters
from motor_sysid.physics.laws import law_function, PI

CARD = Card(
    title='commutation',
    equation='i -> i/2 wherever the rotor passes from one sector to the next',
    symptom='The current drops to half six times in an electrical turn, and recovers within the '
    'electrical time constant.',
    reference='Carlson, Lajoie-Mazenc and Fagundes, IEEE Trans. Ind. Appl. 28 (1992) 632',
    enters=Enters.ELECTRICAL,
    amplitudes=(),
)


@law_function
def sectors(theta: float, pole_pairs: float, angle_offset: float) -> float:
    """Return the angle in sectors; at whole numbers the drive commutates."""
    return (pole_pairs * theta + angle_offset) * 3.0 / PI - 0.5


@law_function
def crossed(before: float, now: float) -> float:
    """Return how many commutations lie between two angles in sectors."""
    return np.abs(np.floor(now) - np.floor(before))  # type: ignore[no-any-return]


@law_function
def share_since(before: float, now: float) -> float:
    """Return which share of the way between two angles in sectors lies behind the last edge."""
    edge = np.floor(np.maximum(before, now))
    way = np.maximum(np.abs(now - before), 1e-12)
    return np.minimum(np.abs(now - edge) / way, 1.0) * np.minimum(crossed(before, now), 1.0)  # type: ignore[no-any-return]


@law_function
def part_of(sector: float) -> float:
    """Return the part of a phase in the pair's current, counted from the phase's first sector.

    The first two are those in which forward torque asks for a negative current in it.
    """
    own = sector - 6.0 * np.floor(sector / 6.0)
    out, into = (own < 1.5) * 0.5, ((own > 2.5) & (own < 4.5)) * 0.5
    return into - out  # type: ignore[no-any-return]


def current_sensor(
    theta: float, pole_pairs: float, angle_offset: float, current_offset_a: float,
    current_offset_b: float,
) -> float:  # fmt: skip
    """Offset in A of a current that is the difference of two phases, each with its own sensor."""
    sector = np.floor(sectors(theta, pole_pairs, angle_offset))
    return part_of(sector) * current_offset_a + part_of(sector - 2.0) * current_offset_b


@law_function
def settled(x: float) -> float:
    """Return ``1 - exp(-x)`` for x from 0 on, to 0.012."""
    return 1.0 - 1.0 / (1.0 + x * (1.0 + x * (1.0 / 2.0 + x * (1.0 / 6.0 + x / 24.0))))


def jump_i(
    i: float, omega: float, theta: float, theta_before: float, step: float, u: float,
    voltage: float, slope: float, R: float, L: float, k_t: float, emf_ratio: float,
    pole_pairs: float, angle_offset: float,
) -> float:  # fmt: skip
    """Change of the current in A, as it is at the end of the step in which it happened."""
    before = sectors(theta_before, pole_pairs, angle_offset)
    now = sectors(theta, pole_pairs, angle_offset)
    resistance = R - slope
    since = settled(step * share_since(before, now) * resistance / L)
    end = (u + voltage - slope * i - k_t * emf_ratio * omega) / resistance
    return (0.5 ** crossed(before, now) - 1.0) * i + 0.5 * since * end  # type: ignore[no-any-return]


def jump_omega(
    i: float, omega: float, theta: float, theta_before: float, step: float, u: float,
    voltage: float, slope: float, R: float, L: float, k_t: float, emf_ratio: float, J: float,
    pole_pairs: float, angle_offset: float, v_free: float,
) -> float:  # fmt: skip
    """Change of the speed in rad/s: for less current since, and for the phase that was left."""
    before = sectors(theta_before, pole_pairs, angle_offset)
    now = sectors(theta, pole_pairs, angle_offset)
    resistance = R - slope
    since = settled(step * share_since(before, now) * resistance / L)
    induced = k_t * emf_ratio * omega
    end = (u + voltage - slope * i - induced) / resistance
    then = end + (i - end) / np.maximum(1.0 - since, 0.1)
    against = np.maximum(v_free + np.sign(then) * induced, 0.2 * v_free)
    size = np.abs(then)
    slower = 1.0 + R * size / against
    time = 1.5 * L * size / (against + 0.75 * R * size)
    fading = np.maximum(1.0 - 2.0 / PI * pole_pairs * np.abs(omega) * time, 0.0)
    freeing = 0.375 * L * then * size / (against * slower) * fading
    less = 0.5 * then * since * L / resistance
    return np.minimum(crossed(before, now), 1.0) * k_t / J * (freeing - less)  # type: ignore[no-any-return]
