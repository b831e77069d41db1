"""What the user of a diagnosis may choose."""

from dataclasses import dataclass

from motor_sysid.diagnosis.calibration.calibration import Calibration


@dataclass(frozen=True)
class Settings:
    """What the user may choose.

    Attributes
    ----------
    max_effects:
        Most effects to add.
    refits:
        Candidates that are refitted in each round, best score first.
    validation_fraction:
        Part of each record that is held back where no validation records are given.
    alpha:
        False-alarm rate that evidence is held to, where a calibration tells what that means.
    calibrations:
        Calibrations to choose from; see `motor_sysid.diagnosis.calibration`.
    """

    max_effects: int = 4
    refits: int = 6
    validation_fraction: float = 0.2
    alpha: float = 0.01
    calibrations: tuple[Calibration, ...] = ()
