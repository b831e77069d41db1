"""Online estimation: recursive estimators, and what feeds them with time stamped samples."""

from motor_sysid.estimation.online.base import Estimate, OnlineEstimator, Tuning
from motor_sysid.estimation.online.estimators import ESTIMATORS
from motor_sysid.estimation.online.identifier import OnlineIdentifier

__all__ = ['ESTIMATORS', 'Estimate', 'OnlineEstimator', 'OnlineIdentifier', 'Tuning']
