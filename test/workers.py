"""Which worker runs which tests, where several do: a plugin of pytest and of pytest-xdist."""

from pathlib import PurePath
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from xdist.remote import Producer
    from xdist.scheduler import LoadScopeScheduling

LONGEST = ('live', 'test_diagnosis', 'test_real_data', 'test_calibration')
"""Groups of tests that take a minute and more: begun last, they would leave a worker idle."""


def group_of(file: str) -> str:
    """Return the group of the tests in a file: the file, or all that wait for messages.

    Nodes keep their times on a machine of two cores if only one set of them runs at once.
    """
    stem = PurePath(file).stem
    return 'live' if stem.startswith('test_nodes_') else stem


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest groups."""
    groups = {item: group_of(item.path.name) for item in items}
    items.sort(key=lambda item: LONGEST.index(groups[item]) if groups[item] in LONGEST else 99)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(
    config: pytest.Config, log: 'Producer'
) -> 'LoadScopeScheduling':
    """Give each group to one worker, so that what a file sets up is set up once.

    By the name of the file: the marks that ``--dist loadgroup`` reads are lost with pytest 9.2.
    """
    from xdist.scheduler import LoadScopeScheduling

    class ByGroup(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group_of(nodeid.partition('::')[0])

    return ByGroup(config, log)
