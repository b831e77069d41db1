"""The numbers of a true motor: one flat tuple that the compiled simulator understands."""

from typing import NamedTuple


class Plant(NamedTuple):
    """A brushed DC motor with everything that may be hidden in it; zero switches a part off.

    Attributes
    ----------
    R, L, k, J, b:
        Resistance in ohm, inductance in H, torque and back-EMF constant in N m/A, inertia of
        rotor and load in kg m^2, viscous friction in N m s/rad.
    tau_plus, tau_minus:
        Dry friction when turning forward and back, N m.
    tau_s, omega_s, sharpness:
        Rise of dry friction near standstill, N m, its speed, rad/s, and its exponent:
        ``tau_s exp(-|omega/omega_s|^sharpness)``.
    drag:
        ``drag omega |omega|``, N m s^2/rad^2.
    tau_l:
        Constant load torque against positive speed, N m.
    gravity, gravity_angle:
        ``gravity sin(theta - gravity_angle)``, N m and rad.
    cogging, cogging_angle, second, second_angle, order:
        Cogging torque ``cogging sin(order theta + cogging_angle)
        + second sin(2 order theta + second_angle)``, N m, rad, waves per turn.
    delay:
        Time from command to voltage, s.
    v_b:
        Brush voltage drop against the current, V.
    heat, t_th:
        Relative rise of resistance per stored loss energy, 1/J, and thermal time constant, s.
    share, stiffness, damping, gap:
        Share of the inertia that sits behind an elastic shaft, its stiffness in N m/rad, damping
        in N m s/rad, and half the backlash in rad.
    step_torque, step_time:
        Load torque that comes on, N m, and when, s.
    inertia_gain, inertia_time:
        Relative rise of the inertia, and when, s.
    i_sat:
        Current over which torque saturates, A; 0 for none: the constants are ``k tanh(x) / x``
        with ``x`` the current over this one.
    bristle, bend, stiction:
        LuGre friction: Coulomb torque, N m, bend at which bristles slip, rad, and stiction over
        Coulomb torque at speeds well below `omega_s`; its damping is critical at rest.
    drift_dry, drift_viscous:
        Growth of dry friction, N m/s, and of viscous friction, N m/rad.
    swing, frequency, swing_angle:
        ``swing sin(2 pi frequency t + swing_angle)``, N m, Hz, rad.
    ripple, ripple_order, ripple_angle:
        Relative ripple ``ripple sin(ripple_order theta + ripple_angle)`` of torque constant and
        back-EMF.
    iron:
        ``iron sqrt(|omega|) sign(omega)``, N m s^0.5/rad^0.5.
    v_dead, i_dead:
        Voltage lost to dead time, V, in full beyond this current, A.
    coast, coast_voltage:
        Share of the pause in which the bridge lets go, and voltage at which there is no pause, V.
    soft, i_soft:
        Relative excess of the inductance without current, half gone at this current, A.
    current_lag:
        Time constant of the current sensor's filter, s.
    gear_loss:
        Dry friction per torque that the motor makes, whichever way it turns.
    sag:
        Source resistance over supply voltage squared, 1/(V A): of a duty ``u/V`` the supply gives
        ``u/V i``, and its voltage falls by that times its resistance.
    top_voltage:
        Highest voltage that the bridge gives, V; 0 for no limit.
    """

    R: float
    L: float
    k: float
    J: float
    b: float
    tau_plus: float = 0.0
    tau_minus: float = 0.0
    tau_s: float = 0.0
    omega_s: float = 1.0
    sharpness: float = 2.0
    drag: float = 0.0
    tau_l: float = 0.0
    gravity: float = 0.0
    gravity_angle: float = 0.0
    cogging: float = 0.0
    cogging_angle: float = 0.0
    second: float = 0.0
    second_angle: float = 0.0
    order: float = 0.0
    delay: float = 0.0
    v_b: float = 0.0
    heat: float = 0.0
    t_th: float = 1.0
    share: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    gap: float = 0.0
    step_torque: float = 0.0
    step_time: float = 0.0
    inertia_gain: float = 0.0
    inertia_time: float = 0.0
    i_sat: float = 0.0
    bristle: float = 0.0
    bend: float = 1.0
    stiction: float = 0.0
    drift_dry: float = 0.0
    drift_viscous: float = 0.0
    swing: float = 0.0
    frequency: float = 0.0
    swing_angle: float = 0.0
    ripple: float = 0.0
    ripple_order: float = 0.0
    ripple_angle: float = 0.0
    iron: float = 0.0
    v_dead: float = 0.0
    i_dead: float = 1.0
    coast: float = 0.0
    coast_voltage: float = 1.0
    soft: float = 0.0
    i_soft: float = 1.0
    current_lag: float = 0.0
    gear_loss: float = 0.0
    sag: float = 0.0
    top_voltage: float = 0.0
