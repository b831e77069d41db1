"""The `motor` node: a simulated motor on a drive, with effects that nobody is told of."""

from collections.abc import Sequence
from dataclasses import dataclass
import math

from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from motor_sysid.nodes.grid import SampleGrid
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.loop import main as run
from motor_sysid.nodes.parameters import parameter, Settings
from motor_sysid.nodes.plant import parse_assignments, scales_of_drive, with_hidden
from motor_sysid.nodes.publishing import joint_publisher, vector_publisher
from motor_sysid.nodes.sensors import DriveSensors, SensorSettings
from motor_sysid.physics.model import Model
from motor_sysid.physics.stepper import Stepper
from motor_sysid.recording.field_reader import FieldReader

BURST = 100
"""Most samples simulated in one step of the loop, so that services are served in between."""


@dataclass(frozen=True)
class MotorSettings:
    """Parameters of the node."""

    rate: float = parameter(500.0, 'Samples per second; every one is published.', 'Hz', 10, 2000)
    R: float = parameter(2.0, 'Armature resistance.', 'ohm', 1e-3, 1e3)
    L: float = parameter(5e-3, 'Armature inductance.', 'H', 1e-6, 10)
    k_t: float = parameter(0.05, 'Torque and back-EMF constant.', 'N m/A', 1e-5, 100)
    J: float = parameter(5e-5, 'Inertia of rotor and load.', 'kg m^2', 1e-9, 100)
    b: float = parameter(2e-5, 'Viscous friction.', 'N m s/rad', 1e-12, 100)
    hidden_effects: tuple[str, ...] = parameter(
        (), 'Effects that the motor has and its model lacks, by key.', live=True
    )
    hidden_parameters: tuple[str, ...] = parameter(
        (), 'Their parameters as effect.parameter=value in SI; others get a plausible size.',
        live=True,
    )  # fmt: skip
    supply_voltage: float = parameter(
        24.0, 'The drive applies at most this, either way.', 'V', 0.1, 1000
    )
    command_timeout: float = parameter(
        0.25, 'The drive applies 0 V if no command came for so long.', 's', 0.01, 10, live=True
    )
    encoder_counts: int = parameter(4096, 'Counts per turn; 0 for an ideal one.', '', 0, 10**8)
    current_noise: float = parameter(
        0.01, 'Standard deviation of the current sensor.', 'A', 0, 100
    )
    current_offset: float = parameter(0.03, 'Offset of the current sensor.', 'A', -100, 100)
    current_range: float = parameter(
        20.0, 'The current converter covers plus and minus this.', 'A', 0.01, 1e4
    )
    current_bits: int = parameter(12, 'Bits of the current converter; 0 for ideal.', '', 0, 24)
    seed: int = parameter(0, 'Seed of the sensor noise.', '', 0, 2**31 - 1)
    substeps: int = parameter(20, 'Integration steps per sample.', '', 1, 1000)
    joint_name: str = parameter('motor', 'Name of the joint in motor/speed.')

    def model(self) -> Model:
        """Return the plant with its hidden effects."""
        values = {name: getattr(self, name) for name in ('R', 'L', 'k_t', 'J', 'b')}
        base = Model.base('brushed_dc', values)
        scales = scales_of_drive(base, self.supply_voltage, 1 / self.rate)
        given = parse_assignments(self.hidden_parameters)
        return with_hidden(base, self.hidden_effects, given, scales)

    def __post_init__(self) -> None:
        """Refuse hidden effects that cannot be added."""
        self.model()


class MotorNode(LoopNode):
    """Simulates the motor in samples of exactly 1/rate, and catches up where it was held up.

    Current, speed and position of a sample are those at its stamp; the voltage is the one applied
    from this stamp to the next.
    """

    def __init__(
        self, context: Context | None = None, overrides: Sequence[Parameter] = ()
    ) -> None:
        super().__init__(
            'motor', context=context, parameter_overrides=list(overrides),
            automatically_declare_parameters_from_overrides=True,
        )  # fmt: skip
        self.settings = Settings(self, MotorSettings)
        s = self.settings.value
        self.period = 1 / s.rate
        self._dt = 1 / s.rate
        self._stepper = Stepper(s.model(), self._dt, s.substeps)
        self._stepper.step(0.0)  # compiles
        self._stepper.reset()
        self._sensors = DriveSensors(
            SensorSettings(
                s.encoder_counts, s.current_noise, s.current_offset, s.current_range,
                s.current_bits, s.seed,
            ),
            self._dt,
        )  # fmt: skip
        self._voltage = vector_publisher(self, 'motor/voltage', 'dc')
        self._current = vector_publisher(self, 'motor/current', 'dc')
        self._speed = joint_publisher(self, 'motor/speed', s.joint_name, ('position', 'velocity'))
        self._commands = RawTopic(
            self, 'motor/voltage_command', 'geometry_msgs/msg/Vector3Stamped', QoSProfile(depth=50)
        )
        self._reader = FieldReader('geometry_msgs/msg/Vector3Stamped', ('vector.x',))
        self._command, self._command_time = 0.0, -math.inf
        self.create_service(Trigger, '~/reset', self._reset)
        self.settings.on_change(self._rebuild)
        self._grid = SampleGrid(self, s.rate)
        self.get_logger().info(f'simulating at {s.rate:g} Hz')

    def step(self) -> None:
        """Simulate every sample that is due by now."""
        now = self._grid.now()
        self._take_commands(now)
        skipped = self._grid.skipped
        for _ in range(min(self._grid.due(now), BURST)):
            self._sample()
        if self._grid.skipped > skipped:
            self.get_logger().warning('held up for more than a second; the stamps have a gap')

    def close(self) -> None:
        """Leave the motor without voltage, and say so in a last sample."""
        self._command = 0.0
        self._sample()

    def _take_commands(self, now: int) -> None:
        messages = self._commands.drain()
        if messages:
            value = float(self._reader.read(messages[-1].data)[0])
            limit = self.settings.value.supply_voltage
            self._command = max(-limit, min(limit, value)) if math.isfinite(value) else 0.0
            self._command_time = now
        elif now - self._command_time > self.settings.value.command_timeout * 1e9:
            self._command = 0.0

    def _sample(self) -> None:
        """Measure and publish at the stamp, then apply the command until the next one."""
        stamp = self._grid.stamp
        outputs = self._stepper.outputs
        current, speed, position = self._sensors.read(outputs['current'], outputs['position'])
        self._current.publish(stamp, current, 0.0, 0.0)
        self._speed.publish(stamp, position, speed)
        self._voltage.publish(stamp, self._command, 0.0, 0.0)
        self._stepper.step(self._command)
        self._grid.advance()

    def _reset_plant(self, **state: float) -> None:
        self._stepper.reset(**state)
        self._sensors.reset(self._stepper.outputs['position'])

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._reset_plant()
        self._command = 0.0
        response.success, response.message = True, 'at rest at position 0'
        return response

    def _rebuild(self, settings: MotorSettings) -> None:
        """Change the hidden effects while the motor turns."""
        state = self._stepper.state
        self._stepper = Stepper(settings.model(), self._dt, settings.substeps)
        self._stepper.reset(**state)
        self.get_logger().info('the motor has changed')


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run(MotorNode, args)


if __name__ == '__main__':
    raise SystemExit(main())
