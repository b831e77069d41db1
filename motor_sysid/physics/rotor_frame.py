"""A synchronous motor seen from axes beside those of its magnet.

The magnet lies an electrical angle ahead of the d axis of the record.  Turned by it, voltages and
currents are those on the axes of the magnet:

    x_m = [cos(angle) sin(angle); -sin(angle) cos(angle)] x
    L_d di_dm/dt = u_dm - R i_dm + omega_e L_q i_qm
    L_q di_qm/dt = u_qm - R i_qm - omega_e (L_d i_dm + psi_f)
    tau = 1.5 pole_pairs (psi_f i_qm + (L_d - L_q) i_dm i_qm)

and the rates of the recorded currents are those of i_m, turned back.

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
def push_d(
    u_d: float, u_q: float, i_d: float, i_q: float, omega_e: float, R: float, L_q: float,
    s: float, c: float,
) -> float:  # fmt: skip
    """Return L_d di_dm/dt on the magnet, in V, from what is on axes beside it."""
    return c * u_d + s * u_q - R * (c * i_d + s * i_q) + omega_e * L_q * (c * i_q - s * i_d)


@law_function
def push_q(
    u_d: float, u_q: float, i_d: float, i_q: float, omega_e: float, R: float, L_d: float,
    psi_f: float, s: float, c: float,
) -> float:  # fmt: skip
    """Return L_q di_qm/dt across the magnet, in V, from what is on axes beside it."""
    flux = L_d * (c * i_d + s * i_q) + psi_f
    return c * u_q - s * u_d - R * (c * i_q - s * i_d) - omega_e * flux


@law_function
def more_on_d(
    u_d: float, u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, angle: float,
) -> float:  # fmt: skip
    """Return the voltage on d beyond the linear core, in V."""
    s, c, omega_e = sine(angle), 1.0 - less_cosine(angle), pole_pairs * omega
    d = push_d(u_d, u_q, i_d, i_q, omega_e, R, L_q, s, c)
    q = push_q(u_d, u_q, i_d, i_q, omega_e, R, L_d, psi_f, s, c)
    return c * d - s * q * (L_d / L_q) - (u_d - R * i_d)


@law_function
def more_on_q(
    u_d: float, u_q: float, i_d: float, i_q: float, omega: float, R: float, L_d: float, L_q: float,
    psi_f: float, pole_pairs: float, angle: float,
) -> float:  # fmt: skip
    """Return the voltage on q beyond the linear core, in V."""
    s, c, omega_e = sine(angle), 1.0 - less_cosine(angle), pole_pairs * omega
    d = push_d(u_d, u_q, i_d, i_q, omega_e, R, L_q, s, c)
    q = push_q(u_d, u_q, i_d, i_q, omega_e, R, L_d, psi_f, s, c)
    return c * q + s * d * (L_q / L_d) - (u_q - R * i_q - omega_e * psi_f)


@law_function
def more_torque(
    i_d: float, i_q: float, L_d: float, L_q: float, psi_f: float, pole_pairs: float, angle: float
) -> float:  # fmt: skip
    """Return the torque beyond the linear core, in N m."""
    s, c = sine(angle), 1.0 - less_cosine(angle)
    along, across = c * i_d + s * i_q, c * i_q - s * i_d
    return 1.5 * pole_pairs * (psi_f * (across - i_q) + (L_d - L_q) * along * across)
