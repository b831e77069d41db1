"""The stage on which experiments are tried: models, noise, information, and simulated runs."""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
import math

import numpy as np
from numpy.typing import NDArray

from motor_sysid.control.experiment import unit_of
from motor_sysid.control.loop import speed_loop, SpeedLoop
from motor_sysid.control.profile import Profile, SPEED
from motor_sysid.diagnosis.experiment.limits import Limits, MARGIN, SIZES
from motor_sysid.diagnosis.search.bench import look_ahead
from motor_sysid.estimation.batch import (
    coloured,
    make_chain,
    observed_outputs,
    Problem,
    Weighting,
    white,
)
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.model import Model
from motor_sysid.physics.simulate import simulate
from motor_sysid.signals.record import Provenance, Record

Array = NDArray[np.float64]

AR_ORDER = 12
HEAD = 2
"""Samples at the start of a stretch that tell nothing of the noise: a speed that is a difference
of counts needs an earlier one."""

ROUGH, THOROUGH = 1, 3
"""Rounds in which the answer of the speed controller to friction and the like is found."""

UNSEEN = 1e-9
"""Share of a signal's size below which its noise is not believed."""


@dataclass(frozen=True)
class Run:
    """An experiment simulated with one model, free of noise.

    Attributes
    ----------
    record:
        Input and everything that the model predicts.
    peaks:
        Largest input, speed, current and distance from the start.
    """

    record: Record
    peaks: Mapping[str, float]

    def excess(self, limits: Limits) -> float:
        """Return the largest peak over what the limits, less a margin, allow: 1 is the most."""
        return max(
            [p / (MARGIN * limits.of(name)) for name, p in self.peaks.items()], default=0.0
        )


class Stage:
    """What stays the same while experiments are tried.

    Parameters
    ----------
    models:
        Fitted models of one motor kind: rivals, or the one whose parameters are in question.
    records:
        What they were fitted to.
    limits:
        Of the experiment.
    samples:
        Most samples of a simulated experiment; a faster record is thinned out.
    rounds:
        Rounds in which a speed controller's answer is found.

    Raises
    ------
    UserError
        If the motor has more than one input.
    """

    def __init__(
        self,
        models: Sequence[Model],
        records: Sequence[Record],
        limits: Limits,
        samples: int,
        rounds: int = ROUGH,
    ) -> None:
        self.models, self.limits, self.rounds = tuple(models), limits, rounds
        self.kind = models[0].kind
        step = max(records[0].dt, limits.time / samples)
        whole = max(round(step / records[0].dt), 1) * records[0].dt
        self.records = [r.uniform(whole) for r in records]
        self.dt = self.records[0].dt
        self.input = input_signals(self.records[0], self.kind)[0]
        self.outputs = observed_outputs(self.kind, self.records)
        self.horizon = look_ahead(
            self.kind, models[0].parameters.values(), self.records, self.outputs
        )
        self.loops = [speed_loop(m, self.dt) for m in models]

    def problem(self, model: Model, records: Sequence[Record]) -> Problem:
        """Return the problem of fitting a model to records."""
        chains = [make_chain(r, self.kind, self.outputs, horizon=self.horizon) for r in records]
        return Problem(model, chains, self.outputs)

    @cached_property
    def weighting(self) -> Weighting:
        """The noise that the best of the models leaves on the records."""
        left, sizes = [], []
        for model in self.models:
            problem = self.problem(model, self.records)
            size = white([s.judged for s in problem.stretches])
            errors = [e[HEAD:] for e in problem.residuals(problem.vector(), size)]
            left.append([e for e in errors if len(e) > 2 * AR_ORDER])
            sizes.append(np.mean((np.concatenate(left[-1]) / size.sigma) ** 2))
        return cautious(left[int(np.argmin(sizes))], UNSEEN * size.sigma)

    def with_models(self, models: Sequence[Model]) -> 'Stage':
        """Return a stage for other models of the same kind, with the noise found on this one."""
        noise, other = self.weighting, copy(self)
        other.models = tuple(models)
        other.weighting = noise
        return other

    def with_limits(self, limits: Limits) -> 'Stage':
        """Return the stage with other limits."""
        noise, other = self.weighting, copy(self)
        other.limits, other.weighting = limits, noise
        return other

    def run(self, profile: Profile, place: int, model: Model | None = None) -> Run:
        """Simulate a profile with the model in that place, or a variation of it."""
        model = model or self.models[place]
        wanted = profile.sampled(self.dt)
        if profile.signal == SPEED:
            return self._measured(model, self._followed(model, self.loops[place], wanted))
        return self._measured(model, wanted)

    def _followed(self, model: Model, loop: SpeedLoop, reference: Array) -> Array:
        """Return (N,) what a linear speed controller would put out, without running it.

        Whatever the linear core does not explain of the model's speed counts as a disturbance,
        which the loop answers; after a few rounds the disturbance hardly changes.
        """
        u = loop.answer(reference)
        for _ in range(self.rounds):
            disturbance = self._outputs(model, u)['speed'] - loop.speed(u)
            if not np.all(np.isfinite(disturbance)):
                return u
            u = loop.answer(reference - disturbance)
        return u

    def _outputs(self, model: Model, u: Array) -> Mapping[str, Array]:
        name = self.input
        time = self.dt * np.arange(u.size, dtype=np.float64)
        bare = Record(time, {name: u}, {name: unit_of(name, linear=model.linear)})
        return simulate(model, bare, follow_position=False).outputs

    def _measured(self, model: Model, u: Array) -> Run:
        seen = self._outputs(model, u)
        signals = {self.input: u, **seen}
        units = {key: unit_of(key, linear=model.linear) for key in signals}
        found = {'input': u, 'speed': seen['speed'], 'travel': seen['position']}
        if 'current' in seen:
            found['current'] = seen['current']
        with np.errstate(invalid='ignore'):
            peaks = {key: float(np.max(np.abs(found[key]))) for key in SIZES if key in found}
        finite = {key: p if math.isfinite(p) else math.inf for key, p in peaks.items()}
        time = self.dt * np.arange(u.size, dtype=np.float64)
        return Run(Record(time, signals, units, Provenance('designed')), finite)


def cautious(errors: Sequence[Array], floor: Array) -> Weighting:
    """Return the noise model of (N, n_y) errors that promises less: coloured or white.

    Noise with little power at low frequencies (differenced counts) would let a slow difference of
    a fraction of a count look like certainty; what a model leaves of real friction forbids that.
    """
    colour, plain = coloured(errors, AR_ORDER, floor), white(errors, floor)
    whiteners, sigmas = [], []
    for w, sigma, rms in zip(colour.whiteners, colour.sigma, plain.sigma, strict=True):
        keen = abs(float(np.sum(w))) / sigma > 1 / rms
        whiteners.append(np.eye(1, w.size)[0] if keen else w)
        sigmas.append(rms if keen else sigma)
    return Weighting(np.array(sigmas), tuple(whiteners))
