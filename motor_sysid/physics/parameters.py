"""A parameter of a model: value, unit, box and uncertainty; and an ordered set of them."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
import math

from motor_sysid.errors import UserError


@dataclass(frozen=True)
class Parameter:
    """One number of a model.

    Attributes
    ----------
    name:
        Symbol, as in docs/notation.md; parameters of an effect are ``effect_key.symbol``.
    unit:
        SI unit.
    value:
        Present value.
    lower, upper:
        Box of physically sensible values.
    description:
        One sentence.
    free:
        Whether a fit may change it.
    sigma:
        Standard deviation of the estimate; None as long as it was not estimated, infinite where
        the data hold no information on it.
    """

    name: str
    unit: str
    value: float
    lower: float
    upper: float
    description: str
    free: bool = True
    sigma: float | None = None

    @property
    def logarithmic(self) -> bool:
        """Whether a fit moves in the logarithm of the value: strictly positive boxes do."""
        return self.lower > 0

    @property
    def on_bound(self) -> bool:
        """Whether the value sits on its box, within a millionth of the bound; none is infinite."""
        low, high = self.lower, self.upper
        above = low == -math.inf or self.value > low + 1e-6 * abs(low)
        below = high == math.inf or self.value < high - 1e-6 * abs(high)
        return not (above and below)


@dataclass(frozen=True)
class ParameterSet:
    """An ordered, immutable collection of parameters, addressed by name."""

    items: tuple[Parameter, ...]

    def __iter__(self) -> Iterator[Parameter]:
        """Iterate in order."""
        return iter(self.items)

    def __len__(self) -> int:
        """Return the number of parameters."""
        return len(self.items)

    def __contains__(self, name: object) -> bool:
        """Tell whether there is a parameter of that name."""
        return any(p.name == name for p in self.items)

    def __getitem__(self, name: str) -> Parameter:
        """Return the parameter of that name."""
        for parameter in self.items:
            if parameter.name == name:
                return parameter
        raise UserError(
            f'no parameter `{name}`; there are {", ".join(p.name for p in self.items)}'
        )

    @property
    def free(self) -> tuple[Parameter, ...]:
        """Parameters that a fit may change: free ones whose box holds more than one value."""
        return tuple(p for p in self.items if p.free and p.lower < p.upper)

    def values(self) -> dict[str, float]:
        """Return name to value."""
        return {p.name: p.value for p in self.items}

    def plus(self, more: Iterable[Parameter]) -> 'ParameterSet':
        """Return a set with more parameters at the end."""
        return ParameterSet((*self.items, *more))

    def without(self, names: Iterable[str]) -> 'ParameterSet':
        """Return a set without the named parameters."""
        gone = set(names)
        return ParameterSet(tuple(p for p in self.items if p.name not in gone))

    def with_values(self, values: Mapping[str, float]) -> 'ParameterSet':
        """Return a set with new values; their sigmas are forgotten.

        Raises
        ------
        UserError
            If a name is unknown or a value is not finite or outside its box.
        """
        for name, value in values.items():
            parameter = self[name]
            if not (math.isfinite(value) and parameter.lower <= value <= parameter.upper):
                raise UserError(
                    f'`{name}` = {value:g} {parameter.unit} is outside its range '
                    f'{parameter.lower:g} to {parameter.upper:g}'
                )
        return ParameterSet(
            tuple(
                replace(p, value=float(values[p.name]), sigma=None) if p.name in values else p
                for p in self.items
            )
        )

    def inside(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return those of some values that the set has a parameter for, kept inside its box."""
        mine = {p.name: p for p in self.items if p.name in values}
        return {n: min(max(values[n], p.lower), p.upper) for n, p in mine.items()}

    def with_sigmas(self, sigmas: Mapping[str, float]) -> 'ParameterSet':
        """Return a set with the standard deviations of the named parameters."""
        return ParameterSet(
            tuple(
                replace(p, sigma=float(sigmas[p.name])) if p.name in sigmas else p
                for p in self.items
            )
        )

    def with_free(self, names: Iterable[str], free: bool = True) -> 'ParameterSet':
        """Return a set in which the named parameters are free (or fixed)."""
        chosen = set(names)
        for name in chosen:
            self[name]
        return ParameterSet(
            tuple(replace(p, free=free) if p.name in chosen else p for p in self.items)
        )
