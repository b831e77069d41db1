"""The recordings of a fleet: a folder with one file, bag or folder for each motor."""

from pathlib import Path

from motor_sysid.errors import UserError
from motor_sysid.recording.rosbag import is_bag

ENDINGS = ('.mcap', '.db3', '.csv', '.csv.gz', '.mat', '.npz')
"""How the names of recordings end."""


def motors_in(folder: Path) -> dict[str, list[Path]]:
    """Return each motor's recordings by its name, in alphabetical order.

    A motor is a file that is a recording, a bag, or a folder with recordings of it; its name is
    that of the file without its ending, or of the folder.

    Raises
    ------
    UserError
        If there is no such folder, nothing to read in it, or one name twice.
    """
    if not folder.is_dir():
        raise UserError(f'{folder} is no folder; DIR has a recording or a folder for each motor')
    found: dict[str, list[Path]] = {}
    for entry in sorted(folder.iterdir()):
        recordings = [entry] if _is_recording(entry) else _inside(entry)
        if not recordings:
            continue
        name = _stem(entry)
        if name in found:
            raise UserError(f'{folder} has two motors `{name}`; give them names of their own')
        found[name] = recordings
    if not found:
        raise UserError(
            f'{folder} has no recordings; it should hold one ({", ".join(ENDINGS)} or a bag), or '
            'a folder with several, for each motor'
        )
    return found


def _inside(entry: Path) -> list[Path]:
    if not entry.is_dir():
        return []
    return [path for path in sorted(entry.iterdir()) if _is_recording(path)]


def _is_recording(path: Path) -> bool:
    if path.name.startswith('.'):
        return False
    return is_bag(path) if path.is_dir() else path.name.lower().endswith(ENDINGS)


def _stem(path: Path) -> str:
    """Return the name without the ending of a recording."""
    for ending in ENDINGS:
        if path.is_file() and path.name.lower().endswith(ending):
            return path.name[: -len(ending)]
    return path.name
