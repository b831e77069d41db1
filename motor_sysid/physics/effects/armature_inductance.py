"""The winding's inductance, which a motor whose current is not measured leaves out.

    t_e dv_i/dt = u - k_v omega - v_i,  t_e = L / R

drives the rotor by ``v_i = R i`` in place of ``u - k_v omega``.  A linear motor with a sensor of
the speed that lags by as much makes the same record; but inductance every winding has.
"""

from motor_sysid.physics.effect import Amplitude, Card, Enters, Scale

CARD = Card(
    title='inductance of the winding',
    equation='v = v_i - (u - k_v omega),  t_e dv_i/dt = u - k_v omega - v_i',
    symptom='The speed sets out a moment later than the voltage, with a round corner.',
    reference='Krishnan, Electric Motor Drives, 2001, section 2.5',
    enters=Enters.ELECTRICAL,
    amplitudes=(
        Amplitude('t_e', 's', 'electrical time constant', Scale.SAMPLE, 50.0, positive=True,
                  trials=(0.3, 1.0, 4.0)),
    ),
    axis='time',
    states=('v_i',),
    linear=True,
    inherent=3e-3,
)  # fmt: skip


def voltage_reduced(omega: float, u: float, k_v: float, v_i: float, t_e: float) -> float:
    """Voltage in V."""
    return (v_i - u + k_v * omega) * t_e / (t_e + 1e-7)


def rate(omega: float, u: float, k_v: float, v_i: float, t_e: float) -> float:
    """Rate of the voltage behind the winding in V/s."""
    return (u - k_v * omega - v_i) / (t_e + 1e-7)
