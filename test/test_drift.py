"""What comes or goes within a record leaves an error that is slower than noise."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from motor_sysid.diagnosis.where.compare import Comparison
from motor_sysid.diagnosis.where.drift import DRIFT, drift_of
from motor_sysid.diagnosis.where.remainder import Remainder

COUNT, DT = 12_000, 1e-3
LEAST = np.array([1.3, 1.3])


def random_load(rng, tau):
    """Return an error of 3 times the noise that is correlated for `tau` seconds, and noise."""
    keep = np.exp(-DT / tau)
    slow = lfilter([1.0], [1.0, -keep], rng.normal(size=COUNT)) * np.sqrt(1 - keep**2)
    return 3.0 * slow + rng.normal(size=COUNT)


def drift(first, second=None, held=None):
    """Return the drift of two training records and a held-out one; those not given are noise."""
    rng = np.random.default_rng(5)
    noise = rng.normal(size=COUNT)
    given = [noise if r is None else r for r in (first, second, held)]
    pairs = [np.stack((r, noise), axis=1) for r in given]
    one = (SimpleNamespace(scored=True),)
    parts = [
        Comparison(5.0, {}, (), tuple(r), tuple(np.ones_like(x) for x in r))
        for r in (pairs[:2], pairs[2:])
    ]
    return drift_of(*parts, ([one, one], [one]), LEAST)


@pytest.mark.parametrize('where', [0, 1, 2])
def test_a_load_that_sets_in_once_drifts(where):
    """In any record, trained on or held back."""
    step = np.where(np.arange(COUNT) < 5000, -6.0, 6.0)
    step += random_load(np.random.default_rng(1), 0.02)
    given = [None] * 3
    given[where] = step
    assert drift(*given) > DRIFT


def test_random_loads_do_not_drift():
    """Of 40 records with loads that last 0.1 s none reaches the limit, nor most of it."""
    rng = np.random.default_rng(2)
    worst = max(drift(random_load(rng, 0.1)) for _ in range(40))
    assert worst < 0.8 * DRIFT


def test_what_the_sensors_could_make_is_no_drift():
    """An encoder at rest has no error but a small slow one."""
    assert drift(0.5 * np.linspace(-1.0, 1.0, COUNT)) < 0.01


@pytest.mark.parametrize(
    ('share', 'error', 'structured'), [(0.8, 5.0, True), (0.3, 5.0, False), (0.8, 0.9, False)]
)
def test_a_drifting_model_lacks_something_unless_it_is_a_trifle(share, error, structured):
    """Nothing predicts it, and yet it is no noise; below 1 % of the signal no law is exact."""
    left = Remainder({'speed': 0.1}, 0.5, error, 4.0, 0.0, None, 1.0, share)
    assert left.structured is structured
