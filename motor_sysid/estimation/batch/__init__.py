"""Batch estimation: output-error least squares, and swarms with a least-squares polish."""

from motor_sysid.estimation.batch.least_squares import fit
from motor_sysid.estimation.batch.multistart import fit_multistart, misfit
from motor_sysid.estimation.batch.problem import Chain, make_chain, observed_outputs, Problem
from motor_sysid.estimation.batch.refit import METHODS, refit
from motor_sysid.estimation.batch.result import FitResult
from motor_sysid.estimation.batch.swarms import search, SWARMS
from motor_sysid.estimation.batch.weighting import coloured, Weighting, white

__all__ = [
    'METHODS', 'SWARMS', 'Chain', 'FitResult', 'Problem', 'Weighting', 'coloured', 'fit',
    'fit_multistart', 'make_chain', 'misfit', 'observed_outputs', 'refit', 'search', 'white',
]  # fmt: skip
