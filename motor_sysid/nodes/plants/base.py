"""A simulated motor with its drive and sensors, one sample at a time."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from motor_sysid.nodes.motor_settings import MotorSettings
from motor_sysid.nodes.sensors import DriveSensors
from motor_sysid.physics.stepper import Stepper

Three = tuple[float, float, float]


@dataclass(frozen=True)
class Sample:
    """What is published of one sample.

    Attributes
    ----------
    current:
        x, y, z in A, at the sample.
    speed, position:
        rad/s and rad, at the sample.
    voltage:
        x, y, z in V, mean from this sample to the next.
    """

    current: Three
    speed: float
    position: float
    voltage: Three


class Plant(ABC):
    """A motor, its drive and its sensors.

    Attributes
    ----------
    frame:
        ``frame_id`` of currents and voltages.
    command:
        What it is told: ``voltage`` or ``current``.
    """

    frame: ClassVar[str]
    command: ClassVar[str]

    def __init__(self, settings: MotorSettings) -> None:
        self.settings = settings
        self.sensors = DriveSensors(settings.sensors(), 1 / settings.rate)
        self.stepper = self._stepper(settings)
        self.sample(0.0)  # compiles
        self.reset()

    @abstractmethod
    def _stepper(self, settings: MotorSettings) -> Stepper:
        """Return the motor in steps of the drive."""

    @abstractmethod
    def sample(self, command: float) -> Sample:
        """Measure, then run the motor under the command (V or A) until the next sample."""

    def reset(self) -> None:
        """Start again at rest at position 0."""
        self.stepper.reset()
        self.sensors.reset(0.0)

    def change(self, settings: MotorSettings) -> None:
        """Take other hidden effects; the motor goes on turning."""
        state = self.stepper.state
        self.settings, self.stepper = settings, self._stepper(settings)
        self.stepper.reset(**state)
