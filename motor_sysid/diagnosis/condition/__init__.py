"""Condition monitoring: which parameter has moved against a reference, and what may be why.

In reading order: `drift` (how far a parameter has moved), `causes` (the table of causes),
`likely` (which of them fit), `days` (one record after the other), `watch` (the same, live).
"""

from motor_sysid.diagnosis.condition.days import Condition, conditions
from motor_sysid.diagnosis.condition.watch import Watch

__all__ = ['Condition', 'Watch', 'conditions']
