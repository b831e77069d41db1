"""Other methods on the same data, with the same terms.

A peer is a function of the training records and of the keys of the effects that it may name; it
returns the keys that it names, strongest first.  Sensor effects have no term in an equation, so
the peers cannot name them; they are asked about them all the same.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import importlib.util

from motor_sysid.benchmark.peers import e_sindy, f_test
from motor_sysid.signals.record import Record


@dataclass(frozen=True)
class Peer:
    """One of them.

    Attributes
    ----------
    title:
        Name for tables.
    name:
        The method.
    needs:
        Module that has to be installed, if any.
    """

    title: str
    name: Callable[[Sequence[Record], Sequence[str]], tuple[str, ...]]
    needs: str = ''

    @property
    def lacks(self) -> str:
        """Why it cannot run here; empty if it can."""
        if self.needs and importlib.util.find_spec(self.needs) is None:
            return f'{self.needs} is not installed; `pip install motor_sysid[bench]` brings it'
        return ''


PEERS: dict[str, Peer] = {
    'f_test': Peer('sequential F-test', f_test.name_effects),
    'e_sindy': Peer('PySINDy ensemble (E-SINDy)', e_sindy.name_effects, 'pysindy'),
}
"""Every peer by its key."""
