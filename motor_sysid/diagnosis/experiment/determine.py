"""Find the experiment that tells most of weak parameters, on top of what the data tell already."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.experiment.information import information, Knowledge, known
from motor_sysid.diagnosis.experiment.library import choices, Tried, tried, variations
from motor_sysid.diagnosis.experiment.stage import Stage
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model

Array = NDArray[np.float64]

WEAK = 0.1
"""Relative standard deviation above which a parameter is called weak."""

NOTHING = 0.5
"""Standard deviation over that of the prior above which a parameter counts as not determined."""

ENOUGH = 10.0
"""Factor of improvement above which a shorter experiment is better."""

WORTHWHILE = 1.5
"""Factor by which the standard deviation must fall for an experiment to be worth its time."""


@dataclass(frozen=True)
class Gain:
    """An experiment and what is known after it.

    Attributes
    ----------
    tried:
        The experiment.
    before, after:
        What is known.
    rows:
        Places of the parameters in question.
    """

    tried: Tried
    before: Knowledge
    after: Knowledge
    rows: tuple[int, ...]

    @property
    def factor(self) -> Array:
        """Factors by which the standard deviations of the parameters in question fall."""
        rows = list(self.rows)
        return np.asarray(self.before.sigma()[rows] / self.after.sigma()[rows])

    @property
    def decides(self) -> bool:
        """Whether every parameter in question is determined after it, and better than before."""
        settled = self.after.share_of_prior()[list(self.rows)] < NOTHING
        return bool(np.all(settled & (self.factor >= WORTHWHILE)))

    def rank(self) -> tuple[float, float, float]:
        """Return what the best has most of: improvement, brevity, and volume of information."""
        useful = float(np.sum(np.log(np.minimum(self.factor, ENOUGH))))
        volume = np.linalg.slogdet(self.after.data + np.diag(self.after.prior))[1]
        return round(useful, 3), -self.tried.profile.duration, float(volume)


def weak_parameters(model: Model, knowledge: Knowledge) -> tuple[str, ...]:
    """Return the parameters that the data tell least of: those over 10 %, or the worst one.

    Asked are positive parameters of the motor and the parameters of effects.
    """
    sigma = knowledge.sigma()
    own = {f'{key}.{p.name}' for key in model.effects for p in effect(key).card.parameters}
    relative = {
        p.name: s / max(abs(p.value), 1e-300)
        for p, s in zip(knowledge.problem.free, sigma.tolist(), strict=True)
        if p.logarithmic or p.name in own
    }
    weak = tuple(name for name, share in relative.items() if share > WEAK)
    return weak or tuple(sorted(relative, key=lambda name: -relative[name])[:1])


def determine(
    stage: Stage,
    names: Sequence[str],
    *,
    quick: bool = False,
    tell: Callable[[str], None] = lambda text: None,
) -> Gain | None:
    """Return the experiment that tells most of the named parameters.

    Returns
    -------
    None where no experiment fits the limits.
    """
    model = stage.models[0]
    before = known(stage, model)
    order = [p.name for p in before.problem.free]
    rows = tuple(order.index(name) for name in names)

    def judged(experiments: Iterator[Tried | None]) -> list[Gain]:
        gains = []
        for one in experiments:
            if one is not None:
                more = information(stage, model, [one.runs[0].record])
                if np.all(np.isfinite(more)):
                    gains.append(Gain(one, before, before.plus(more), rows))
        return sorted(gains, key=Gain.rank, reverse=True)

    everything = list(choices(stage, quick=quick))
    tell(f'trying {len(everything)} experiments')
    gains = judged(tried(stage, choice) for choice in everything)
    if gains and not quick:
        shorter = [v for best in gains[:2] for v in variations(best.tried.choice)]
        tell(f'trying {len(shorter)} shorter or denser forms of the best')
        gains = sorted(
            [*gains, *judged(tried(stage, choice) for choice in shorter)],
            key=Gain.rank, reverse=True,
        )  # fmt: skip
    return gains[0] if gains else None
