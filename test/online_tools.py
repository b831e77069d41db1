"""What the tests of online estimators share: who is tested, on which motor."""

from closed_loop import DT, FRICTION, TRUE, wrong_motor
import numpy as np

from motor_sysid.estimation.online import OnlineIdentifier

KINDS = ('brushed_dc', 'brushed_dc_reduced', 'mechanical_axis')
BY_REGRESSION = ('rls', 'rls_directional', 'compound_ls', 'window_ls', 'mras')
RECOMMENDED = ('rls', 'ekf')


def start_model(key, model=None):
    """Return a model that the estimator takes: a load observer needs a load."""
    model = model or wrong_motor()
    return model.with_effect('constant_load_torque') if key == 'sliding_mode' else model


def identifier(key, model=None, outputs=('current', 'speed'), tuning=None):
    return OnlineIdentifier(start_model(key, model), key, DT, ['voltage'], outputs, tuning)


def feed(online, rows, inputs=(1,), outputs=(2, 3)):
    online.update(rows[:, 0], rows[:, list(inputs)], rows[:, list(outputs)])
    return online


def truth(name):
    return FRICTION if name == 'coulomb_friction.tau_c' else TRUE[name]


def score(found):
    """Return the RMS of error over sigma, and the largest relative error of R, k_t and J."""
    scores = [(found[n].value - truth(n)) / found[n].sigma for n in found]
    worst = max(abs(found[n].value / truth(n) - 1) for n in ('R', 'k_t', 'J'))
    return np.sqrt(np.mean(np.square(scores))), worst
