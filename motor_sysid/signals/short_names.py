"""Names of recordings: as short as tells them apart."""

from collections import Counter
from collections.abc import Iterable
from pathlib import PurePath


def short_names(sources: Iterable[str]) -> dict[str, str]:
    """Return of each source the shortest end of its path that no other has."""
    paths = {source: PurePath(source).parts for source in sources}
    ends = {
        source: [PurePath(*parts[-n:]).as_posix() for n in range(1, len(parts) + 1)]
        for source, parts in paths.items()
    }
    shared = Counter(end for own in ends.values() for end in own)
    return {
        source: next((end for end in own if shared[end] == 1), own[-1] if own else 'record')
        for source, own in ends.items()
    }
