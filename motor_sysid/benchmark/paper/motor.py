"""The same dynamics as a motor that could exist, with its current measured.

The paper's K_t = 5 N m/A with K_e = 0.6 V s/rad makes more mechanical power than it takes from the
terminals.  With K_t = K_e = sqrt(3) the denominator ``s^2 + 3 s + 5`` is the same.  Truth is the
independent simulator of the diagnosis benchmark, the model is the package's `brushed_dc` with an
input delay; all six numbers can be identified.
"""

from dataclasses import dataclass
from functools import lru_cache
import time

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.paper.control import DT
from motor_sysid.benchmark.paper.studies import binary, levels, STEPS
from motor_sysid.benchmark.plant import Plant
from motor_sysid.benchmark.truth import Control, run, Truth
from motor_sysid.diagnosis import diagnose
from motor_sysid.diagnosis.fitting import add_effect, compare_model, fit_model
from motor_sysid.estimation.batch import make_chain, Problem, refit
from motor_sysid.estimation.batch.information import Information, information
from motor_sysid.estimation.residual_tests import ljung_box
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

TRUE = {'R': 2.0, 'L': 2.0, 'k_t': float(np.sqrt(3.0)), 'J': 0.5, 'b': 1.0, 'delay': 1.0}
_DELAY = 'input_delay.delay'
_REST = levels((0.0,), 3.0)
"""Every record begins at rest: what the input was before it, a model cannot know."""
UNSEEN_VOLTS = levels((3.0, -3.0, 1.0, 4.0, -2.0, 2.5), 4.0)


@dataclass(frozen=True)
class MotorRun:
    """One fit of the motor.

    Attributes
    ----------
    decibel, seed:
        Noise and its seed.
    errors, scores:
        (6,) relative errors, and errors over the Cramer-Rao bounds, in the order of `TRUE`.
    covered:
        (6,) whether the stated 95 % intervals hold the truth.
    seconds, simulations:
        Effort; the seconds are those of the processor.
    """

    decibel: int
    seed: int
    errors: tuple[float, ...]
    scores: tuple[float, ...]
    covered: tuple[bool, ...]
    seconds: float
    simulations: int

    @property
    def worst(self) -> float:
        """Largest relative error, in percent."""
        return 100 * max(abs(e) for e in self.errors)


@dataclass(frozen=True)
class HiddenRun:
    """One diagnosis of the motor, without delay, with a Coulomb torque or none.

    Attributes
    ----------
    tau_c, seed:
        Torque, N m, and seed of the noise.
    whiteness:
        p of the Ljung-Box test of what the linear model leaves of the speed.
    place:
        Place of Coulomb friction among the candidates, 1 for the first; 0 if it is not there.
    flagged:
        Whether the diagnosis says that something is missing.
    found:
        Torque after it was added, N m; 0 where the fit has no use for it.
    chi2:
        Mean square of what is then left of the speed, over that of the noise.
    fit:
        Then on levels that were not fitted, without noise, in percent.
    """

    tau_c: float
    seed: int
    whiteness: float
    place: int
    flagged: bool
    found: float
    chi2: float
    fit: float


def record(
    decibel: int, seed: int, volts: Array, tau_c: float = 0.0, delay: float = TRUE['delay']
) -> tuple[Record, float]:
    """Return a record of the true motor with noise, and the noise of its speed, rad/s."""
    truth = _truth(volts.tobytes(), tau_c, delay)
    rng = np.random.default_rng([seed, decibel])
    signals, sigma = {'voltage': volts}, 0.0
    for name, clean in (('current', truth.current), ('speed', truth.speed)):
        sigma = float(np.sqrt(np.mean(clean**2))) * 10 ** (-decibel / 20)
        signals[name] = clean + sigma * rng.standard_normal(volts.size)
    units = {'voltage': 'V', 'current': 'A', 'speed': 'rad/s'}
    time_of = np.linspace(0.0, DT * (volts.size - 1), volts.size)
    return Record(time_of, signals, units), sigma


@lru_cache(maxsize=16)
def _truth(volts: bytes, tau_c: float, delay: float) -> Truth:
    """Return what the motor does; the same is asked for with every noise."""
    plant = Plant(
        R=TRUE['R'], L=TRUE['L'], k=TRUE['k_t'], J=TRUE['J'], b=TRUE['b'], delay=delay,
        tau_plus=tau_c, tau_minus=tau_c,
    )  # fmt: skip
    return run(plant, Control(np.frombuffer(volts)), DT)


def fitted(decibel: int, seed: int) -> MotorRun:
    """Fit the motor from values that are wrong by factors of up to three, and half the delay."""
    data, _ = record(decibel, seed, np.append(_REST, STEPS))
    factors = 3.0 ** np.random.default_rng([seed, 5]).uniform(-1, 1, 5)
    begin = {n: TRUE[n] * f for n, f in zip(list(TRUE)[:5], factors, strict=True)}
    model = Model.base('brushed_dc', begin).with_effect('input_delay', {'delay': 0.5})
    begun = time.process_time()
    result = refit(model, data, 'pso_gwo', seed=seed)
    seconds = time.process_time() - begun
    names = [*list(TRUE)[:5], _DELAY]
    true, told = np.array(list(TRUE.values())), result.information
    found = np.array([result.model[n] for n in names])
    sigma = np.array([result.model.parameters[n].sigma or np.inf for n in names])
    bound = told.bound[[told.names.index(n) for n in names]]
    return MotorRun(
        decibel, seed, tuple((found / true - 1).tolist()),
        tuple(((found - true) / bound).tolist()),
        tuple((np.abs(found - true) <= 1.959964 * sigma).tolist()), seconds, result.simulations,
    )  # fmt: skip


def ranks() -> dict[str, Information]:
    """Return what can be seen of R, L, k_t, emf_ratio, J, b and the delay with which sensors."""
    data, _ = record(300, 0, np.append(_REST, STEPS))
    model = Model.base('brushed_dc', {n: TRUE[n] for n in list(TRUE)[:5]})
    model = model.with_effect('input_delay', {'delay': TRUE['delay']})
    found = {}
    for title, outputs, free in (
        ('speed alone', ('speed',), True),
        ('speed and current', ('current', 'speed'), True),
        ('speed and current, K_t = K_e', ('current', 'speed'), False),
    ):
        tied = model.with_free(['emf_ratio'], free)
        problem = Problem(tied, [make_chain(data, tied.kind, outputs)], outputs)
        wanted = [k for k, p in enumerate(problem.free) if 'offset' not in p.name]
        slopes = [one.slope for one in problem.linearize(problem.vector())]
        flat = np.concatenate([s.reshape(-1, s.shape[2]) for s in slopes])[:, wanted]
        found[title] = information(flat, [problem.free[k].name for k in wanted])
    return found


def hidden(tau_c: float, seed: int) -> HiddenRun:
    """Hide a Coulomb torque, diagnose, add it, and look at what is left."""
    train, sigma = record(30, seed, 3 * binary(np.random.default_rng(seed), 48.0), tau_c, 0.0)
    fresh, _ = record(30, seed + 1000, UNSEEN_VOLTS, tau_c, 0.0)
    said = diagnose([train], [fresh], motor='brushed_dc')
    names = [c.effect for c in said.steps[0].candidates]
    linear = fit_model([train], [fresh], motor='brushed_dc')
    white = ljung_box(linear.training.residuals[0][:, 1], 20)
    _, trial = add_effect(linear.model, 'coulomb_friction', [train], [fresh])
    after = trial.rung
    left = after.training.residuals[0][:, 1]
    clean, _ = record(300, 0, UNSEEN_VOLTS, tau_c, 0.0)
    rest = compare_model(after.model, [clean])[0].channel_percent['speed']
    return HiddenRun(
        tau_c, seed, white.p,
        names.index('coulomb_friction') + 1 if 'coulomb_friction' in names else 0,
        said.verdict.value != 'complete',
        after.model['coulomb_friction.tau_c'] if after.model.effects else 0.0,
        float(np.mean(left**2)) / sigma**2, 100 - rest,
    )  # fmt: skip
