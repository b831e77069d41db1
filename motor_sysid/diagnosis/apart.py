"""Why effects cannot be told apart with the data at hand, and where they would differ.

Two refitted models are compared in what they predict; then the forces that they ask for are
compared along motions that the data do not hold: the same ones slower, faster, the other way
round, with more current, at rest.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.found import Rivalry
from motor_sysid.diagnosis.residual import balance, measured_states
from motor_sysid.diagnosis.result import Candidate, Step
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]
States = dict[str, Array]

SAMPLES = 1500
"""Samples at which forces are compared."""

FURTHER = 2.0
"""How many times as much as here the forces must differ for a regime to be named."""


def rivalries_of(
    ladder: Sequence[Step], rivals: Mapping[str, tuple[str, ...]], records: Sequence[Record]
) -> tuple[Rivalry, ...]:
    """Return every pair of an added effect and a rival of it."""
    return tuple(
        _rivalry(key, other, ladder, records) for key, names in rivals.items() for other in names
    )


def _rivalry(
    key: str, rival: str, ladder: Sequence[Step], records: Sequence[Record]
) -> Rivalry:
    titles = effect(key).card.title, effect(rival).card.title
    for step in ladder:
        one = next((c for c in step.candidates if c.effect == key), None)
        two = next((c for c in step.candidates if c.effect == rival), None)
        if one is None or two is None or not one.predictions or not two.predictions:
            continue
        overlap = _overlap(step, one, two)
        regime = _regime(one, two, records)
        return Rivalry(key, rival, overlap, regime, _words(titles, overlap, regime))
    return Rivalry(key, rival, float('nan'), '', _words(titles, float('nan'), ''))


def _words(titles: tuple[str, str], overlap: float, regime: str) -> str:
    text = f'{titles[0]} cannot be told from {titles[1]} with these data'
    if np.isfinite(overlap):
        text += f': they share {100 * overlap:.3g} % of what they change in the outputs'
    text += f'. They would differ most {regime}.' if regime else '.'
    return text


def _overlap(step: Step, one: Candidate, two: Candidate) -> float:
    """Return how much alike the changes are that two refits make to the step's predictions."""
    apart, whole = 0.0, 0.0
    for name in step.predictions[0]:
        base, first, second = (
            np.concatenate([run[name] for run in runs])
            for runs in (step.predictions, one.predictions, two.predictions)
        )
        size = max(float(np.mean(base**2)), 1e-300)
        apart += float(np.mean((first - second) ** 2)) / size
        whole += float(np.mean((first - base) ** 2)) / size
    return float(np.clip(1 - apart / max(whole, 1e-300), 0.0, 1.0))


def _regime(one: Candidate, two: Candidate, records: Sequence[Record]) -> str:
    """Return the motion along which the two models ask for the most different forces."""
    if one.model is None or two.model is None:
        return ''
    moments = [_thinned(measured_states(one.model, r.uniform()), len(records)) for r in records]
    here = _apart(one.model, two.model, moments)
    there = {
        words: _apart(one.model, two.model, [change(s) for s in moments])
        for words, change in _MOTIONS.items()
    }
    words, most = max(there.items(), key=lambda item: item[1])
    return words if np.isfinite(most) and most > FURTHER * here and most > 0 else ''


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
