"""What the demo does with its bag: diagnose, print the falling error, write the results."""

from dataclasses import dataclass
from pathlib import Path

from motor_sysid.physics.model import Model


@dataclass(frozen=True)
class Demo:
    """A recorded demo.

    Attributes
    ----------
    bag, out:
        The bag, and the folder for results.
    nominal:
        Model from the datasheet.
    begin:
        `time.monotonic()` at the start.
    json:
        Where to write the result too, or None.
    """

    bag: Path
    out: Path
    nominal: Model
    begin: float
    json: Path | None


def finish(demo: Demo) -> int:
    """Diagnose the bag and say where the results lie; returns the exit code."""
    return 0
