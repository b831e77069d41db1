"""The gain in BIC that evidence must have, and where that figure comes from."""

from dataclasses import dataclass

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
    limits:
        95 % confidence limits of the quantile that it comes from, before the floor.
    runs:
        Complete-model runs behind it.
    note:
        What to know of the calibration; empty if nothing.
    """

    delta_bic: float = UNCALIBRATED
    alpha: float | None = None
    limits: tuple[float, float] = (float('nan'), float('nan'))
    runs: int = 0
    note: str = ''

    @property
    def beyond(self) -> float:
        """How far the rate lies beyond what the runs show directly; 1 or less if they show it."""
        return 1.0 / (self.alpha * self.runs) if self.alpha and self.runs else 0.0

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
        if self.beyond > 1.0:
            text += f', extrapolated {self.beyond:.2g} times beyond the runs'
        return f'{text}.{f" {self.note}" if self.note else ""}'
