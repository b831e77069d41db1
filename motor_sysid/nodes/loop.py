"""The loop and the life of every node: paced work, clean end, exit code."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
import gc
import signal
import sys
import time
from types import FrameType
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.exceptions import InvalidParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args, try_shutdown

from motor_sysid.errors import UserError

SERVICE_PERIOD = 0.02
"""Time between two looks at services and parameters, in s; each costs about 0.1 ms."""

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class LoopNode(Node, ABC):
    """A node whose work is paced by its own loop; the executor only serves its services.

    A callback of an executor costs 0.1 to 0.5 ms, whatever it does.  Here messages are taken in
    batches by `step`, which the loop calls every `period` seconds of wall time.

    Parameters
    ----------
    name:
        Of the node.
    context:
        Default: the global one.
    overrides:
        Parameters, beside those of the command line.
    """

    period: float = 0.005

    hurry: bool = False
    """Whether work waits, so that the next step is due at once."""

    def __init__(
        self, name: str, context: Context | None = None, overrides: Sequence[Parameter] = ()
    ) -> None:
        super().__init__(
            name, context=context, parameter_overrides=list(overrides),
            automatically_declare_parameters_from_overrides=True,
        )  # fmt: skip

    @property
    def full_name(self) -> str:
        """Its name below its namespace, e.g. ``left/pid``: what its diagnostics are called."""
        return self.get_fully_qualified_name().lstrip('/')

    def declare_parameters(
        self, namespace: str, parameters: Sequence[tuple[Any, ...]], ignore_override: bool = False
    ) -> list[Parameter]:
        """Declare; ``[]`` has no type in ROS and arrives as no value: it is the empty list."""
        given = [(n, [''] if value is None else value, *rest) for n, value, *rest in parameters]
        return super().declare_parameters(namespace, given, ignore_override)

    @abstractmethod
    def step(self) -> None:
        """Do what is due now; must not block."""

    @abstractmethod
    def close(self) -> None:
        """Leave things safe: 0 V, files closed, workers stopped.  Called once, at the end."""


class Loop:
    """Runs one node until told to stop.

    Parameters
    ----------
    node:
        The node; the loop does not close it.
    """

    def __init__(self, node: LoopNode) -> None:
        self._node = node
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._sim_time = bool(node.get_parameter('use_sim_time').value)
        self._next_service = 0.0
        self._next_step = time.monotonic()

    def once(self) -> None:
        """Serve, step, and sleep until the next step is due."""
        now = time.monotonic()
        if self._sim_time or now >= self._next_service:
            self._executor.spin_once(timeout_sec=0)
            self._next_service = now + SERVICE_PERIOD
        self._node.step()
        if self._node.hurry:
            return
        self._next_step = max(self._next_step + self._node.period, time.monotonic())
        time.sleep(max(0.0, self._next_step - time.monotonic()))

    def run(self, done: Callable[[], bool], timeout: float = float('inf')) -> bool:
        """Run until `done` says so (True), the context ends or `timeout` s passed (False)."""
        end = time.monotonic() + timeout
        while self._node.context.ok() and time.monotonic() < end:
            if done():
                return True
            try:
                self.once()
            except ExternalShutdownException:
                break
        return done()

    def shutdown(self) -> None:
        """Let go of the node."""
        self._executor.remove_node(self._node)
        self._executor.shutdown()


class _Stop:
    """Set by the first signal; the others change nothing, so that closing is never cut short.

    rclpy's own handlers would end the context at once, and with it the chance to publish 0 V.  A
    program that ``nohup`` has started outlives its terminal.
    """

    latest: '_Stop | None' = None

    def __init__(self) -> None:
        self.asked = False
        _Stop.latest = self
        for number in SIGNALS:
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, self._ask)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self.asked = True


def wait_for(running: Callable[[], bool]) -> None:
    """Wait for what takes long and leaves nothing to be closed.

    Raises
    ------
    SystemExit
        When a signal asks the program to stop.
    """
    while running():
        if _Stop.latest and _Stop.latest.asked:
            raise SystemExit(0)
        time.sleep(SERVICE_PERIOD)


def main(make: Callable[[], LoopNode], args: Sequence[str] | None = None) -> int:
    """Run a node as a program and return its exit code.

    0 after SIGINT, SIGTERM or SIGHUP, however often they come; 2 where the user's input cannot be
    used, with one line that says why; 1 after an error of the program itself.
    """
    stop = _Stop()
    try:
        _initialise(args)
        node = make()
    except UserError as error:
        get_logger(_program()).fatal(str(error))
        try_shutdown()
        return 2
    loop = Loop(node)
    gc.collect()
    gc.freeze()
    wrong: set[str] = set()
    try:
        _attempt(lambda: loop.run(lambda: stop.asked), node, wrong)
    finally:
        _attempt(node.close, node, wrong)
        loop.shutdown()
        node.destroy_node()
        try_shutdown()
    return 2 if wrong else 0


def _attempt(work: Callable[[], object], node: LoopNode, wrong: set[str]) -> None:
    """Do it; what goes wrong is logged once, however often it is met."""
    try:
        work()
    except UserError as error:
        if str(error) not in wrong:
            node.get_logger().fatal(str(error))
        wrong.add(str(error))


def _program() -> str:
    return sys.argv[0].rsplit('/', 1)[-1].removesuffix('.py')


def _initialise(args: Sequence[str] | None) -> None:
    given = list(sys.argv if args is None else args)
    try:
        left = remove_ros_args(given)[1:]
        rclpy.init(args=given, signal_handler_options=SignalHandlerOptions.NO)
    except (RuntimeError, InvalidParameterException) as error:
        raise UserError(f'these arguments cannot be used: {error}') from None
    if left:
        raise UserError(
            f'unknown argument `{left[0]}`; parameters are given as '
            '`--ros-args -p name:=value` or `--ros-args --params-file FILE`'
        )
