"""What an identifier was set to: published with the model, and read back by the replay."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.estimation.online import OnlineIdentifier
from motor_sysid.estimation.stream import EstimateStream, Rates
from motor_sysid.nodes.pipeline import Pipeline
from motor_sysid.nodes.topic_plan import TopicReader
from motor_sysid.nodes.topics import (
    DC,
    is_carried,
    lacking,
    plan_signals,
    SignalPlan,
    with_third_current,
)
from motor_sysid.physics.model import Model
from motor_sysid.physics.store import dump_model, parse_model
from motor_sysid.recording.sources import Source
from motor_sysid.signals.phases import CURRENTS

SECOND = 1_000_000_000
TYPICAL = 0.002
"""Sample time in s as long as it is not known."""


@dataclass(frozen=True)
class Configuration:
    """Everything that the estimates depend on besides the samples.

    Attributes
    ----------
    model:
        Where the estimator starts.
    estimator:
        ``rls`` or ``ekf``.
    sample_time:
        In s; 0 to learn it from the first stamps.
    estimate_rate, prediction_rate:
        Results per second of sample time.
    tolerance:
        Largest difference of the stamps of one sample, s.
    since:
        Stamp in ns of the first sample that it applies to; 0 for the start of the node.
    """

    model: Model
    estimator: str = 'rls'
    sample_time: float = 0.0
    estimate_rate: float = 10.0
    prediction_rate: float = 50.0
    tolerance: float = 0.0
    since: int = 0

    def to_texts(self) -> dict[str, str]:
        """Return it as key and text."""
        return {
            'estimator': self.estimator,
            'sample_time': repr(self.sample_time),
            'estimate_rate': repr(self.estimate_rate),
            'prediction_rate': repr(self.prediction_rate),
            'tolerance': repr(self.tolerance),
            'since': str(self.since),
            'effects': ', '.join(self.model.effects),
            'model': dump_model(self.model),
        }

    @classmethod
    def from_texts(cls, texts: Mapping[str, str]) -> 'Configuration':
        """Read it back.

        Raises
        ------
        UserError
            If something is missing or cannot be read.
        """
        try:
            return cls(
                parse_model(texts['model'], 'the recorded configuration'),
                texts['estimator'],
                sample_time=float(texts['sample_time']),
                estimate_rate=float(texts['estimate_rate']),
                prediction_rate=float(texts['prediction_rate']),
                tolerance=float(texts['tolerance']),
                since=int(texts.get('since', 0)),
            )
        except (KeyError, ValueError) as error:
            raise UserError(f'the recorded configuration lacks {error}') from None

    def make(self, sample_time: float) -> OnlineIdentifier:
        """Return a fresh estimator."""
        return OnlineIdentifier(
            self.model, self.estimator, sample_time, self.inputs(), self.outputs()
        )

    def warm_up(self) -> None:
        """Have everything compiled before the first sample comes."""
        online = self.make(self.sample_time or TYPICAL)
        inputs, outputs = np.ones((4, len(self.inputs()))), np.ones((4, len(self.outputs())))
        online.update(online.dt * np.arange(1.0, 5.0), inputs, outputs)
        online.estimate()

    def inputs(self) -> tuple[str, ...]:
        """Return the signals that drive the model, by the names that the estimator is given."""
        return self.model.kind.inputs[0]

    def outputs(self) -> tuple[str, ...]:
        """Return the measured signals that the estimator is given; some may be missing."""
        return tuple(output.signal for output in self.model.kind.outputs)

    @property
    def frame(self) -> str:
        """``frame_id`` of the voltages and currents of such a motor."""
        return self.model.kind.frame or DC

    def plan(
        self, sources: Sequence[Source], base_clock: str = '', there: Collection[str] | None = None
    ) -> SignalPlan:
        """Return what to listen to; see `plan_signals`.

        The model is driven by the first set of inputs that has sources.  Outputs may be missing as
        far as the estimator can do without.  A phase current that no topic carries is made from
        the other two; so is one that turns out to have no values, if it is heard with them.

        Raises
        ------
        UserError
            If no set of inputs has sources, or too few of the outputs.
        """
        sets = self.model.kind.inputs
        sources = with_third_current(sources, self.frame)
        carried = partial(is_carried, sources=sources, frame=self.frame)
        inputs = next((names for names in sets if all(map(carried, names))), None)
        if inputs is None:
            raise lacking(' or '.join(' and '.join(f'`{n}`' for n in names) for names in sets))
        outputs = tuple(filter(carried, self.outputs()))
        wanted = *inputs, *outputs
        choose = partial(plan_signals, sources, frame=self.frame, base_clock=base_clock,
                         there=there, spare=outputs)  # fmt: skip
        plan = choose(wanted)
        if len(phases := {*CURRENTS} & {*outputs}) == 2 and carried(*{*CURRENTS} - phases):
            more = choose((*wanted, *{*CURRENTS} - phases))
            plan = more if more.names == plan.names else plan
        self._check([name for name in outputs if name in plan.signals])
        return plan

    def _check(self, outputs: Sequence[str]) -> None:
        """Refuse outputs with which the estimator does not go on."""
        if not {'speed', 'position'} & set(outputs):
            raise lacking('`speed` or `position`')
        if self.model.kind.needs_position and 'position' not in outputs:
            raise lacking('`position`')
        if len(outputs) < len(self.outputs()):
            sample_time = self.sample_time or TYPICAL
            OnlineIdentifier(self.model, self.estimator, sample_time, self.inputs(), outputs)

    def pipeline(self, plan: SignalPlan, readers: Sequence[TopicReader], window: int) -> Pipeline:
        """Return the working part."""
        rates = Rates(
            round(SECOND / self.estimate_rate),
            round(SECOND / self.prediction_rate),
            round(SECOND * self.sample_time),
        )
        return Pipeline(
            plan,
            readers,
            EstimateStream(self.make, rates),
            next(names for names in self.model.kind.inputs if {*names} <= {*plan.signals}),
            self.outputs(),
            window,
            round(SECOND * self.tolerance),
        )
