"""What runs in the benchmark: each method turns a study into a candidate.

Budgets are those of the paper, 30 members and 50 iterations.  Swarms minimize the ITAE, over the
five raw parameters in the box that is theirs, or over the logarithms of the wide one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import time

import numpy as np
from numpy.typing import NDArray

from motor_sysid.benchmark.paper.control import DT
from motor_sysid.benchmark.paper.fitting import polish, recommended
from motor_sysid.benchmark.paper.plant import whole
from motor_sysid.benchmark.paper.printed_bats import PrintedBats
from motor_sysid.benchmark.paper.studies import Study
from motor_sysid.estimation.batch.optimizers import Optimizer, OPTIMIZERS
from motor_sysid.estimation.batch.optimizers import run as run_optimizer
from motor_sysid.signals.metrics import itae

Array = NDArray[np.float64]

POPULATION, ITERATIONS = 30, 50

_POINTS = 4


@dataclass(frozen=True)
class Box:
    """Where a search looks for a0, a1, a2, b and tau.

    Attributes
    ----------
    title:
        In words.
    lower, upper:
        (5,) bounds.
    logarithmic:
        Whether the first four are searched by their logarithms, with a2 held at 1.
    """

    title: str
    lower: Array
    upper: Array
    logarithmic: bool = False

    def candidates(self, z: Array) -> Array:
        """Return the (P, 5) candidates of coordinates (P, d)."""
        if not self.logarithmic:
            return z
        return whole(np.column_stack([np.exp(z[:, :3]), z[:, 3]]))

    def bounds(self) -> tuple[Array, Array]:
        """Return the bounds of the coordinates."""
        if not self.logarithmic:
            return self.lower, self.upper
        both = [np.append(np.log(x[[0, 1, 3]]), x[4]) for x in (self.lower, self.upper)]
        return both[0], both[1]


NARROW = Box('0.1 to 10, delay 0 to 3 s', np.array([0.1] * 4 + [0.0]),
             np.array([10.0] * 4 + [3.0]))  # fmt: skip
WIDE = Box('0.01 to 100, delay 0 to 10 s', np.array([0.01] * 4 + [0.0]),
           np.array([100.0] * 4 + [10.0]), logarithmic=True)  # fmt: skip


@dataclass(frozen=True)
class Answer:
    """What a method says.

    Attributes
    ----------
    candidate:
        (5,).
    simulations, seconds:
        Effort; the seconds are those of the processor.
    sigma:
        (4,) standard deviations of what is seen; empty if the method has none.
    on_bound:
        Whether it ended on a wall of its box.
    """

    candidate: Array
    simulations: int
    seconds: float
    sigma: Array
    on_bound: bool = False


@dataclass(frozen=True)
class Method:
    """A method.

    Attributes
    ----------
    title:
        What tables call it.
    column:
        The column of the paper's tables that it is to be compared with; empty for none.
    solve:
        Study and random numbers to an answer.
    """

    title: str
    column: str
    solve: Callable[[Study, np.random.Generator], Answer]


def searched(optimizer: type[Optimizer], box: Box, *, polished: bool) -> Callable[
    [Study, np.random.Generator], Answer
]:  # fmt: skip
    """Return a method that searches a box, and polishes what it finds if asked to."""

    def solve(study: Study, rng: np.random.Generator) -> Answer:
        begun = time.process_time()
        lower, upper = box.bounds()
        swarm = optimizer(lower.size, POPULATION, ITERATIONS, rng)
        return _search(study, box, (lower, upper), swarm, polished, begun)

    return solve


def _search(
    study: Study, box: Box, bounds: tuple[Array, Array], swarm: Optimizer, polished: bool,
    begun: float,
) -> Answer:  # fmt: skip
    """Search with a fresh swarm, then polish if asked to."""
    at = study.time
    found = run_optimizer(
        lambda z: np.nan_to_num(itae(study.errors(box.candidates(z)), at), nan=np.inf),
        *bounds, swarm, POPULATION * ITERATIONS,
    )  # fmt: skip
    best = box.candidates(found.x[np.newaxis, :])[0]
    if not polished:
        seconds = time.process_time() - begun
        return Answer(best, found.evaluations, seconds, np.zeros(0), bool(found.on_bound))
    fit = polish(study, best)
    simulations = found.evaluations + fit.simulations
    return Answer(fit.candidate, simulations, time.process_time() - begun, fit.sigma)


def from_one_start(study: Study, rng: np.random.Generator) -> Answer:
    """Least squares from one random point of the narrow box: what a toolbox does by default."""
    begun = time.process_time()
    start = rng.uniform(np.maximum(NARROW.lower, 0.05), NARROW.upper)
    fit = polish(study, start)
    return Answer(fit.candidate, fit.simulations, time.process_time() - begun, fit.sigma)


def best_fit(study: Study, rng: np.random.Generator) -> Answer:
    """Do the recommended fit; it draws no random number."""
    begun = time.process_time()
    fit = recommended(study)
    return Answer(fit.candidate, fit.simulations, time.process_time() - begun, fit.sigma)


def characteristic(study: Study, rng: np.random.Generator) -> Answer:
    """Grey wolves around what the characteristic points of a step response say."""
    begun = time.process_time()
    middle = characteristic_points(study)
    lower, upper = middle / 2.0, middle * 2.0
    swarm = OPTIMIZERS['gwo'](5, POPULATION, ITERATIONS, rng)
    return _search(study, NARROW, (lower, upper), swarm, False, begun)


def characteristic_points(study: Study) -> Array:
    """Return a candidate (5,) from a step response: final value, start, overshoot and its time.

    With overshoot M, damping ``z = -ln M / sqrt(pi^2 + ln^2 M)``; the peak lies half a period
    ``pi / (w sqrt(1 - z^2))`` behind the start.  Means over a few samples hold noise down.
    (Ogata 2010, Modern Control Engineering, section 5.3.)
    """
    y = np.convolve(study.measured, np.ones(_POINTS) / _POINTS, mode='same')
    final = float(np.mean(y[-y.size // 5 :]))
    noise = float(np.std(np.diff(study.measured[: y.size // 20])))
    moved = np.flatnonzero(y > max(0.01 * final, 4 * noise))
    begins = float(study.time[moved[0]]) if moved.size else 0.0
    peak = int(np.argmax(y))
    over = min(max(float(y[peak]) / final - 1.0, 0.005), 0.9)
    log = np.log(over)
    damping = -log / np.sqrt(np.pi**2 + log**2)
    half = max(float(study.time[peak]) - begins, DT)
    w = np.pi / half / np.sqrt(1 - damping**2)
    gain = final / float(np.mean(study.drive[-y.size // 5 :]))
    return np.array([w**2, 2 * damping * w, 1.0, gain * w**2, max(begins, 2 * DT)])


def _baselines(box: Box, *, polished: bool) -> dict[str, Method]:
    end = ' + least squares' if polished else ''
    tag = '_polished' if polished else ''
    swarms: dict[str, tuple[str, str, type[Optimizer]]] = {
        'pso': ('PSO (w 0.7, c 1.5)', 'PSO', OPTIMIZERS['pso_inertia']),
        'pso_chi': ('PSO, constriction', 'PSO', OPTIMIZERS['pso']),
        'gwo': ('GWO', 'GWO', OPTIMIZERS['gwo']),
        'ba': ('BA, sign corrected', 'BA', OPTIMIZERS['ba']),
        'ba_printed': ('BA as printed', 'BA', PrintedBats),
        'ga': ('GA (0.8, 0.1)', 'GA', OPTIMIZERS['ga']),
        'lshade': ('L-SHADE', '', OPTIMIZERS['lshade']),
        'pso_gwo': ('PSO and GWO, switching', '', OPTIMIZERS['pso_gwo']),
        'pso_sca': ('PSO and SCA', '', OPTIMIZERS['pso_sca']),
        'pso_gsa': ('PSO and GSA', '', OPTIMIZERS['pso_gsa']),
        'aoa_hho': ('AOA and HHO', '', OPTIMIZERS['aoa_hho']),
    }
    return {
        key + tag: Method(title + end, column, searched(made, box, polished=polished))
        for key, (title, column, made) in swarms.items()
    }


METHODS: Mapping[str, Method] = {
    **_baselines(NARROW, polished=False),
    'cpm_gwo': Method('characteristic points + GWO', '', characteristic),
    'ls': Method('LS from one random start', 'LS', from_one_start),
    **_baselines(NARROW, polished=True),
    'wide': Method('PSO and GWO, wide box, + least squares', '',
                   searched(OPTIMIZERS['pso_gwo'], WIDE, polished=True)),
    'wide_pso': Method('PSO, wide box, + least squares', '',
                       searched(OPTIMIZERS['pso_inertia'], WIDE, polished=True)),
    'best': Method('recommended: delay-profiled LS, output error', '', best_fit),
}  # fmt: skip
"""Every method by its key."""

READ = tuple(key for key in METHODS if key not in ('wide', 'wide_pso', 'best'))
"""Those that run on the readings; the recommended fit joins where the input is known."""

RECORDED = ('best', 'wide', 'wide_pso', 'pso', 'gwo', 'ba', 'ga', 'pso_gwo', 'pso_polished')
"""Those that run on records."""
