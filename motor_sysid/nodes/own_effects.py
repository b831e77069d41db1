"""A user's own effects in a process of a node."""

from collections.abc import Sequence
from pathlib import Path

from motor_sysid.nodes.parameters import as_path
from motor_sysid.physics.effects import add_effect_file, catalogue

_taken: set[Path] = set()


def add_effect_files(files: Sequence[str]) -> None:
    """Add the effects of files, as the parameter ``effect_files`` names them, to the catalogue.

    A file is read once: laws that change while a motor turns would be compiled anew.

    Raises
    ------
    UserError
        If a file cannot be read, is no effect, or bears the name of one of the catalogue.
    """
    for path in map(as_path, files):
        if path not in _taken or path.stem not in catalogue():
            add_effect_file(path)
            _taken.add(path)
