"""Sets of effects that no record can tell apart, because they are the same equations.

Who names one side of a row where the other is hidden has named the truth.  A row holds exactly,
for every input and any length of data: what is merely alike in some record (viscous friction and
drag at one speed, say) has no place here, nor has what an effect generalises.  A test simulates
both sides of every row and compares them.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from motor_sysid.physics.effects import catalogue


@dataclass(frozen=True)
class Equivalence:
    """Two sets of effects with the same records.

    Attributes
    ----------
    one, other:
        Keys of effects; an empty set is the complete model with other base parameters.
    reason:
        Why they cannot be told apart.
    """

    one: frozenset[str]
    other: frozenset[str]
    reason: str


EQUIVALENCES = (
    Equivalence(
        frozenset({'coulomb_friction', 'constant_load_torque'}),
        frozenset({'asymmetric_coulomb_friction'}),
        'tau_c sign(omega) + tau_l takes tau_c + tau_l forward and tau_c - tau_l back, moving or '
        'held, as long as tau_l does not exceed tau_c',
    ),
    Equivalence(
        frozenset({'current_sensor_scale'}),
        frozenset(),
        'for a shown current (1 + g) i, R/(1 + g), L/(1 + g), J (1 + g), b (1 + g) and the same '
        'torque constant give the same records; every other torque is larger by 1 + g, too',
    ),
    Equivalence(
        frozenset({'speed_sensor_scale'}),
        frozenset(),
        'for a shown speed (1 + g) omega, k/(1 + g), J/(1 + g)^2, b/(1 + g)^2 and the same '
        'resistance and inductance give the same records; every other torque is smaller by 1 + g',
    ),
    Equivalence(
        frozenset({'current_sensor_offset'}),
        frozenset(),
        'an unknown offset of the current sensor is part of every base model',
    ),
    Equivalence(
        frozenset({'speed_sensor_offset'}),
        frozenset({'constant_load_torque'}),
        'speed shown o too high is a load torque -(b + k^2/R) o with a current offset k o/R more '
        '(where nothing else depends on speed or position)',
    ),
)  # fmt: skip
"""Every row known."""


def invisible(key: str) -> bool:
    """Whether an effect alone is the same as none."""
    return any(e.one == {key} and not e.other for e in EQUIVALENCES)


def same_as(effects: frozenset[str]) -> set[frozenset[str]]:
    """Return every set of effects with the records of the given one, itself included."""
    found = {effects}
    fresh = [effects]
    while fresh:
        for more in _swapped(fresh.pop()):
            if more not in found:
                found.add(more)
                fresh.append(more)
    return found


def special_cases(effects: frozenset[str]) -> frozenset[str]:
    """Return the simpler laws that are part of the given ones: half the truth, but no error."""
    cards = [catalogue()[key].card for key in effects if key in catalogue()]
    return frozenset(key for card in cards for key in card.generalises)


def _swapped(effects: frozenset[str]) -> Iterator[frozenset[str]]:
    for row in EQUIVALENCES:
        for one, other in ((row.one, row.other), (row.other, row.one)):
            if one and one <= effects:
                yield (effects - one) | other
