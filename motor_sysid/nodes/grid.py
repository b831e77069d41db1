"""Stamps on an exact grid, paced by the clock: which samples are due by now."""

import time

from rclpy.node import Node

from motor_sysid.nodes.publishing import now_ns, SECOND


class SampleGrid:
    """Sample k bears the stamp t_0 + k / rate and is due when the clock reaches it.

    A late loop finds several samples due and catches up; after more than a second (a suspended
    machine) it leaves a gap instead.  Real time is counted by the steady clock, because the
    system's clock may be set back or forth; simulated time by /clock, and the grid starts anew
    where that jumps back.

    Parameters
    ----------
    node:
        Gives the clock.
    rate:
        Samples per second.

    Attributes
    ----------
    skipped:
        Samples left out after long stalls.
    restarts:
        How often time fell back by more than a second.
    """

    def __init__(self, node: Node, rate: float) -> None:
        self._clock, self._rate = node.get_clock(), rate
        self._origin = 0
        self._count = 0
        self.skipped = self.restarts = 0
        simulated = bool(node.get_parameter('use_sim_time').value)
        self._offset = 0 if simulated else now_ns(self._clock) - time.monotonic_ns()

    def now(self) -> int:
        """Return the time in ns; 0 as long as simulated time has not begun."""
        return time.monotonic_ns() + self._offset if self._offset else now_ns(self._clock)

    def due(self, now: int) -> int:
        """Return how many samples are due."""
        if now <= 0:
            return 0
        back = self._origin != 0 and now < self.stamp - SECOND
        if self._origin == 0 or back:
            self._origin, self._count = now, 0
            self.restarts += back
        count = int((now - self._origin) * self._rate // SECOND) + 1 - self._count
        if count > self._rate:
            self.skipped += count - 1
            self._count += count - 1
            return 1
        return max(count, 0)

    @property
    def stamp(self) -> int:
        """Stamp of the next sample, ns."""
        return self._origin + round(self._count * SECOND / self._rate)

    def advance(self) -> None:
        """Go on to the next sample."""
        self._count += 1
