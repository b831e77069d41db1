"""Condition monitoring: which parameter has moved against a reference, and what may be why."""

from motor_sysid.diagnosis.condition.days import Condition, conditions
from motor_sysid.diagnosis.condition.watch import Watch

__all__ = ['Condition', 'Watch', 'conditions']
