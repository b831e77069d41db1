"""Paths to a value in a message: ``vector.x``, ``velocity[0]``, ``velocity[name=joint_2]``."""

from dataclasses import dataclass
import re

from motor_sysid.errors import UserError

STEP = re.compile(r'([A-Za-z_]\w*)(?:\[(?:(\d+)|([A-Za-z_]\w*)=([^\]]+))\])?')


@dataclass(frozen=True)
class Step:
    """One step: a field, and for an array the element, by index or by a name beside it.

    Attributes
    ----------
    field:
        Field name.
    index:
        Element of an array, or None.
    key, text:
        ``velocity[name=joint_2]`` takes the element at which the string array `key` beside the
        field holds `text`; both empty otherwise.
    """

    field: str
    index: int | None = None
    key: str = ''
    text: str = ''

    @property
    def indexed(self) -> bool:
        """Whether an element of an array is meant."""
        return self.index is not None or bool(self.key)


def parse_path(text: str) -> tuple[Step, ...]:
    """Return the steps of a path.

    Raises
    ------
    UserError
        If it is not written as above.
    """
    steps = []
    for part in re.split(r'\.(?![^\[]*\])', text.strip()):
        match = STEP.fullmatch(part)
        if match is None:
            raise UserError(
                f'field path `{text}` cannot be read at `{part}`; write `vector.x`, '
                '`velocity[0]`, `velocity[name=joint_2]` or '
                '`interface_values[joint_names=joint_2].values[interface_names=velocity]`'
            )
        index = int(match[2]) if match[2] else None
        steps.append(Step(match[1], index, match[3] or '', (match[4] or '').strip()))
    return tuple(steps)
