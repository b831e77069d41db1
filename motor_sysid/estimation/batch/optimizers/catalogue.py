"""Every optimizer by its key.  To add one: write its file, add it here."""

from motor_sysid.estimation.batch.optimizers.aco import Ants
from motor_sysid.estimation.batch.optimizers.aoa import Arithmetic
from motor_sysid.estimation.batch.optimizers.aoa_hho import ArithmeticHawks
from motor_sysid.estimation.batch.optimizers.base import Optimizer
from motor_sysid.estimation.batch.optimizers.bats import Bats
from motor_sysid.estimation.batch.optimizers.bees import Bees
from motor_sysid.estimation.batch.optimizers.cs import Cuckoos
from motor_sysid.estimation.batch.optimizers.de import BestEvolution, RandomEvolution
from motor_sysid.estimation.batch.optimizers.fpa import Flowers
from motor_sysid.estimation.batch.optimizers.ga import Genes
from motor_sysid.estimation.batch.optimizers.gsa import Masses
from motor_sysid.estimation.batch.optimizers.gwo import GreyWolves
from motor_sysid.estimation.batch.optimizers.hho import Hawks
from motor_sysid.estimation.batch.optimizers.jaya import Jaya
from motor_sysid.estimation.batch.optimizers.mpa import MarinePredators
from motor_sysid.estimation.batch.optimizers.pso import (
    AdaptiveSwarm,
    ConstrictionSwarm,
    DynamicSwarm,
    InertiaSwarm,
)
from motor_sysid.estimation.batch.optimizers.pso_gsa import GravitySwarm
from motor_sysid.estimation.batch.optimizers.pso_gwo import Switching
from motor_sysid.estimation.batch.optimizers.pso_sca import WavingSwarm
from motor_sysid.estimation.batch.optimizers.rao import RaoOne
from motor_sysid.estimation.batch.optimizers.sa import Annealing
from motor_sysid.estimation.batch.optimizers.sca import SineCosine
from motor_sysid.estimation.batch.optimizers.shade import ShrinkingHistory, SuccessHistory
from motor_sysid.estimation.batch.optimizers.tlbo import Learners
from motor_sysid.estimation.batch.optimizers.woa import Whales

OPTIMIZERS: dict[str, type[Optimizer]] = {
    'pso': ConstrictionSwarm,
    'pso_inertia': InertiaSwarm,
    'pso_adaptive': AdaptiveSwarm,
    'pso_dynamic': DynamicSwarm,
    'gwo': GreyWolves,
    'ba': Bats,
    'ga': Genes,
    'de': RandomEvolution,
    'de_best': BestEvolution,
    'shade': SuccessHistory,
    'lshade': ShrinkingHistory,
    'woa': Whales,
    'abc': Bees,
    'cs': Cuckoos,
    'fpa': Flowers,
    'jaya': Jaya,
    'rao': RaoOne,
    'tlbo': Learners,
    'sca': SineCosine,
    'gsa': Masses,
    'hho': Hawks,
    'mpa': MarinePredators,
    'aoa': Arithmetic,
    'sa': Annealing,
    'aco': Ants,
    'pso_gwo': Switching,
    'pso_sca': WavingSwarm,
    'pso_gsa': GravitySwarm,
    'aoa_hho': ArithmeticHawks,
}
"""Every optimizer."""
