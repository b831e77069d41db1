"""The gain in BIC that evidence must have, and where that figure comes from."""

from dataclasses import dataclass
import math

UNCALIBRATED = 20.0
"""Where nothing was calibrated; docs/benchmark.md measures what it lets pass."""

FLOOR = 10.0
"""Least gain in BIC that any calibration may ask for: odds of 150 to 1 (Kass and Raftery 1995,
doi:10.1080/01621459.1995.10476572, call that very strong evidence)."""


@dataclass(frozen=True)
class Threshold:
    """What a diagnosis asks of evidence.

    Attributes
    ----------
    delta_bic:
        The gain in BIC.
    alpha:
        The false-alarm rate that it stands for, or None where nothing was calibrated.
    runs:
        Complete-model runs behind it.
    limits:
        95 % confidence limits of the gain in BIC that noise alone exceeds at that rate.
    rate:
        95 % confidence limits of the share of complete models in which something passes all gates
        at this threshold.
    extrapolated:
        How far the rate lies beyond what the runs show directly; 0 if they show it.
    note:
        What to know of the calibration; empty if nothing.
    """

    delta_bic: float = UNCALIBRATED
    alpha: float | None = None
    runs: int = 0
    limits: tuple[float, float] = (math.nan, math.nan)
    rate: tuple[float, float] = (math.nan, math.nan)
    extrapolated: float = 0.0
    note: str = ''

    @property
    def words(self) -> str:
        """Where the figure comes from, in words."""
        if self.alpha is None:
            return (
                f'Evidence counts from dBIC {self.delta_bic:.3g}; that is not calibrated for this '
                'motor and excitation: run `motor-sysid calibrate` on these data.'
            )
        text = (
            f'Evidence counts from dBIC {self.delta_bic:.3g}, from a calibration of this motor '
            f'({self.runs} complete-model runs, false-alarm rate {100 * self.alpha:g} %)'
        )
        if self.extrapolated:
            text += f', extrapolated {self.extrapolated:.2g} times beyond what the runs show'
        return f'{text}.{f" {self.note}" if self.note else ""}'
