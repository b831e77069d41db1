"""What the target of an export has that the model does not tell: a gear, a supply, a rate."""

from dataclasses import dataclass
import re

from motor_sysid.errors import UserError

LEAST, MOST = 1e-9, 1e9
"""What a gear, a supply, a speed, a rate or a time can be, in SI."""


@dataclass(frozen=True)
class Settings:
    """How to write a model for another tool.

    Attributes
    ----------
    name:
        Of the joint, or prefix of the names in code: letters, digits and `_`.
    gear:
        Turns of the motor in one turn of the joint.
    supply:
        Largest input either way, V for a motor with voltage; None if it is not known.
    top_speed:
        Largest speed of the motor that matters, rad/s (m/s); None if it is not known.
    rate:
        Samples per second of what runs in steps, Hz; None for continuous time where there is
        such a thing.
    closed_loop_time:
        Wanted time constant of the speed loop, s; None for a default.
    body_inertia:
        Inertia about the joint that the target adds by itself, kg m^2 (kg).

    Raises
    ------
    UserError
        If a value makes no sense.
    """

    name: str = 'motor'
    gear: float = 1.0
    supply: float | None = None
    top_speed: float | None = None
    rate: float | None = None
    closed_loop_time: float | None = None
    body_inertia: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        if not re.fullmatch(r'[A-Za-z_]\w*', self.name, flags=re.ASCII):
            raise UserError(
                f'name `{self.name}` is no identifier; take letters, digits and _, such as '
                '`left_wheel`'
            )
        positive = {
            'gear ratio': (self.gear, ''), 'supply': (self.supply, ''),
            'top speed': (self.top_speed, ' rad/s'), 'rate': (self.rate, ' Hz'),
            'closed-loop time constant': (self.closed_loop_time, ' s'),
        }  # fmt: skip
        for what, (value, unit) in positive.items():
            if value is not None and not LEAST <= value <= MOST:
                raise UserError(f'{what} {value:g}{unit} must be from {LEAST:g} to {MOST:g}')
        if not 0 <= self.body_inertia <= MOST:
            raise UserError(
                f'inertia {self.body_inertia:g} kg m^2 of bodies must not be negative, or above '
                f'{MOST:g}'
            )
