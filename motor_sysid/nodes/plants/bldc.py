"""A BLDC motor in six steps, whose drive follows the current of the two phases that are on."""

from collections.abc import Mapping
import math

from numba import njit

from motor_sysid.control.foc import FASTEST
from motor_sysid.control.six_step import SixStep, SixStepLoop
from motor_sysid.nodes.plants.base import Plant, Sample, Setup, Three
from motor_sysid.physics.effect import Law
from motor_sysid.physics.motors.bldc_laws import voltage_a, voltage_b
from motor_sysid.physics.stepper import Stepper
from motor_sysid.signals.phases import sector_at

INDUCED_A: Law = njit()(voltage_a)
INDUCED_B: Law = njit()(voltage_b)
"""What the motor induces in two of its phases against the mean of all, compiled."""

DIODE = 0.7
"""Forward voltage of the free-wheeling diodes, V."""


class BldcPlant(Plant):
    """The drive switches at its own rate, by Hall sectors.

    The phase that is off frees itself through its diodes and then shows what the motor induces:
    its terminal lies, in the mean over a control period, where its current becomes and stays zero,
    if the rails allow it.  Published are the phase currents at the sample and the mean terminal
    voltages until the next.
    """

    frame, command = 'abc', 'current'

    def _stepper(self, setup: Setup) -> Stepper:
        self._period, base = setup.control_period, setup.base
        loop = SixStepLoop.of(base, 0.9 * FASTEST / self._period, setup.current_limit)
        self._drive = SixStep(loop, setup.supply, self._period)
        self._pairs, self._offset = base['pole_pairs'], base['angle_offset']
        shape = base['flat'], base['corner']
        self._wave = base['k_e'], self._pairs, self._offset, *shape
        self._inertial = base['L'] / self._period - 0.5 * base['R']
        return Stepper(setup.model, self._period, max(setup.substeps // setup.periods, 1))

    def reset(self) -> None:
        """Start again at rest at position 0."""
        super().reset()
        self._drive.reset()

    def sample(self, command: float) -> Sample:
        """Measure, then follow the command in A for as many control periods as a sample has."""
        state, periods = self.stepper.state, self.setup.periods
        speed, position = self.sensors.motion(self.stepper.outputs, state)
        current, total = self._measured(), [0.0, 0.0, 0.0]
        for k in range(periods):
            measured = self._measured() if k else current
            sector = sector_at(self._pairs * state['theta'] + self._offset)
            terminals = self._terminals(self._drive.step(measured, sector, speed, command), state)
            self.stepper.step(terminals)
            state = self.stepper.state
            total = [mean + v / periods for mean, v in zip(total, terminals, strict=True)]
        return Sample(current, speed, position, (total[0], total[1], total[2]))

    def _measured(self) -> Three:
        """Return the phase currents as the sensors show them, A."""
        shown = self.stepper.outputs
        return self.sensors.phases(shown['current_a'], shown['current_b'])

    def _terminals(self, legs: Three, state: Mapping[str, float]) -> Three:
        """Return the terminal voltages of the next period, V: NaN replaced by what floats."""
        off = next(k for k in range(3) if math.isnan(legs[k]))
        a, b = state['i_a'], state['i_b']
        driven = sum(v for k, v in enumerate(legs) if k != off)
        induced = self._induced(off, state['omega'], state['theta'])
        free = 0.5 * driven + 1.5 * (induced - self._inertial * (a, b, -a - b)[off])
        floating = min(max(free, -DIODE), self.setup.supply + DIODE)
        u_a, u_b, u_c = (floating if k == off else v for k, v in enumerate(legs))
        return u_a, u_b, u_c

    def _induced(self, phase: int, omega: float, theta: float) -> float:
        """Return the back-EMF of a phase less the mean of all, halfway through the period, V."""
        halfway = theta + 0.5 * self._period * omega
        a = -INDUCED_A(omega, halfway, *self._wave) if phase != 1 else 0.0
        b = -INDUCED_B(omega, halfway, *self._wave) if phase != 0 else 0.0
        return (a, b, -a - b)[phase]
