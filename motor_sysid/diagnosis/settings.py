"""What the user of a diagnosis may choose."""

from dataclasses import dataclass

from motor_sysid.diagnosis.calibration.calibration import Calibration
from motor_sysid.effort import Effort
from motor_sysid.errors import UserError

EFFORT, EFFORT_A_SAMPLE = 1.2e9, 2e4
"""Steps of the integration, summed over all parameter vectors, after which a search comes to an
end; and how many more for each sample that is fitted.  Two cores of 2.5 GHz take 15 to 50 million
a second."""


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
    effort:
        How long to search where nothing explains the data, in units of the usual effort.

    Raises
    ------
    UserError
        If one of them is out of its range.
    """

    max_effects: int = 4
    refits: int = 6
    validation_fraction: float = 0.2
    alpha: float = 0.01
    calibrations: tuple[Calibration, ...] = ()
    effort: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        for name, least in (('max_effects', 0), ('refits', 1)):
            if getattr(self, name) < least:
                raise UserError(f'{name} {getattr(self, name)} is less than {least}')
        for name in ('validation_fraction', 'alpha'):
            if not 0.0 < getattr(self, name) < 1.0:
                raise UserError(f'{name} {getattr(self, name):g} is not between 0 and 1')
        if not self.effort > 0.0:
            raise UserError(f'effort {self.effort:g} is not above 0; 1 is usual')

    def effort_for(self, samples: int) -> Effort:
        """Return the effort that a search in so many samples may take."""
        return Effort(self.effort * (EFFORT + EFFORT_A_SAMPLE * samples))
