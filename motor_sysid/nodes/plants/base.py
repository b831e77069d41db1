"""A simulated motor with its drive and sensors, one sample at a time."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from motor_sysid.nodes.sensors import DriveSensors, SensorSettings
from motor_sysid.physics.model import Model
from motor_sysid.physics.stepper import Stepper

Three = tuple[float, float, float]


@dataclass(frozen=True)
class Setup:
    """What is simulated.

    Attributes
    ----------
    base, model:
        The motor as its drive knows it, and as it is.
    sensors:
        What is measured.
    rate, periods:
        Samples per second, and control periods of the drive in a sample.
    substeps:
        Integration steps per sample.
    supply, current_limit:
        Largest voltage, V, and largest current that a drive follows, A.
    """

    base: Model
    model: Model
    sensors: SensorSettings
    rate: float
    periods: int = 1
    substeps: int = 20
    supply: float = 24.0
    current_limit: float = 5.0

    @property
    def control_period(self) -> float:
        """Length of a control period, s."""
        return 1 / (self.rate * self.periods)


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

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.sensors = DriveSensors(setup.sensors, 1 / setup.rate)
        self.stepper = self._stepper(setup)
        self.sample(0.0)  # compiles
        self.reset()

    @abstractmethod
    def _stepper(self, setup: Setup) -> Stepper:
        """Return the motor in steps of the drive."""

    @abstractmethod
    def sample(self, command: float) -> Sample:
        """Measure, then run the motor under the command (V or A) until the next sample."""

    def reset(self) -> None:
        """Start again at rest at position 0."""
        self.stepper.reset()
        self.sensors.reset(0.0)

    def change(self, setup: Setup) -> None:
        """Take other hidden effects; the motor goes on turning."""
        state = self.stepper.state
        self.setup, self.stepper = setup, self._stepper(setup)
        self.stepper.reset(**state)
