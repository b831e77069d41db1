"""Compare the stamps of topics with their reception: wrong clocks, drift, missing stamps."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from motor_sysid.recording.align import Series
from motor_sysid.signals.finding import Finding, Severity

LEAST = 2e-3
"""Differences of clocks below this (s) drown in the transport delay."""
FASTEST = 0.05
"""Quantile of the delays that is taken as the delay without waiting."""


@dataclass(frozen=True)
class Delay:
    """Time from the stamp to the reception of one topic.

    Attributes
    ----------
    topic:
        Its name.
    least:
        Delay without waiting, s; negative if the stamp lies in the recorder's future.
    drift:
        Its change over the record, s.
    step:
        Median step between stamps, s.
    wait:
        Median time that messages waited beyond the least delay, s: on a machine that cannot keep
        up they wait long, and each topic as it comes.
    """

    topic: str
    least: float
    drift: float
    step: float
    wait: float


def delay_of(series: Series) -> Delay | None:
    """Return the delay of a topic, or None if there are too few messages to tell."""
    if series.stamps.size < 20 or not series.stamped:
        return None
    delay = (series.received - series.stamps) / 1e9
    halves = np.array_split(delay, 2)
    low = [float(np.quantile(half, FASTEST)) for half in halves]
    step = float(np.median(np.diff(series.stamps))) / 1e9
    wait = max(float(np.median(half)) - least for half, least in zip(halves, low, strict=True))
    return Delay(series.topic, min(low), 2 * (low[1] - low[0]), step, wait)


def clock_findings(series: Sequence[Series]) -> list[Finding]:
    """Tell whether topics were stamped by clocks that differ or drift apart."""
    delays = [delay for one in series if (delay := delay_of(one))]
    if not delays:
        return []
    findings = []
    first = min(delays, key=lambda delay: delay.least)
    last = max(delays, key=lambda delay: delay.least)
    apart = last.least - first.least
    least = max(LEAST, first.step, max(delay.wait for delay in delays))
    if apart > least:
        findings.append(
            Finding(
                Severity.WARNING, 'clock_skew',
                f'measured by their reception, the stamps of {last.topic} are '
                f'{apart * 1e3:.3g} ms older than those of {first.topic}',
                'the data shows a delay between voltage and response that the motor does not have',
                'synchronise the clocks, or stamp both where they are received (`stamp: receive`)',
                {'skew_s': apart},
            )
        )  # fmt: skip
    slow, fast = min(d.drift for d in delays), max(d.drift for d in delays)
    if fast - slow > least:
        findings.append(
            Finding(
                Severity.WARNING, 'clock_drift',
                f'the clocks of the topics drift apart by {(fast - slow) * 1e3:.3g} ms over the '
                'record',
                'the delay between voltage and response changes over the record',
                'synchronise the clocks (chrony, PTP), or stamp where the messages are received',
                {'drift_s': fast - slow},
            )
        )  # fmt: skip
    return findings
