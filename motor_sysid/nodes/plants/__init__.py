"""The motors that can be simulated live.  To add one: write its file and name its class here."""

from motor_sysid.nodes.plants.base import Plant, Setup
from motor_sysid.nodes.plants.bldc import BldcPlant
from motor_sysid.nodes.plants.brushed_dc import BrushedDcPlant
from motor_sysid.nodes.plants.pmsm import PmsmPlant

PLANTS: dict[str, type[Plant]] = {
    'brushed_dc': BrushedDcPlant, 'pmsm': PmsmPlant, 'bldc': BldcPlant
}  # fmt: skip


def make_plant(setup: Setup) -> Plant:
    """Return the simulated motor, at rest."""
    return PLANTS[setup.base.motor](setup)
