"""A PMSM under field-oriented control, which follows a q current."""

from collections.abc import Mapping
import math

from motor_sysid.control.foc import CurrentLoop, FASTEST, Foc
from motor_sysid.nodes.plants.base import Plant, Sample, Setup, Three
from motor_sysid.physics.stepper import Stepper
from motor_sysid.signals.phases import inverse_park, park


class PmsmPlant(Plant):
    """The drive controls both currents at its own rate, in the frame that its encoder tells.

    Published are d and q: the currents as measured at the sample, and the mean of the voltages
    that were commanded until the next.  What the encoder tells of the speed is half a sample old:
    the drive carries it on, or its angle would be late wherever the motor speeds up.
    """

    frame, command = 'dq', 'current'

    def _stepper(self, setup: Setup) -> Stepper:
        self._period, base = setup.control_period, setup.base
        loop = CurrentLoop.of(base, 0.9 * FASTEST / self._period)
        self._drive = Foc(loop, setup.supply, self._period)
        self._pairs, self._offset = base['pole_pairs'], base['angle_offset']
        self._before = 0.0
        return Stepper(setup.model, self._period, max(setup.substeps // setup.periods, 1))

    def reset(self) -> None:
        """Start again at rest at position 0."""
        super().reset()
        self._drive.reset()
        self._before = 0.0

    def sample(self, command: float) -> Sample:
        """Measure, then follow the command in A for as many control periods as a sample has."""
        state, periods = self.stepper.state, self.setup.periods
        speed, position = self.sensors.motion(self.stepper.outputs, state)
        now, self._before = speed + 0.5 * (speed - self._before), speed
        measured, angle = self._measured(), self._electrical(position)
        current = park(*measured, math.cos(angle), math.sin(angle))
        u_d = u_q = 0.0
        for k in range(periods):
            if k:
                state = self.stepper.state
                measured = self._measured()
                angle = self._electrical(self.sensors.counted(state['theta']))
            legs = self._drive.step(measured, angle, self._pairs * now, command)
            self._apply(legs, state)
            u_d += self._drive.voltage_dq[0] / periods
            u_q += self._drive.voltage_dq[1] / periods
        return Sample((*current, 0.0), speed, position, (u_d, u_q, 0.0))

    def _electrical(self, position: float) -> float:
        return self._pairs * position + self._offset

    def _measured(self) -> Three:
        """Return the phase currents as the sensors show them, A."""
        shown = self.stepper.outputs
        angle = self._electrical(shown['position'])
        d, q = shown['current_d'], shown['current_q']
        a, b, _ = inverse_park(d, q, math.cos(angle), math.sin(angle))
        return self.sensors.phases(a, b)

    def _apply(self, legs: Three, state: Mapping[str, float]) -> None:
        """Run the motor for one period under the leg voltages, V, as its rotor sees them."""
        angle = self._electrical(state['theta'] + 0.5 * self._period * state['omega'])
        self.stepper.step(park(*legs, math.cos(angle), math.sin(angle)))
