"""The motors that can be simulated live.  To add one: write its file and name its class here."""

from motor_sysid.nodes.motor_settings import MotorSettings
from motor_sysid.nodes.plants.base import Plant
from motor_sysid.nodes.plants.bldc import BldcPlant
from motor_sysid.nodes.plants.brushed_dc import BrushedDcPlant
from motor_sysid.nodes.plants.pmsm import PmsmPlant

PLANTS: dict[str, type[Plant]] = {
    'brushed_dc': BrushedDcPlant, 'pmsm': PmsmPlant, 'bldc': BldcPlant
}  # fmt: skip


def make_plant(settings: MotorSettings) -> Plant:
    """Return the simulated motor of these settings, at rest."""
    return PLANTS[settings.motor_kind](settings)
