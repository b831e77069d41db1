"""A synchronous motor seen from axes beside those of its magnet.

The magnet lies an electrical angle ahead of the d axis of the record.  Its flux and the axes of
the inductances turn with it:

    flux_d = L_dd i_d + L_x i_q + psi_f cos(angle)
    flux_q = L_x i_d + L_qq i_q + psi_f sin(angle)
    [L_dd L_x; L_x L_qq] d/dt [i_d; i_q] = [u_d - R i_d + omega_e flux_q;
                                            u_q - R i_q - omega_e flux_d]
    tau = 1.5 pole_pairs (flux_d i_q - flux_q i_d)

The functions return what that has beyond the linear core of the motor, for laws to add.  Angles
are those between axes that should be one: up to a radian.  (Krishnan, Electric Motor Drives, 2001,
chapter 9.)
"""

from motor_sysid.physics.laws import law_function


@law_function
def sine(angle: float) -> float:
    """Return the sine of an angle in rad, within 2e-6 up to 0.5 rad and 2e-4 up to 1 rad."""
    z = angle * angle
    return angle * (1.0 - z / 6.0 * (1.0 - z / 20.0))


@law_function
def less_cosine(angle: float) -> float:
    """Return one minus the cosine, within 1e-7 up to 0.5 rad and 3e-5 up to 1 rad."""
    z = angle * angle
    return 0.5 * z * (1.0 - z / 12.0 * (1.0 - z / 30.0))


@law_function
def crossed(L_d: float, L_q: float, angle: float) -> float:
    """Return the inductance L_x from one recorded axis to the other, in H."""
    return (L_d - L_q) * sine(angle) * (1.0 - less_cosine(angle))


@law_function
def turned(L_d: float, L_q: float, angle: float) -> float:
    """Return what turning takes from the inductance on d and gives that on q, in H."""
    s = sine(angle)
    return (L_d - L_q) * s * s


@law_function
def forced_d(
    u_d: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, angle: float,
) -> float:  # fmt: skip
    """Return the rate of the flux on the recorded d axis, in V."""
    own, other = L_q + turned(L_d, L_q, angle), crossed(L_d, L_q, angle)
    flux = other * i_d + own * i_q + psi_f * sine(angle)
    return u_d - R * i_d + pole_pairs * omega * flux


@law_function
def forced_q(
    u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, angle: float,
) -> float:  # fmt: skip
    """Return the rate of the flux on the recorded q axis, in V."""
    own, other = L_d - turned(L_d, L_q, angle), crossed(L_d, L_q, angle)
    flux = own * i_d + other * i_q + psi_f * (1.0 - less_cosine(angle))
    return u_q - R * i_q - pole_pairs * omega * flux


@law_function
def more_on_d(
    u_d: float, u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, angle: float,
) -> float:  # fmt: skip
    """Return the voltage on d beyond the linear core, in V."""
    d = forced_d(u_d, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, angle)
    q = forced_q(u_q, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, angle)
    more = turned(L_d, L_q, angle) * d - crossed(L_d, L_q, angle) * q
    return d + more / L_q - (u_d - R * i_d)


@law_function
def more_on_q(
    u_d: float, u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, angle: float,
) -> float:  # fmt: skip
    """Return the voltage on q beyond the linear core, in V."""
    d = forced_d(u_d, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, angle)
    q = forced_q(u_q, i_d, i_q, omega, R, L_d, L_q, psi_f, pole_pairs, angle)
    less = turned(L_d, L_q, angle) * q + crossed(L_d, L_q, angle) * d
    return q - less / L_d - (u_q - R * i_q - pole_pairs * omega * psi_f)


@law_function
def more_torque(
    i_d: float, i_q: float, L_d: float, L_q: float, psi_f: float, pole_pairs: float, angle: float
) -> float:  # fmt: skip
    """Return the torque beyond the linear core, in N m."""
    lost = sine(angle) * i_d + less_cosine(angle) * i_q
    pulled = (L_d - L_q - 2.0 * turned(L_d, L_q, angle)) * i_d * i_q
    leaning = crossed(L_d, L_q, angle) * (i_q * i_q - i_d * i_d)
    return 1.5 * pole_pairs * (pulled + leaning - psi_f * lost)
