"""Batch estimation: output-error least squares, and optimizers with a least-squares polish."""

from motor_sysid.estimation.batch.chains import (
    Chain,
    make_chain,
    observed_outputs,
    thinned,
    without_memory,
)
from motor_sysid.estimation.batch.least_squares import fit, fit_and_slopes
from motor_sysid.estimation.batch.multistart import fit_multistart, misfit
from motor_sysid.estimation.batch.optimizers import OPTIMIZERS, pareto, search
from motor_sysid.estimation.batch.prior import Prior
from motor_sysid.estimation.batch.problem import Linearization, Problem
from motor_sysid.estimation.batch.refit import METHODS, refit
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.sampling import linear_of
from motor_sysid.estimation.batch.sensors import sensors_of
from motor_sysid.estimation.batch.sisters import believed
from motor_sysid.estimation.batch.starts import starts_of
from motor_sysid.estimation.batch.transfer import Transfer, transfer
from motor_sysid.estimation.batch.weighting import coloured, Weighting, white

__all__ = [
    'METHODS', 'OPTIMIZERS', 'Chain', 'FitResult', 'Linearization', 'Prior', 'Problem',
    'Transfer', 'Weighting', 'believed', 'coloured', 'fit', 'fit_and_slopes', 'fit_multistart',
    'linear_of', 'make_chain', 'misfit', 'observed_outputs', 'pareto', 'refit', 'search',
    'sensors_of', 'starts_of', 'thinned', 'transfer', 'white', 'without_memory',
]  # fmt: skip
