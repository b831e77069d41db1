"""Friction that changes with time: grease that warms, a seal that runs in, wear."""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale, Shape
from motor_sysid.physics.laws import settling, smooth_sign

CARD = Card(
    title='friction drift',
    equation='tau = -t_d (1 - exp(-t/t_d)) (d_c sign(omega) + d_v omega)  (t: time since the '
    'start of the record; where t_d is long, -t (d_c sign(omega) + d_v omega))',
    symptom='The same motion needs less (or more) current at the end of the record than at its '
    'beginning.',
    reference='Bittencourt and Gunnarsson, J. Dyn. Syst. Meas. Control 134 (2012), Static '
    'friction in a robot joint: modeling and identification of load and temperature effects',
    enters=Enters.MECHANICAL,
    amplitudes=(
        Amplitude('d_c', 'N m/s', 'growth of Coulomb friction in a second, as the record begins',
                  Scale.DRIFT),
        Amplitude('d_v', 'N m/rad', 'growth of viscous friction in a second, as the record begins',
                  Scale.VISCOUS_DRIFT),
    ),
    shapes=(
        Shape('t_d', 's', 'time constant with which the growth comes to an end', Scale.DURATION,
              (1e4,), 0.15, 1e4, free=False, bends=(0.4,)),
    ),
    axis='time',
    drains={
        'd_c': ('coulomb_friction.tau_c', 'stribeck_friction.tau_c', 'lugre_friction.tau_c',
                'asymmetric_coulomb_friction.tau_c_plus'),
        'd_v': ('b', 'k_v'),
    },
    settles='t_d',
)  # fmt: skip


def torque(
    omega: float, t: float, omega_eps: float, d_c: float, d_v: float, t_d: float
) -> float:
    """Torque in N m."""
    return -settling(t, t_d) * (d_c * smooth_sign(omega, omega_eps) + d_v * omega)
