"""The online estimators.  To add one: write its file and add its class here."""

from motor_sysid.estimation.online.base import OnlineEstimator
from motor_sysid.estimation.online.ekf import Ekf
from motor_sysid.estimation.online.rls import Rls

ESTIMATORS: dict[str, type[OnlineEstimator]] = {'rls': Rls, 'ekf': Ekf}
"""Every online estimator by its key."""
