"""The data doctor: what is wrong, doubtful or missing in records, and what to do about it."""

from collections.abc import Iterable, Sequence

from motor_sysid.errors import UserError
from motor_sysid.signals.checks import (
    dynamics,
    encoder,
    excitation,
    jumps,
    noisy_input,
    phases,
    plausibility,
    signs,
    strays,
    timing,
    updates,
    values,
)
from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.noisy_input import told_noisy_inputs
from motor_sysid.signals.record import Record
from motor_sysid.signals.slow_updates import told_slow
from motor_sysid.signals.strays import told_strays


def examine(records: Record | Sequence[Record], k_e: float | None = None) -> tuple[Finding, ...]:
    """Look records of one motor over.

    Parameters
    ----------
    records:
        One record or several.
    k_e:
        Back-EMF constant from the data sheet in V s/rad, if known: tells a speed in rpm where
        neither position nor encoder steps can.

    Returns
    -------
    tuple[Finding, ...]
        Errors first, then warnings, then what is good to know.
    """
    every = [records] if isinstance(records, Record) else list(records)
    if not every:
        raise UserError('there is no record to examine')
    if absurd := [*timing.absurd(every)]:
        return by_severity(absurd)
    findings = [*values.check(every)]
    if not any(finding.code == 'non_finite' for finding in findings):
        for check in (
            encoder.check, excitation.check, dynamics.check, phases.check, jumps.check,
            strays.check, updates.check, noisy_input.check, signs.check,
        ):  # fmt: skip
            findings += check(every)
        findings += plausibility.check(every, k_e)
    findings += timing.check(every)
    return by_severity(findings)


def seen_by_fits(records: Sequence[Record]) -> tuple[str, ...]:
    """Say what is odd about records as they were measured: what a fit mends, or takes for physics.

    Stray samples and noise of a voltage, which it does not see, and signals that are not new in
    every row.
    """
    even = [record.uniform() for record in records]
    return (*told_strays(records), *told_noisy_inputs(even), *told_slow(records))


def by_severity(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Sort findings, errors first; what repeats, or says less of the same, is left out."""
    order = [Severity.ERROR, Severity.WARNING, Severity.INFO]
    unique = {(finding.code, finding.message): finding for finding in findings}
    ranked = sorted(unique.values(), key=lambda finding: order.index(finding.severity))
    most = {finding.code: finding.severity for finding in reversed(ranked)}
    return tuple(finding for finding in ranked if finding.severity is most[finding.code])


def require_usable(findings: Iterable[Finding]) -> None:
    """Refuse data with an error.

    Raises
    ------
    UserError
        With message and remedy of each error.
    """
    errors = [finding for finding in findings if finding.severity is Severity.ERROR]
    if errors:
        raise UserError('; '.join(f'{error.message}: {error.remedy}' for error in errors))
