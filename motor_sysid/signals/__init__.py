"""Measured signals: the `Record`, its units and the data doctor."""

from motor_sysid.signals.finding import Finding, Severity
from motor_sysid.signals.record import Provenance, Record

__all__ = ['Finding', 'Provenance', 'Record', 'Severity']
