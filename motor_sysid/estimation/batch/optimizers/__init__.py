"""Optimizers that need costs only, one page each, behind `search`."""

from motor_sysid.estimation.batch.optimizers.base import Optimizer
from motor_sysid.estimation.batch.optimizers.catalogue import OPTIMIZERS
from motor_sysid.estimation.batch.optimizers.search import Found, run, search, Stop

__all__ = ['OPTIMIZERS', 'Found', 'Optimizer', 'Stop', 'run', 'search']
