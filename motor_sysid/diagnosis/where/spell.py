"""A short spell that makes nearly all of an error: a bus that was silent, a shaft that was held.

No law of the motion tells it, but the time does: somebody may know what happened then.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.diagnosis.where.uneven_records import by_chain
from motor_sysid.estimation.batch import Chain

Array = NDArray[np.float64]

SHORT = 0.05
"""Longest spell, as a share of its record."""

MOST = 0.8
"""Least share of a record's squared error beyond noise that a spell makes."""

EDGES = (0.02, 0.98)
"""Shares of the squared error in the window at which the spell begins and ends."""

_FEWEST = 400


@dataclass(frozen=True)
class Spell:
    """Where in a record nearly all of its error lies.

    Attributes
    ----------
    source:
        Of which record.
    begins, ends:
        When, in s of its time.
    share:
        Share of the record's squared error beyond noise.
    """

    source: str
    begins: float
    ends: float
    share: float

    def __str__(self) -> str:
        return (
            f'{100 * self.share:.0f} % of the squared error in {self.source} lies between '
            f'{self.begins:.4g} and {self.ends:.4g} s. To do: find out what happened then (a '
            'silent bus, a shaft that was held), or cut it out'
        )


def spell_of(
    sides: Sequence[tuple[Comparison, Sequence[Chain]]], least: Array
) -> Spell | None:
    """Return the spell of the record that is described worst, if one makes most of its error.

    Parameters
    ----------
    sides:
        Comparisons with the chains that they are over.
    least:
        (n_y,) error up to which an output counts as noise, in the unit of the signal.
    """
    squares = [one for side in sides for one in _squares(*side, least) if len(one[1]) >= _FEWEST]
    if not squares:
        return None
    chain, square = max(squares, key=lambda one: float(np.mean(one[1])))
    sums = np.concatenate(([0.0], np.cumsum(square)))
    width, beyond = int(SHORT * len(square)), sums[-1] - len(square)
    inside = sums[width:] - sums[:-width] - width
    first = int(np.argmax(inside))
    if beyond <= len(square) or inside[first] < MOST * beyond:
        return None
    part = np.cumsum(square[first : first + width])
    begins, ends = first + np.searchsorted(part, np.array(EDGES) * part[-1])
    time = np.concatenate([s.record.time[s.scored_from :] for s in chain if s.scored])
    source = next(s.record.provenance.source for s in chain if s.scored) or 'a record'
    share = min(float(inside[first] / beyond), 1.0)
    return Spell(source, float(time[begins]), float(time[ends]), share)


def _squares(
    comparison: Comparison, chains: Sequence[Chain], least: Array
) -> Iterator[tuple[Chain, Array]]:
    """Yield each chain that is scored with the (N,) squares of its errors, of noise 1 at most."""
    scored = [chain for chain in chains if any(stretch.scored for stretch in chain)]
    for chain, residual in zip(scored, by_chain(comparison.residuals, chains), strict=True):
        scaled = residual / np.maximum(least, 1e-300)
        yield chain, np.mean(scaled**2, axis=1)
