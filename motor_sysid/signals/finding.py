"""What was found wrong, doubtful or worth knowing about data, said with its remedy."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
import math


class Severity(StrEnum):
    """How much a finding matters."""

    INFO = 'info'
    """Worth knowing; nothing is wrong."""
    WARNING = 'warning'
    """Results may mislead, in the way that the consequence says."""
    ERROR = 'error'
    """Nothing can be concluded from this data until it is mended."""


@dataclass(frozen=True)
class Finding:
    """One thing found in data.

    Attributes
    ----------
    severity:
        ``info``, ``warning`` or ``error``.
    code:
        Public, stable name such as ``speed_unit``.
    message:
        What was found, with value and unit.
    consequence:
        What happens if nothing is done.
    remedy:
        What to do.
    numbers:
        The figures behind it; names carry the unit (``dt_s``).
    """

    severity: Severity
    code: str
    message: str
    consequence: str = ''
    remedy: str = ''
    numbers: Mapping[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, object]:
        """Return the finding as plain types, as written to JSON."""
        return {
            'severity': self.severity.value,
            'code': self.code,
            'message': self.message,
            'consequence': self.consequence,
            'remedy': self.remedy,
            'numbers': {n: float(x) for n, x in self.numbers.items() if math.isfinite(x)},
        }


def worst(findings: Iterable[Finding]) -> Severity:
    """Return the most severe of the findings (info if there are none)."""
    order = list(Severity)
    return max((finding.severity for finding in findings), key=order.index, default=Severity.INFO)
