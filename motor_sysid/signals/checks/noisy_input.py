"""Noise of a voltage that does not act."""

from collections.abc import Iterator, Sequence

from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.noisy_input import noisy_inputs_of
from motor_sysid.signals.record import Record


def check(records: Sequence[Record]) -> Iterator[Finding]:
    """Look for noise of a measured voltage that the current does not answer to."""
    for found in noisy_inputs_of([record.uniform() for record in records]):
        yield Finding(
            Severity.WARNING, 'noisy_voltage', str(found),
            'a fit and a diagnosis smooth it between its steps; all else takes it for what drives '
            'the motor, and an estimator is biased by it',
            'record the voltage that was commanded, or duty cycle and supply voltage',
            {'noise_V': found.sigma},
        )  # fmt: skip
