"""A PID controller: limited output, anti-windup, filtered derivative of the measurement."""

from dataclasses import dataclass
import math

from motor_sysid.errors import UserError


@dataclass(frozen=True)
class PidGains:
    """Gains of ``u = kp e + ki integral(e) - kd dy/dt``.

    Attributes
    ----------
    kp, ki, kd:
        Output per error, per error and second, and per change of the measurement per second.
    derivative_filter:
        Time constant of the low-pass on the derivative in s; 0 for none.
    lower, upper:
        Limits of the output.
    """

    kp: float
    ki: float = 0.0
    kd: float = 0.0
    derivative_filter: float = 0.0
    lower: float = -math.inf
    upper: float = math.inf

    def __post_init__(self) -> None:
        """Refuse limits that are the wrong way round and a negative time constant."""
        if not self.lower < self.upper:
            raise UserError(f'output limits {self.lower:g} to {self.upper:g} leave no range')
        if self.derivative_filter < 0:
            raise UserError(f'derivative filter {self.derivative_filter:g} s is negative')


class Pid:
    """The controller with its memory.

    The derivative acts on the measurement, so that a step of the reference does not kick.  While
    the output is limited the integral only moves back towards the range (Astrom and Hagglund,
    Advanced PID Control, 2006, section 3.5), so it cannot wind up.  The integral is kept as a
    share of the output: changing ``ki`` on the way makes no jump.
    """

    def __init__(self, gains: PidGains) -> None:
        self.gains = gains
        self.reset()

    def reset(self) -> None:
        """Forget everything but the gains."""
        self._integral = 0.0
        self._derivative = 0.0
        self._last: float | None = None

    def with_gains(self, gains: PidGains) -> 'Pid':
        """Return a controller with other gains that goes on from here."""
        other = Pid(gains)
        other._integral = min(max(self._integral, gains.lower), gains.upper)
        other._derivative, other._last = self._derivative, self._last
        return other

    def step(self, reference: float, measurement: float, dt: float) -> float:
        """Return the output for one sample.

        Parameters
        ----------
        reference, measurement:
            In the same unit.
        dt:
            Time since the sample before, s.

        Raises
        ------
        UserError
            If `dt` is not positive.
        """
        if dt <= 0:
            raise UserError(f'dt = {dt:g} s must be positive; check the stamps')
        g = self.gains
        error = reference - measurement
        proportional = g.kp * error - g.kd * self._slope(measurement, dt)
        integral = self._integral + g.ki * error * dt
        wanted = proportional + integral
        output = min(max(wanted, g.lower), g.upper)
        if wanted == output or (wanted > output) != (integral > self._integral):
            self._integral = integral
        return output

    def _slope(self, measurement: float, dt: float) -> float:
        last, self._last = self._last, measurement
        if last is None:
            return 0.0
        share = dt / (self.gains.derivative_filter + dt)
        self._derivative += share * ((measurement - last) / dt - self._derivative)
        return self._derivative
