"""What an online estimator is, and the settings that all of them share."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import math
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]


class Estimate(NamedTuple):
    """What is known of a parameter.

    Attributes
    ----------
    value, sigma, unit:
        Estimate and its standard deviation, both in that SI unit.
    identifiable:
        Whether the data so far tell it: False where it is hardly better known than before, or
        where what must be positive may as well be nothing.
    """

    value: float
    sigma: float
    unit: str
    identifiable: bool


@dataclass(frozen=True)
class Tuning:
    """Settings of the online estimators.

    Attributes
    ----------
    memory:
        Regressions and MHE: time in s after which a sample's weight has fallen to 1/e;
        of a sliding window: its length.
    bandwidth:
        Regressions: corner of the state-variable filter in rad/s; None chooses it from the model.
    drift:
        Kalman filters, MHE: how fast parameters may wander, as a fraction of their size per
        square root of 1 s.
    disturbance:
        Kalman filters: unexplained torque (or voltage) per sample of 1 ms, as a fraction of
        the largest.
    noise:
        Sensor noise to start from, output signal to standard deviation; it is adapted.
    horizon:
        MHE: length of the window in s.
    gap:
        Time between two samples, in sample times, from which the motion is taken up anew.
    """

    memory: float = 20.0
    bandwidth: float | None = None
    drift: float = 1e-3
    disturbance: float = 1e-3
    noise: Mapping[str, float] = field(default_factory=dict)
    horizon: float = 1.0
    gap: float = 4.5

    def __post_init__(self) -> None:
        """Refuse what makes no estimator."""
        for name in ('memory', 'horizon', 'gap'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise UserError(f'`{name}` is {value:g}; give a positive number')
        for name in ('drift', 'disturbance'):
            value = getattr(self, name)
            if not 0 <= value <= 1:
                raise UserError(f'`{name}` is {value:g}; give a number from 0 to 1')


class OnlineEstimator(ABC):
    """A recursive estimator of the parameters of a model.

    Parameters
    ----------
    model:
        Where it starts; the free parameters are estimated.
    dt:
        Nominal sample time in s.
    outputs:
        Measured signals, in the order of the columns.
    tuning:
        Settings.

    Attributes
    ----------
    bridges:
        Whether it needs every output at every sample, be it on a line between two that were
        measured; a filter takes such a line for knowledge that it is not.
    """

    bridges: ClassVar[bool] = False

    @abstractmethod
    def __init__(
        self, model: Model, dt: float, outputs: Sequence[str], tuning: Tuning
    ) -> None: ...

    @abstractmethod
    def restart(self, y: Array) -> None:
        """Take up the motion from outputs (n_y,), NaN where missing; keep what is known."""

    @abstractmethod
    def step(self, time: float, h: float, u: Array, y: Array) -> Array:
        """Take the next sample.

        Parameters
        ----------
        time, h:
            Time of the sample before, and time since then, in s.
        u:
            (n_u,) input that was held since the sample before, finite.
        y:
            (n_y,) measured outputs, NaN where missing.

        Returns
        -------
        (n_y,) outputs as predicted before they were looked at.
        """

    @abstractmethod
    def estimate(self) -> dict[str, Estimate]:
        """Return the free parameters by name, in the model's order."""

    @abstractmethod
    def covariance(self) -> Array:
        """Return the (d, d) covariance of the estimator's own coordinates, positive definite."""
