"""The kinds of structures.  To add one: write its file and add it here."""

from motor_sysid.errors import UserError
from motor_sysid.signals.units import did_you_mean
from motor_sysid.structures.armax import Armax
from motor_sysid.structures.arx import Arx
from motor_sysid.structures.base import Kind
from motor_sysid.structures.bj import BoxJenkins
from motor_sysid.structures.echo_state import EchoState
from motor_sysid.structures.fractional import Fractional
from motor_sysid.structures.hammerstein import Hammerstein
from motor_sysid.structures.hammerstein_wiener import HammersteinWiener
from motor_sysid.structures.narx import Narx
from motor_sysid.structures.network import Network
from motor_sysid.structures.oe import OutputError
from motor_sysid.structures.subspace import StateSpace
from motor_sysid.structures.transfer_function import TransferFunction
from motor_sysid.structures.wiener import Wiener

_ALL: tuple[Kind, ...] = (
    TransferFunction(), Arx(), Armax(), OutputError(), BoxJenkins(), StateSpace(), Narx(),
    Hammerstein(), Wiener(), HammersteinWiener(), Fractional(), Network(), EchoState(),
)  # fmt: skip

KINDS: dict[str, Kind] = {kind.key: kind for kind in _ALL}
"""Every kind by its key."""


def known_kind(key: str) -> Kind:
    """Return the kind of a key.

    Raises
    ------
    UserError
        If there is none.
    """
    if key not in KINDS:
        raise UserError(
            f'unknown structure `{key}`{did_you_mean(key, KINDS)}; known are {", ".join(KINDS)}'
        )
    return KINDS[key]
