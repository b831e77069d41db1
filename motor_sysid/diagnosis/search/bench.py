"""From records to a base model: which motor kind, which outputs, which sensors, how far ahead."""

from collections.abc import Callable, Hashable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product, starmap

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.threshold import UNCALIBRATED
from motor_sysid.diagnosis.search.held_back import parted
from motor_sysid.diagnosis.search.motor_kind import remarks_on_values
from motor_sysid.diagnosis.search.refusals import refuse_gaps
from motor_sysid.diagnosis.search.rotor_axes import OFFSET, with_axes
from motor_sysid.diagnosis.search.speed_sensors import filter_box, is_filtered, speed_sensors
from motor_sysid.diagnosis.search.standstill import (
    refuse_load_at_rest,
    seen_at_rest,
    stands_still,
    with_rotor_held,
)
from motor_sysid.estimation.batch import (
    Chain,
    fit_multistart,
    FitResult,
    make_chain,
    observed_outputs,
    Problem,
    sensors_of,
    thinned,
)
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.effects import effect
from motor_sysid.physics.model import Model, SpeedSensor
from motor_sysid.physics.motors import motor
from motor_sysid.physics.motors.base import Motor
from motor_sysid.physics.motors.speed import measured_speed
from motor_sysid.physics.scales import Scales, scales_of
from motor_sysid.signals.hall import with_hall_position
from motor_sysid.signals.lateness import speed_lateness
from motor_sysid.signals.motion import with_motion
from motor_sysid.signals.noisy_input import with_quiet_inputs
from motor_sysid.signals.phases import with_third_current
from motor_sysid.signals.record import Record
from motor_sysid.signals.slow_updates import with_moving_positions, with_news_held
from motor_sysid.signals.strays import without_strays

Array = NDArray[np.float64]

SPEED_WIDTH, CURRENT_WIDTH = 0.005, 0.003
"""Width of the smoothed sign of speed and of current, as a fraction of their RMS.

Current changes within a millisecond, so a narrower sign would be stiffer than a sample can follow.
"""

ROUGH_ROWS, FEW_ROWS = 10_000, 4000
"""Rows that a rough fit looks at, and rows that tell from where it begins best."""


@dataclass(frozen=True)
class Bench:
    """Everything that stays the same while models are tried.

    Attributes
    ----------
    kind, outputs:
        Motor kind, and signals that errors are taken of.
    train:
        Chains for fitting: short looks ahead where a free run would drift, else free runs.
    held:
        The held-out data, cut as `train` is: what decides whether an effect helps.
    train_free, held_free:
        The same data run freely, for reporting.
    rough, few:
        Some of `train`, for finding out what is worth a fit to all of it; and fewer, for finding
        out from where such a fit begins best.
    records, roles:
        The stretches that are reported, each ``train`` or ``validate``, in the order of
        `train_free` then `held_free`.
    scales:
        Typical sizes.
    cuts:
        Of each record its rows, without an idle end, and the share of them that is fitted; in the
        order in which records were given, those of validation last.
    sensors:
        How the speed may be measured: more than one where the records do not tell.
    begun:
        First guess of the base parameters, from which a fit of a delay or a lag begins as well:
        the inductance and the inertia that make up for it hardly find back.
    blunt:
        Widths of smoothed signs to begin with: with narrow ones a fit has many valleys.
    horizon:
        How far ahead `train` and `held` look, s; None for free runs.
    substeps:
        Integration steps per sample; raised where one is not enough.
    wrong:
        Share of the whitened squares of the last model that is the integration's fault, where that
        is more than rounding.
    threshold:
        Gain in BIC that evidence must have.
    offered:
        Effects that may be named; nothing, if all may.
    filtered:
        Whether the speed is filtered, if a position beside it tells.
    notes:
        What is to be said of the data, whatever is found.
    runs:
        Chains and residuals of the last models that were run over them in the finest steps, which
        take long; every bench that is made of this one shares them.
    """

    kind: Motor
    outputs: tuple[str, ...]
    train: tuple[Chain, ...]
    held: tuple[Chain, ...]
    train_free: tuple[Chain, ...]
    held_free: tuple[Chain, ...]
    records: tuple[Record, ...]
    roles: tuple[str, ...]
    scales: Scales
    horizon: float | None
    rough: tuple[Chain, ...] = ()
    few: tuple[Chain, ...] = ()
    cuts: tuple[tuple[int, float], ...] = ()
    sensors: tuple[SpeedSensor, ...] = ()
    begun: Mapping[str, float] = field(default_factory=dict)
    blunt: Mapping[str, float] = field(default_factory=dict)
    substeps: int = 1
    wrong: float = 0.0
    threshold: float = UNCALIBRATED
    offered: Set[str] = frozenset()
    filtered: bool | None = None
    notes: tuple[str, ...] = ()
    runs: dict[Hashable, tuple[tuple[Chain, ...], Sequence[Array]]] = field(
        default_factory=dict, compare=False, repr=False
    )

    def problem(self, model: Model) -> Problem:
        """Return the problem of fitting a model to the training data."""
        return Problem(model, self.train, self.outputs, substeps=self.substeps)

    def other_sensors(self, model: Model) -> list[SpeedSensor]:
        """Return the other kinds of speed sensor that are worth trying with a model.

        All its effects must make sense with them: counts have no room for an offset.
        """
        known = self.sensors
        if SpeedSensor.IDEAL in known and 'speed' in self.outputs and model.filters_speed:
            known += (SpeedSensor.SAMPLED,)
        others = [one for one in known if one is not model.speed_sensor]
        return [one for one in others if model.with_speed_sensor(one).is_sound]

    def shows(self, key: str) -> bool:
        """Whether signals show that there is such an effect, whatever models say."""
        return bool(self.filtered) and effect(key).filters_speed

    def differenced(self, model: Model) -> list[bool]:
        """Return of each output whether its noise is that of differenced counts."""
        late = model.speed_sensor is SpeedSensor.DIFFERENCE
        return [late and name == 'speed' for name in self.outputs]


def prepared(
    records: Sequence[Record], wanted: str | None, known: Mapping[str, float]
) -> list[Record]:
    """Return uniform records without stray samples and noise of a voltage that does not act.

    And with what the motor needs and others tell: a third phase current, d and q, a position from
    Hall sectors, or speed and acceleration from the position.
    """
    mended = [with_third_current(without_strays(record).uniform()) for record in records]
    even = with_quiet_inputs(mended)
    even = with_axes(with_moving_positions(even), wanted, known)
    if wanted and motor(wanted).needs_position:
        even = [with_hall_position(record, known) for record in even]
    if wanted and any('acceleration' in names for names in motor(wanted).inputs):
        even = with_motion(even)
    ready = motor(wanted).prepare if wanted else None
    even = ready(even, known) if ready else even
    return [with_news_held(one, motor(wanted).driving if wanted else ()) for one in even]


def prepared_parts(
    train: Sequence[Record],
    validation: Sequence[Record],
    wanted: str | None,
    known: Mapping[str, float],
) -> tuple[list[Record], list[Record]]:
    """Return training and validation records prepared alike; see `prepared`."""
    both = prepared([*train, *validation], wanted, known)
    return both[: len(train)], both[len(train) :]


def base_fit(
    records: Sequence[Record],
    kind: Motor,
    chains: Sequence[Chain],
    outputs: Sequence[str],
    nominal: Mapping[str, float],
) -> FitResult:
    """Fit the linear motor, from several starts and with both kinds of speed sensor."""
    linear = all(unit_of(r) == 'm' for r in records)
    resting = bool(kind.currents) and stands_still(records)
    widths = _widths(kind, records)
    turned = {name: nominal[name] for name in (OFFSET,) if name in nominal}
    begun = _inside(kind, {**turned, **kind.start(records, nominal)})
    known = _inside(kind, {**begun, **nominal})
    starts = [begun] if known == begun else [begun, known]

    def begun_at(sensor: SpeedSensor, values: Mapping[str, float]) -> Problem:
        model = Model.base(kind.key, {**values, **widths}, speed_sensor=sensor, linear=linear)
        model = model.with_free(name for name in kind.unless_given if name not in nominal)
        model = with_rotor_held(model) if resting else model
        return Problem(model, chains, outputs)

    sensors = speed_sensors(records, outputs, speed_lateness(records))
    return fit_multistart(*starmap(begun_at, product(sensors, starts)))


def make_bench(
    train: Sequence[Record],
    validation: Sequence[Record],
    kind: Motor,
    model: Model | None = None,
    fraction: float = 0.2,
    nominal: Mapping[str, float] | None = None,
    *,
    lent: bool = False,
) -> Bench:
    """Prepare the data for a motor kind.

    Parameters
    ----------
    train, validation:
        Records; without validation records the last `fraction` of each is held back, or what
        tells more (see `parted`).
    model:
        A fitted model if there is one; it tells how far ahead a run may look without drifting.
    nominal:
        Data-sheet values.
    lent:
        Whether half of the held-out data count as training data; see `make_chain`.

    Raises
    ------
    UserError
        If a signal that is needed has values that are no numbers.
    """
    everything = [*train, *validation]
    train, parts, said = parted(train, validation, kind, fraction)
    outputs = observed_outputs(kind, everything)
    outputs = seen_at_rest(outputs) if stands_still(everything) else outputs
    refuse_load_at_rest(kind, everything)
    for record in everything:
        refuse_gaps(record, {*input_signals(record, kind), *outputs, 'position'} & set(record))
    known = model.parameters.values() if model else nominal or {}
    begun = _inside(kind, kind.start(train, known))
    values = model.parameters.values() if model else begun
    defaults = {p.name: p.value for p in kind.parameters}
    horizon = look_ahead(kind, {**defaults, **values}, train, outputs)

    sensors = sensors_of(everything, kind)
    cut_up = partial(make_chain, kind=kind, outputs=outputs, lent=lent, sensors=sensors)
    fitting, held = _cut(parts, cut_up, horizon)
    free, held_free = (fitting, held) if horizon is None else _cut(parts, cut_up, None)
    shown = [s for chain in (*free, *held_free) for s in chain if s.scored]
    count = sum(s.scored for chain in free for s in chain)
    late, dt = speed_lateness(train) if 'speed' in outputs else None, train[0].dt
    scales = scales_of(kind.key, {**defaults, **values}, [r.uniform() for r in train])
    return Bench(
        kind, outputs, fitting, held, free, held_free,
        tuple(s.record.slice(s.scored_from, len(s.record)) for s in shown),
        ('train',) * count + ('validate',) * (len(shown) - count),
        replace(scales, speed_filter=filter_box(late, dt)),
        horizon,
        thinned(fitting, kind, outputs, ROUGH_ROWS),
        thinned(fitting, kind, outputs, FEW_ROWS),
        tuple((len(r), share) for r, share in parts),
        sensors=speed_sensors(train, outputs, late),
        begun=begun,
        filtered=is_filtered(late, dt),
        blunt=_widths(kind, train),
        notes=remarks_on_values(kind, everything, {**defaults, **values})
        + _read_from_record(kind, begun, known)
        + said,
    )  # fmt: skip


def _cut(
    parts: Sequence[tuple[Record, float]], cut_up: Callable[..., Chain], horizon: float | None
) -> tuple[tuple[Chain, ...], tuple[Chain, ...]]:
    """Cut each record, with the share that is for fitting, into chains to fit and to judge on."""

    def chains(scored: str) -> tuple[Chain, ...]:
        cut = partial(cut_up, horizon=horizon, scored=scored)
        return tuple(chain for r, share in parts if (chain := cut(r, train_fraction=share)))

    return chains('train'), chains('validate')


def _read_from_record(
    kind: Motor, begun: Mapping[str, float], known: Mapping[str, float]
) -> tuple[str, ...]:
    """Say so where the pole pairs were not given but read from the records."""
    if not kind.wave or kind.terminals or kind.wave not in begun or known.get(kind.wave):
        return ()
    return (
        f'pole pairs {begun[kind.wave]:.0f} were read from the record; if the motor has others, '
        f'give them (`{kind.wave}` in the data sheet)',
    )


def look_ahead(
    kind: Motor, values: Mapping[str, float], records: Sequence[Record], outputs: Sequence[str]
) -> float | None:
    """Return how far ahead of the measured state a run may look (s), or None for freely.

    A motor with back-EMF forgets its start within milliseconds; where no current is measured, it
    may take a tenth of a record.  An axis that only integrates does not: a small constant error
    makes its position run away and hides every other effect, so it is looked at over twice its
    slowest time constant.
    """
    arrays = {name: np.array([v]) for name, v in values.items()}
    a = kind.like(arrays)[0][0]
    inner = [j for j, name in enumerate(kind.states) if name != 'theta']
    slowest = float(np.max(np.linalg.eigvals(a[np.ix_(inner, inner)]).real))
    time_constant = -1.0 / slowest if slowest < 0 else np.inf
    duration = max(r.duration for r in records)
    forgets = duration / (50 if kind.currents else 10)
    if 'position' not in outputs and time_constant < forgets:
        return None
    dt = max(r.dt for r in records)
    return float(np.clip(2 * time_constant, 100 * dt, max(duration / 10, 100 * dt)))


def unit_of(record: Record) -> str:
    """Return ``m`` for a linear axis, ``rad`` for a rotary one."""
    units = [record.units[n] for n in ('position', 'speed') if n in record]
    return 'm' if units and all(u.startswith('m') for u in units) else 'rad'


def with_scales(bench: Bench, model: Model) -> Bench:
    """Return the bench with scales measured by a fitted model."""
    records = [r for r, role in zip(bench.records, bench.roles, strict=True) if role == 'train']
    scales = scales_of(bench.kind.key, model.parameters.values(), records)
    return replace(bench, scales=replace(scales, speed_filter=bench.scales.speed_filter))


def _widths(kind: Motor, records: Sequence[Record]) -> dict[str, float]:
    names = {p.name for p in kind.parameters}
    speed = np.concatenate([measured_speed(r) for r in records])
    widths = {'omega_eps': SPEED_WIDTH * float(np.sqrt(np.mean(speed**2)))}
    if 'i_eps' in names:
        shown = next(o.signal for o in reversed(kind.outputs) if o.state in kind.currents)
        current = np.concatenate([r[shown] for r in records])
        widths['i_eps'] = CURRENT_WIDTH * float(np.sqrt(np.mean(current**2)))
    return {name: max(width, 1e-9) for name, width in widths.items()}


def _inside(kind: Motor, values: Mapping[str, float]) -> dict[str, float]:
    boxes = {p.name: p for p in kind.parameters}
    return {
        name: float(np.clip(value, boxes[name].lower, boxes[name].upper))
        for name, value in values.items()
        if name in boxes and np.isfinite(value)
    }
