"""A model for other tools: one file per format, each of which says what it leaves out.

`settings` has what the model does not tell (gear, supply, rate).  Formats build on `linear`, the
state space of the linear part, or on `rigid`, one inertia with dry and viscous friction and what
drives it; `loads` has those behind a shaft or a play, `joint` is all that behind the gear, `words`
what all of them write.  To add a format: write its file, with `TITLE`, `SUFFIX`,
`USES` (the settings that it looks at) and `write(model, settings)`, and add its name to `FORMATS`.
"""

from dataclasses import dataclass
from importlib import import_module

from motor_sysid.errors import UserError
from motor_sysid.export.settings import Settings
from motor_sysid.physics.model import Model
from motor_sysid.signals.units import did_you_mean

__all__ = ['FORMATS', 'Exported', 'Settings', 'export', 'title_of', 'uses_of']

FORMATS = (
    'feedforward', 'pid', 'mujoco', 'urdf', 'state_space', 'matlab', 'c_header',
)  # fmt: skip
"""Every format; each is a module of this package."""


@dataclass(frozen=True)
class Exported:
    """A model in another format.

    Attributes
    ----------
    text:
        What the file holds.
    suffix:
        Usual ending of the file's name.
    left_out:
        What of the model is not in it, in words.
    """

    text: str
    suffix: str
    left_out: tuple[str, ...]


def export(model: Model, to: str, settings: Settings | None = None) -> Exported:
    """Return a model in the format of another tool.

    Parameters
    ----------
    to:
        One of `FORMATS`.

    Raises
    ------
    UserError
        If there is no such format, the model does not have what it asks for, or a setting that it
        needs is missing.
    """
    if to not in FORMATS:
        raise UserError(
            f'unknown format `{to}`{did_you_mean(to, FORMATS)}; known are '
            f'{", ".join(FORMATS)}'
        )
    module = import_module(f'{__name__}.{to}')
    text, left_out = module.write(model, settings or Settings())
    return Exported(text, module.SUFFIX, left_out)


def title_of(name: str) -> str:
    """Return what a format is, in words."""
    title: str = import_module(f'{__name__}.{name}').TITLE
    return title


def uses_of(name: str) -> tuple[str, ...]:
    """Return the settings that a format looks at."""
    uses: tuple[str, ...] = import_module(f'{__name__}.{name}').USES
    return uses
