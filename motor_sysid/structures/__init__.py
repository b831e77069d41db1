"""Black-box structures: baselines, and the ceiling of what any model could explain."""

from motor_sysid.structures.base import Kind, Structure
from motor_sysid.structures.fit import fit, predict, simulate
from motor_sysid.structures.kinds import KINDS, known_kind
from motor_sysid.structures.store import dump_json, dump_yaml, parse

__all__ = [
    'KINDS', 'Kind', 'Structure', 'dump_json', 'dump_yaml', 'fit', 'known_kind', 'parse',
    'predict', 'simulate',
]  # fmt: skip
