"""Why effects cannot be told apart with the data at hand, and where they would differ.

Two refitted models are compared in what they predict; then the forces that they ask for are
compared along motions that the data do not hold: the same ones slower, faster, the other way
round, with more current, at rest.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.findings import Rivalry
from motor_sysid.diagnosis.result.result import Step
from motor_sysid.diagnosis.search.rung import Rung
from motor_sysid.diagnosis.where.equation_errors import balance, measured_states
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
States = dict[str, Array]
Runs = Sequence[Mapping[str, Array]]

SAMPLES = 1500
"""Samples at which forces are compared."""

SHARED = 0.5
"""Share of what they change in the outputs below which two effects are no rivals."""

FURTHER = 2.0
"""How many times as much as here the forces must differ for a regime to be named."""


@dataclass(frozen=True)
class Compared:
    """Two fits that do as well as each other, and the fit that lacks what they differ in.

    Attributes
    ----------
    base, one, two:
        Predictions of the three, for each record output to (N,) values.
    models:
        The two models.
    """

    base: Runs
    one: Runs
    two: Runs
    models: tuple[Model, Model]


def compared(base: Rung, one: Rung, two: Rung) -> Compared:
    """Return what two fits are compared by, and the fit that lacks what they differ in."""
    without, first, second = (
        (*rung.training.predictions, *rung.validation.predictions) for rung in (base, one, two)
    )
    return Compared(without, first, second, (one.model, two.model))


def alike(found: Compared) -> bool:
    """Whether two fits change much the same in the outputs.

    Two that do as well and do not are no rivals: both of what they stand for may be missing.
    """
    return _overlap(found) > SHARED


def rivalries_of(
    ladder: Sequence[Step],
    rivals: Mapping[str, tuple[str, ...]],
    records: Sequence[Record],
    compared: Mapping[tuple[str, str], Compared] | None = None,
) -> tuple[Rivalry, ...]:
    """Return every pair of an added effect and a rival of it.

    Pairs that were fitted side by side on no rung of the ladder are found in `compared`.
    """
    known = compared or {}
    return tuple(
        _rivalry(key, other, known.get((key, other)) or _side_by_side(key, other, ladder), records)
        for key, names in rivals.items()
        for other in names
    )


def _side_by_side(key: str, rival: str, ladder: Sequence[Step]) -> Compared | None:
    """Return the refits of two effects on the first rung that has both."""
    for step in ladder:
        one = next((c for c in step.candidates if c.effect == key), None)
        two = next((c for c in step.candidates if c.effect == rival), None)
        if one and two and one.predictions and two.predictions and one.model and two.model:
            return Compared(
                step.predictions, one.predictions, two.predictions, (one.model, two.model)
            )
    return None


def _rivalry(
    key: str, rival: str, found: Compared | None, records: Sequence[Record]
) -> Rivalry:
    overlap, regime = float('nan'), ''
    if found is not None:
        overlap, regime = _overlap(found), _regime(*found.models, records)
    titles = effect(key).card.title, effect(rival).card.title
    return Rivalry(key, rival, overlap, regime, _words(titles, overlap, regime))


def _words(titles: tuple[str, str], overlap: float, regime: str) -> str:
    text = f'{titles[0]} cannot be told from {titles[1]} with these data'
    if overlap <= SHARED:
        text += ': what either changes is lost in the noise of the sensors'
    elif np.isfinite(overlap):
        text += f': they share {100 * overlap:.3g} % of what they change in the outputs'
    text += f'. They would differ most {regime}.' if regime else '.'
    return text


def _overlap(found: Compared) -> float:
    """Return how much alike the changes are that two refits make to the base's predictions."""
    apart, whole = 0.0, 0.0
    for name in found.base[0]:
        base, first, second = (
            np.concatenate([run[name] for run in runs])
            for runs in (found.base, found.one, found.two)
        )
        size = max(float(np.mean(base**2)), 1e-300)
        apart += float(np.mean((first - second) ** 2)) / size
        whole += float(np.mean((first - base) ** 2)) / size
    return float(np.clip(1 - apart / max(whole, 1e-300), 0.0, 1.0))


@np.errstate(over='ignore', invalid='ignore', divide='ignore')  # teeth without a gap strike hard
def _regime(one: Model, two: Model, records: Sequence[Record]) -> str:
    """Return the motion along which the two models ask for the most different forces."""
    moments = [_thinned(measured_states(one, r.uniform()), len(records)) for r in records]
    here = _apart(one, two, moments)
    there = {
        words: _apart(one, two, [change(s) for s in moments])
        for words, change in _MOTIONS.items()
    }
    known = {words: apart for words, apart in there.items() if np.isfinite(apart)}
    words, most = max(known.items(), key=lambda item: item[1], default=('', 0.0))
    return words if most > FURTHER * here and most > 0 else ''


def _thinned(states: Mapping[str, Array], records: int) -> States:
    size = next(iter(states.values())).size
    every = max(size * records // SAMPLES, 1)
    return {name: values[::every] for name, values in states.items()}


def _apart(one: Model, two: Model, moments: Sequence[Mapping[str, Array]]) -> float:
    """Return the RMS difference of the forces that two models ask for, in units of their size."""
    square, size = 0.0, 0.0
    for states in moments:
        first, second = balance(one, states), balance(two, states)
        for name in first.keys() & second.keys():
            (a, gain), (b, other) = first[name], second[name]
            square += float(np.nansum((a / gain - b / other) ** 2))
            size += float(np.nansum((a / gain) ** 2 + (b / other) ** 2))
    return float(np.sqrt(square / size)) if size > 0 else 0.0


def _scaled(**factors: float) -> Callable[[States], States]:
    return lambda states: {n: v * factors.get(n, 1.0) for n, v in states.items()}


_MOTIONS: dict[str, Callable[[States], States]] = {
    'in the other direction': _scaled(omega=-1.0, i=-1.0, u=-1.0),
    'at a tenth of the speed': _scaled(omega=0.1),
    'at twice the speed': _scaled(omega=2.0),
    'at twice the current': _scaled(i=2.0, u=1.5),
    'driven one way while turning the other': _scaled(i=-1.0),
    'at rest under load': _scaled(omega=0.0),
}
