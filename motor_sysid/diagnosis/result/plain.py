"""Plain values for JSON."""

from collections.abc import Iterable
import math
from typing import TypeAlias

import numpy as np

Json: TypeAlias = 'dict[str, Json] | list[Json] | str | float | int | bool | None'


def number(value: float | np.floating) -> float | None:
    """Return a number, None where it is not finite."""
    plain = float(value)
    return plain if math.isfinite(plain) else None


def numbers(values: Iterable[float]) -> list[Json]:
    """Return numbers to six significant digits, None where one is not finite."""
    return [None if number(v) is None else float(f'{float(v):.6g}') for v in values]
