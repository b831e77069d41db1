"""A brushed DC motor on a voltage."""

from motor_sysid.nodes.plants.base import Plant, Sample, Setup
from motor_sysid.physics.stepper import Stepper


class BrushedDcPlant(Plant):
    """The drive applies the commanded voltage from one sample to the next."""

    frame, command = 'dc', 'voltage'

    def _stepper(self, setup: Setup) -> Stepper:
        return Stepper(setup.model, 1 / setup.rate, setup.substeps)

    def sample(self, command: float) -> Sample:
        """Measure, then apply the command in V."""
        shown = self.stepper.outputs
        current = self.sensors.current(shown['current'])
        speed, position = self.sensors.motion(shown, self.stepper.state)
        self.stepper.step(command)
        return Sample((current, 0.0, 0.0), speed, position, (command, 0.0, 0.0))
