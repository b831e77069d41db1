"""Optimizers that need costs only, one page each, behind `search`."""

from motor_sysid.estimation.batch.optimizers.base import Optimizer
from motor_sysid.estimation.batch.optimizers.catalogue import OPTIMIZERS
from motor_sysid.estimation.batch.optimizers.nsga2 import Front, pareto
from motor_sysid.estimation.batch.optimizers.search import Found, run, search, Stop

__all__ = ['OPTIMIZERS', 'Found', 'Front', 'Optimizer', 'Stop', 'pareto', 'run', 'search']
