"""Measured signals: the `Record`, its units and the data doctor."""

from motor_sysid.signals.record import Provenance, Record

__all__ = ['Provenance', 'Record']
