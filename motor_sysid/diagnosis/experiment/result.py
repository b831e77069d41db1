"""What `suggest` says: the next experiment, what it will decide, and how sure that is."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from motor_sysid.control.pid import PidGains
from motor_sysid.control.profile import Profile, SPEED
from motor_sysid.control.profile_file import part_entries
from motor_sysid.diagnosis.experiment.limits import Limits

Json: TypeAlias = 'dict[str, Json] | list[Json] | str | float | int | bool | None'


@dataclass(frozen=True)
class Separation:
    """Two rivals and the evidence that the experiment is expected to bring between them.

    Attributes
    ----------
    rivals:
        Their names.
    delta_bic:
        Expected evidence if the fitted values are true, whichever of the two is.
    worst_delta_bic:
        The same where what the recorded data leave open turns out least favourably; None where
        that was not looked at.
    """

    rivals: tuple[str, str]
    delta_bic: float
    worst_delta_bic: float | None = None


@dataclass(frozen=True)
class Sharpening:
    """A parameter and its standard deviation before and after, both in its unit."""

    name: str
    unit: str
    value: float
    sigma_before: float
    sigma_after: float


@dataclass(frozen=True)
class Experiment:
    """The next experiment.

    Attributes
    ----------
    decides:
        Whether it is expected to decide what is open; False where no admissible experiment does.
    purpose:
        What it is for: ``to tell A from B``, ``to tell A, B and C apart`` or ``to determine X``.
    summary:
        One sentence: what it decides and after how long, or why nothing would.
    reasons:
        More in plain words.
    profile:
        What to run; None where nothing helps.
    title:
        What is done, in plain words.
    separations, sharpenings:
        What it is expected to bring.
    peaks:
        Largest input, speed, current and travel that the models predict.
    limits:
        What it keeps to.
    controller:
        Gains of the speed controller that it was planned with, for a speed reference.
    """

    decides: bool
    purpose: str
    summary: str
    reasons: tuple[str, ...]
    limits: Limits
    profile: Profile | None = None
    title: str = ''
    separations: tuple[Separation, ...] = ()
    sharpenings: tuple[Sharpening, ...] = ()
    peaks: Mapping[str, float] | None = None
    controller: PidGains | None = None

    @property
    def follower(self) -> PidGains | None:
        """The speed controller that the profile was planned with; None where it needs none."""
        asked = self.profile is not None and self.profile.signal == SPEED
        return self.controller if asked else None

    def brief(self) -> dict[str, str]:
        """Return what to do and what for, as two texts: ``profile`` and ``purpose``."""
        return {'profile': self.described() or self.summary, 'purpose': self.purpose}

    def described(self) -> str:
        """Return what is done in plain words, with level and duration; empty without a profile."""
        if self.profile is None:
            return ''
        p = self.profile
        what = 'speed' if p.signal == SPEED else p.signal
        return f'{self.title}, {what} up to {p.level:.3g} {p.unit}, {p.duration:.3g} s'

    def to_dict(self) -> dict[str, Json]:
        """Return plain values: the entry ``experiment`` of a diagnosis."""
        document: dict[str, Json] = {**self.brief()}
        document |= {
            'decides': self.decides,
            'summary': self.summary,
            'reasons': list(self.reasons),
            'expected': [
                {'rivals': list(s.rivals), 'delta_bic': s.delta_bic,
                 'worst_delta_bic': s.worst_delta_bic}
                for s in self.separations
            ],
            'parameters': {
                s.name: {'value': s.value, 'unit': s.unit, 'sigma_before': s.sigma_before,
                         'sigma_after': s.sigma_after}
                for s in self.sharpenings
            },
        }  # fmt: skip
        if self.profile is not None:
            document |= {
                'signal': self.profile.signal,
                'unit': self.profile.unit,
                'level': self.profile.level,
                'duration_s': self.profile.duration,
                'peaks': dict(self.peaks or {}),
                'parts': [dict(entry) for entry in part_entries(self.profile)],
            }
        if self.follower is not None:
            document['controller'] = {'kp': self.follower.kp, 'ki': self.follower.ki}
        return document
