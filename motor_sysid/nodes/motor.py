"""The `motor` node: a simulated motor on a drive, with effects that nobody is told of."""

from collections.abc import Sequence
import math
import time

from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from motor_sysid.nodes.grid import SampleGrid
from motor_sysid.nodes.intake import RawTopic
from motor_sysid.nodes.loop import LoopNode
from motor_sysid.nodes.loop import main as run
from motor_sysid.nodes.motor_settings import MotorSettings
from motor_sysid.nodes.parameters import Settings
from motor_sysid.nodes.plants import make_plant
from motor_sysid.nodes.publishing import joint_publisher, vector_publisher
from motor_sysid.recording.field_reader import FieldReader

BURST = 100
"""Most samples simulated in one step of the loop, so that services are served in between."""
LOOK = 1.0
"""Time between two looks at who sends commands, s."""


class MotorNode(LoopNode):
    """Simulates the motor in samples of exactly 1/rate, and catches up where it was held up.

    Current, speed and position of a sample are those at its stamp; the voltage is the one applied
    from this stamp to the next.
    """

    def __init__(
        self, context: Context | None = None, overrides: Sequence[Parameter] = ()
    ) -> None:
        super().__init__('motor', context, overrides)
        self.settings = Settings(self, MotorSettings)
        s = self.settings.value
        self.period = 1 / s.rate
        self._plant = make_plant(s.setup())
        frame, told = self._plant.frame, f'motor/{self._plant.command}_command'
        self._voltage = vector_publisher(self, 'motor/voltage', frame)
        self._current = vector_publisher(self, 'motor/current', frame)
        self._speed = joint_publisher(self, 'motor/speed', s.joint_name, ('position', 'velocity'))
        self._commands = RawTopic(
            self, told, 'geometry_msgs/msg/Vector3Stamped', QoSProfile(depth=50)
        )
        self._reader = FieldReader('geometry_msgs/msg/Vector3Stamped', ('vector.x',))
        self._command, self._command_time = 0.0, -math.inf
        self._next_look = 0.0
        self.create_service(Trigger, '~/reset', self._reset)
        self.settings.on_change(self._rebuild)
        self._grid = SampleGrid(self, s.rate)
        self.get_logger().info(f'simulating {s.motor_kind} at {s.rate:g} Hz')

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
        if time.monotonic() >= self._next_look:
            self._next_look = time.monotonic() + LOOK
            self._commands.adapt()
        messages = self._commands.drain()
        if messages:
            value = float(self._reader.read(messages[-1].data)[0])
            limit = self.settings.value.limit
            self._command = max(-limit, min(limit, value)) if math.isfinite(value) else 0.0
            self._command_time = now
        elif not 0 <= now - self._command_time <= self.settings.value.command_timeout * 1e9:
            self._command = 0.0

    def _sample(self) -> None:
        """Measure at the stamp, apply the command until the next one, and publish both."""
        stamp = self._grid.stamp
        sample = self._plant.sample(self._command)
        self._current.publish(stamp, *sample.current)
        self._speed.publish(stamp, sample.position, sample.speed)
        self._voltage.publish(stamp, *sample.voltage)
        self._grid.advance()

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._plant.reset()
        self._command = 0.0
        response.success, response.message = True, 'at rest at position 0'
        return response

    def _rebuild(self, settings: MotorSettings) -> None:
        """Change the hidden effects while the motor turns."""
        self._plant.change(settings.setup())
        self.get_logger().info('the motor has changed')


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run(MotorNode, args)


if __name__ == '__main__':
    raise SystemExit(main())
