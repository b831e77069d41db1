"""Bring topics with different stamps onto one time axis.

The rows of a record are the stamps of one topic, the base clock (the fastest unless one is
chosen).  A signal whose topic has a message with that stamp gives its value exactly.  Elsewhere
measured signals are interpolated linearly, references and codes held, and an input that changes
within a row is averaged over it, so that the volt-seconds stay right.  What was measured, and
when, is kept beside what is interpolated.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motor_sysid.errors import UserError
from motor_sysid.recording.rows import gap_limit, out_of_order, Rows, times, true_order
from motor_sysid.signals.channels import Role, role_of
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import resample, Samples

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Mask = NDArray[np.bool_]

REGULAR = 3.0
"""A topic is sent at a rate if 90 % of its steps are below this many median steps."""
NEARLY = 0.9
"""Share of the most messages from which a topic counts as just as fast."""
MEASURED = ('speed', 'position', 'current', 'current_q', 'current_a')
REFERENCE_COVER = 0.5
"""A reference that covers less of the base clock is left out, unless the motor idled before."""
IDLE = 0.1
"""The inputs vary less than this share of what they vary under a reference: nothing drives."""


@dataclass(frozen=True)
class Series:
    """Signals of one topic.

    Attributes
    ----------
    topic:
        Its name.
    stamps:
        (N,) ns, in the order of reception.
    received:
        (N,) ns.
    signals:
        Signal name to (N,) values in SI.
    stamped:
        Whether the stamps were set by the sender; else they are the times of reception.
    """

    topic: str
    stamps: Stamps
    received: Stamps
    signals: Mapping[str, Array]
    stamped: bool = True

    def take(self, which: 'Mask | NDArray[np.intp] | slice') -> 'Series':
        """Return some of the messages."""
        signals = {name: values[which] for name, values in self.signals.items()}
        return replace(
            self, stamps=self.stamps[which], received=self.received[which], signals=signals
        )


def choose_base(series: Sequence[Series], signal: str) -> Series:
    """Return the series of the chosen signal, or the one with most messages.

    Of topics with about as many messages, the one that carries an input is taken, so that a row
    has one input: when a measured signal was sampled is known, what an input did within a row is
    not.  Without one it is that of the speed, or else position or current.
    """
    names = [tuple(one.signals) for one in series]
    return series[fastest([one.stamps.size for one in series], names, signal)]


def fastest(counts: Sequence[int], signals: Sequence[Collection[str]], wanted: str = '') -> int:
    """Return the number of the topic whose stamps are to be the rows', see `choose_base`.

    Parameters
    ----------
    counts, signals:
        Messages and signals of each topic.
    wanted:
        Signal whose topic it is to be, if not empty.

    Raises
    ------
    UserError
        If no topic has that signal.
    """
    if wanted:
        for k, names in enumerate(signals):
            if wanted in names:
                return k
        raise UserError(f'base_clock `{wanted}` is not in the data; leave it out or name another')
    fast = [k for k, count in enumerate(counts) if count >= NEARLY * max(counts)]
    driven = [name for k in fast for name in signals[k] if role_of(name) is Role.INPUT]
    for name in (*driven, *MEASURED):
        for k in fast:
            if name in signals[k]:
                return k
    return max(fast, key=lambda k: counts[k])


def align(
    series: Sequence[Series], base: Series, units: Mapping[str, str]
) -> tuple[list[Rows], list[Finding]]:
    """Join series on the stamps of `base`; one `Rows` for each time the clock starts anew.

    Times are in s from the first stamp of the base (each time it starts).

    Raises
    ------
    UserError
        If the topics have no time in common.
    """
    findings: list[Finding] = []
    ordered = [_in_order(one, findings) for one in [base, *(s for s in series if s is not base)]]
    findings += _note_order(ordered)
    found: list[Rows] = []
    for clock, *rest in _epochs(ordered):
        if clock.stamps.size:
            found.append(_joined(clock, rest, units, findings))
    if not any(rows.time.size for rows in found):
        spans = '; '.join(
            f'{one.topic} {one.stamps[0] / 1e9:.3f} to {one.stamps[-1] / 1e9:.3f} s'
            for one in series
        )
        raise UserError(
            f'the topics have no time in common ({spans}); their clocks differ: give '
            '`stamp: receive` in a msg_config file, or synchronise the clocks'
        )
    return found, findings


def _in_order(one: Series, findings: list[Finding]) -> Series:
    """Put messages that overtook each other back in order."""
    back = int(np.sum(np.diff(one.stamps) < 0))
    order = true_order((one.stamps - one.stamps[0]) / 1e9) if back else None
    if order is None:
        return one
    findings.append(out_of_order(f'messages of {one.topic}', back))
    return replace(one.take(order), received=np.sort(one.received))


def _epochs(series: Sequence[Series]) -> list[list[Series]]:
    """Cut all topics where the first one jumps back; each piece strictly increasing.

    One that jumps back as often is cut where it does so itself.
    """
    anew = [one.received[_backward(one)] for one in series]
    cuts = [own if own.size == anew[0].size else anew[0] for own in anew]
    epochs = []
    for k in range(anew[0].size + 1):
        pieces = []
        for one, at in zip(series, cuts, strict=True):
            start, stop = ([-(2**62), *at.tolist(), 2**62])[k : k + 2]
            inside = (one.received >= start) & (one.received < stop)
            pieces.append(_increasing(one.take(inside) if at.size else one))
        epochs.append(pieces)
    return epochs


def _backward(one: Series) -> NDArray[np.intp]:
    """Return the messages whose stamps lie before that of the message before."""
    return np.flatnonzero(np.diff(one.stamps) < 0) + 1


def _increasing(one: Series) -> Series:
    """Keep the longest stretch without a step back, and the first of equal stamps."""
    back = _backward(one)
    if back.size:
        edges = [0, *back.tolist(), one.stamps.size]
        start, stop = max(pairwise(edges), key=lambda edge: edge[1] - edge[0])
        one = one.take(slice(start, stop))
    return one.take(np.concatenate(([True], np.diff(one.stamps) > 0))[: one.stamps.size])


def _note_order(series: Sequence[Series]) -> list[Finding]:
    """Note stamps that repeat or jump back."""
    findings = []
    for one in series:
        steps = np.diff(one.stamps)
        back, same = int(np.sum(steps < 0)), int(np.sum(steps == 0))
        if back:
            k = int(np.argmax(steps < 0))
            findings.append(
                Finding(
                    Severity.WARNING, 'time_jumps_back',
                    f'the stamps of {one.topic} jump back {times(back)}, first by '
                    f'{-steps[k] / 1e9:.6g} s at message {k + 2}; split there',
                    'each record is simulated from its own start',
                    'look for a clock that was set, a restarted simulation or two publishers',
                    {'jumps': back, 'by_s': -steps[k] / 1e9},
                )
            )  # fmt: skip
        if same:
            findings.append(
                Finding(
                    Severity.WARNING, 'repeated_stamps',
                    f'{same} of {one.stamps.size} messages of {one.topic} repeat the stamp before '
                    'them; left out',
                    'none if they were sent twice; else samples are lost',
                    'stamp every message with the time of its measurement', {'messages': same},
                )
            )  # fmt: skip
    return findings


def _joined(
    clock: Series,
    others: Sequence[Series],
    units: Mapping[str, str],
    findings: list[Finding],
) -> Rows:
    """Join one epoch."""
    stamps, origin = clock.stamps, int(clock.stamps[0])
    time = (stamps - origin) / 1e9
    signals, samples = dict(clock.signals), dict[str, Samples]()
    good = np.ones(stamps.size, dtype=bool)
    edges = _edges(time)
    for one in sorted(others, key=_is_reference):  # what moved without them must be known first
        covered = _covered(one, stamps)
        short = np.mean(covered) < REFERENCE_COVER
        if _is_reference(one) and short and not _idle(signals, ~covered):
            findings.append(_left_out(one, float(np.mean(covered))))
            continue
        good &= covered
        for name, values in one.signals.items():
            signals[name] = _carried(name, one, values, stamps, origin, edges)
            if role_of(name) is Role.MEASURED and not np.all(np.isin(stamps, one.stamps)):
                samples[name] = Samples((one.stamps - origin) / 1e9, values)
        if not np.array_equal(one.stamps, stamps) and one.stamps.size:
            findings.append(_how_joined(one, clock))
    if stamps.size and np.mean(good) < 1:
        _note_uncovered(good, time, findings)
    rows = Rows(time, signals, units, samples=samples)
    return rows.take(good)


def _carried(
    name: str, one: Series, values: Array, stamps: Stamps, origin: int, edges: Array
) -> Array:
    if one.stamps.size == 0:
        return np.full(stamps.size, np.nan)
    if np.array_equal(one.stamps, stamps):
        return values
    return resample(name, (one.stamps - origin) / 1e9, values, edges)


def _is_reference(one: Series) -> bool:
    return all(role_of(name) is Role.STEPPED for name in one.signals)


def _idle(signals: Mapping[str, Array], away: Mask) -> bool:
    """Tell if nothing drove the motor at those rows, as before its controller was started."""
    inputs = [values for name, values in signals.items() if role_of(name) is Role.INPUT]
    if not inputs or away.all():
        return False
    return all(np.std(u[away]) <= IDLE * np.std(u[~away]) for u in inputs)


def _edges(time: Array) -> Array:
    """Start of every row and end of the last; a row does not reach over a gap."""
    if time.size < 2:
        return np.append(time, time[-1:] + 1e-3)
    step = np.median(np.diff(time)) * (1 - 1e-6)  # so that rounding takes in no next sample
    return np.append(time, time[-1] + step)


def _covered(one: Series, stamps: Stamps) -> Mask:
    """Rows of the base for which a topic has something to say."""
    own = one.stamps
    if own.size == 0:
        return np.zeros(stamps.size, dtype=bool)
    before = np.clip(np.searchsorted(own, stamps, side='right') - 1, 0, None)
    after = np.clip(np.searchsorted(own, stamps, side='left'), None, own.size - 1)
    reach = gap_limit((own - own[0]) / 1e9) * 1e9
    held = all(role_of(name) is not Role.MEASURED for name in one.signals)
    started = stamps >= own[0]
    if held and not is_regular(own):
        return np.asarray(started, dtype=bool)  # sent on change: it holds until the next one
    if held:
        return np.asarray(started & (stamps - own[before] <= reach), dtype=bool)
    return np.asarray(
        started & (stamps <= own[-1]) & (own[after] - own[before] <= reach), dtype=bool
    )


def is_regular(stamps: Stamps) -> bool:
    """Tell whether messages with these stamps (ns) are sent at a rate."""
    steps = np.diff(stamps)
    return steps.size > 2 and bool(np.quantile(steps, 0.9) < REGULAR * np.median(steps))


def _how_joined(one: Series, clock: Series) -> Finding:
    exact = float(np.mean(np.isin(clock.stamps, one.stamps)))
    nearest = np.searchsorted(one.stamps, clock.stamps, side='right') - 1
    lag = np.median(clock.stamps - one.stamps[np.clip(nearest, 0, None)]) / 1e9
    how = 'held' if all(role_of(n) is not Role.MEASURED for n in one.signals) else 'interpolated'
    return Finding(
        Severity.INFO, 'topics_joined',
        f'{one.topic} ({one.stamps.size} samples) was joined on the stamps of {clock.topic} '
        f'({clock.stamps.size}): {exact:.0%} match exactly, the others are {how}; the one '
        f'before is {lag * 1e3:.3g} ms old',
        'what it did between two samples is known less well',
        'publish both with the same stamp if they come from the same cycle',
        {'exact_share': exact, 'age_s': float(lag)},
    )  # fmt: skip


def _left_out(one: Series, share: float) -> Finding:
    return Finding(
        Severity.INFO, 'reference_left_out',
        f'{one.topic} covers {share:.0%} of the time only and was left out',
        '', '', {'share': share},
    )  # fmt: skip


def _note_uncovered(good: Mask, time: Array, findings: list[Finding]) -> None:
    """Note rows that are lost because not every topic covers them."""
    inside = np.flatnonzero(good)
    ends = good.size - (inside[-1] - inside[0] + 1) if inside.size else good.size
    lost = int(np.sum(~good))
    share = lost / good.size
    if lost <= 2 or (share < 0.02 and lost == ends):
        return
    findings.append(
        Finding(
            Severity.WARNING if share > 0.1 or lost > ends else Severity.INFO, 'topics_overlap',
            f'{lost} of {good.size} rows ({share:.1%}) are not covered by every topic; left out',
            'the record is shorter, or has gaps where a topic was silent',
            'start the recorder after the nodes; look for messages lost on the way',
            {'rows': lost, 'first_s': float(time[int(np.argmin(good))])},
        )
    )  # fmt: skip
