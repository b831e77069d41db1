"""The online estimators.  To add one: write its file and add a line here."""

from collections.abc import Callable, Sequence
from functools import partial

from motor_sysid.errors import UserError
from motor_sysid.estimation.online.base import OnlineEstimator, Tuning
from motor_sysid.estimation.online.dual_ekf import DualUpdate
from motor_sysid.estimation.online.ekf import FilterpyUpdate
from motor_sysid.estimation.online.kalman import Kalman
from motor_sysid.estimation.online.learners.compound import Compound
from motor_sysid.estimation.online.learners.directional import Directional
from motor_sysid.estimation.online.learners.forgetting import Forgetting
from motor_sysid.estimation.online.learners.gradient import Gradient
from motor_sysid.estimation.online.learners.window import Window
from motor_sysid.estimation.online.mhe import Mhe
from motor_sysid.estimation.online.regressive import Regressive
from motor_sysid.estimation.online.sliding_mode import SlidingMode
from motor_sysid.estimation.online.ukf import Unscented
from motor_sysid.physics.model import Model

MakeEstimator = Callable[[Model, float, Sequence[str], Tuning], OnlineEstimator]

ESTIMATORS: dict[str, MakeEstimator] = {
    'rls': partial(Regressive, learner=Forgetting),
    'rls_directional': partial(Regressive, learner=Directional),
    'compound_ls': partial(Regressive, learner=Compound),
    'window_ls': partial(Regressive, learner=Window),
    'ekf': partial(Kalman, update=FilterpyUpdate),
    'dual_ekf': partial(Kalman, update=DualUpdate),
    'ukf': partial(Kalman, update=FilterpyUpdate, transform=Unscented),
    'mhe': Mhe,
    'mras': partial(Regressive, learner=Gradient),
    'sliding_mode': SlidingMode,
}
"""Every online estimator by its key."""


def known_estimator(key: str) -> MakeEstimator:
    """Return what makes an estimator.

    Raises
    ------
    UserError
        If there is none of that key.
    """
    if key not in ESTIMATORS:
        raise UserError(f'unknown estimator `{key}`; known are {", ".join(ESTIMATORS)}')
    return ESTIMATORS[key]
