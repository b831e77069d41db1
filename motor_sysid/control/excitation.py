"""The library of experiments: families of profiles, each good at showing something else.

To add one: write its parts (levels between -1 and 1, shares of the time) and its entry in
`FAMILIES`.  `motor-sysid suggest` tries every family at several levels and durations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from motor_sysid.control.profile import (
    Hold,
    holds,
    Part,
    Profile,
    Ramp,
    REST,
    STEPS,
    Sweep,
    Triangle,
)


@dataclass(frozen=True)
class Family:
    """A family of profiles.

    Attributes
    ----------
    key:
        Short name.
    title:
        What is done, in plain words.
    parts:
        Its parts without the rests at both ends.
    as_speed, as_input:
        Whether it makes sense as a speed reference, and as the input itself.
    quick:
        Whether it belongs to the small library for answers within a second.
    """

    key: str
    title: str
    parts: tuple[Part, ...]
    as_speed: bool = True
    as_input: bool = True
    quick: bool = False

    def profile(
        self, signal: str, unit: str, level: float, duration: float, repeats: int = 1
    ) -> Profile:
        """Return the profile of that level and duration, its parts repeated; rests at both ends.

        Each rest takes a twentieth of the time, but half a second at most.
        """
        whole = sum(part.share for part in self.parts) * repeats
        pause = min(0.05 * duration, REST.share)
        rest = replace(REST, share=whole * pause / (duration - 2 * pause))
        parts = (rest, *(self.parts * repeats), rest)
        return Profile(self.key, level, duration, parts, signal, unit)

    @property
    def reverses(self) -> bool:
        """Whether it turns the motor both ways."""
        values = np.concatenate([part.shape(np.linspace(0, 1, 17)) for part in self.parts])
        return bool(np.min(values) < 0 < np.max(values))


def mirrored(parts: Sequence[Part], levels: Sequence[float]) -> tuple[Part, ...]:
    """Return the parts at each of the levels in turn."""
    return tuple(Part(p.share, _scaled(p, level)) for level in levels for p in parts)


def _scaled(part: Part, level: float) -> Hold | Ramp | Triangle | Sweep:
    shape = part.shape
    if isinstance(shape, Ramp):
        return Ramp(level * shape.start, level * shape.stop)
    return replace(shape, level=level * shape.level)


_BITS = (1, -1, 1, 1, -1, -1, 1, -1, -1, -1, 1, 1, 1, -1, 1, 1, -1, 1, -1, -1, 1, 1, -1, -1, -1)
_HUMP = (Part(1.0, Ramp(0.0, 1.0)), Part(1.0, Ramp(1.0, 0.0)))
_STAIRS = (0.1, 0.25, 0.5, 0.75, 1.0, 0.6, 0.3)

FAMILIES: dict[str, Family] = {
    family.key: family
    for family in (
        Family(
            'reversals', 'constant levels in both directions, turned round again and again',
            holds(1.0, (1.0, -1.0, 0.5, -0.5, 0.25, -0.25)), quick=True,
        ),
        Family('steps', 'steps of many heights in both directions', STEPS, quick=True),
        Family('stairs', 'stairs up and down, first forward, then back',
               (*holds(1.0, _STAIRS), *holds(1.0, [-v for v in _STAIRS]))),
        Family('forward_stairs', 'stairs up and down in one direction', holds(1.0, _STAIRS)),
        Family(
            'slow_sweep', 'slow sweep through standstill to full level in both directions',
            (Part(1.0, Triangle(1.0)),), quick=True,
        ),
        Family('forward_sweep', 'slow sweep up and down in one direction', _HUMP),
        Family(
            'slow_turns', 'slow turns at constant speed in both directions',
            holds(1.0, (0.04, -0.04, 0.1, -0.1, 0.2, -0.2)), as_input=False, quick=True,
        ),
        Family('crawl', 'slow sweeps through standstill',
               (*holds(0.5, (0.05, -0.05)), Part(2.0, Triangle(0.15)), Part(1.0, Triangle(0.06))),
               as_input=False),
        Family('chirp', 'sine of rising frequency', (Part(1.0, Sweep(1.0, 1.0, 40.0)),)),
        Family(
            'switching', 'quick switching between two levels, irregular',
            holds(1.0, _BITS), quick=True,
        ),
        Family(
            'breakaway', 'standstill tests: slow rise until it breaks away, in both directions',
            mirrored((Part(2.0, Ramp(0.0, 1.0)), Part(0.5, Hold(0.0))), (0.3, -0.3, 0.15, -0.15)),
            as_speed=False,
        ),
        Family('coasting', 'run-ups to full level, each followed by coasting',
               mirrored((Part(1.0, Hold(1.0)), Part(1.5, Hold(0.0))), (1.0, -1.0, 0.5, -0.5)),
               as_speed=False),
        Family('load_cycles', 'hard acceleration for half the time, then rest',
               (*holds(0.25, (1.0, -1.0) * 8), Part(4.0, Hold(0.1)))),
    )
}  # fmt: skip
"""Every family by key."""


def speed_families(quick: bool = False) -> tuple[Family, ...]:
    """Return the families that a speed controller can follow."""
    return tuple(f for f in FAMILIES.values() if f.as_speed and (f.quick or not quick))


def input_families(quick: bool = False) -> tuple[Family, ...]:
    """Return the families that drive the motor itself."""
    return tuple(f for f in FAMILIES.values() if f.as_input and (f.quick or not quick))
