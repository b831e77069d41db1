"""Names in a sentence."""

from collections.abc import Iterable

from motor_sysid.physics.effects import effect


def listed(names: Iterable[str]) -> str:
    """Join as ``a, b and c``."""
    *others, last = [*names] or ['']
    return f'{", ".join(others)} and {last}' if others else last


def titles(keys: Iterable[str]) -> str:
    """Name effects by their titles."""
    return listed(effect(key).card.title for key in keys)
