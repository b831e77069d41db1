"""Motors of one type, side by side: which of them is not like the others, and in what.

`folder` finds the recordings of each motor, `survey` diagnoses each, agrees on one model for all
and fits it to each.  `odd` says which of many values lie where the others do not, `spread` asks it
of every parameter.  `document` is the result as JSON, `picture` as a page.
"""

from motor_sysid.fleet.folder import motors_in
from motor_sysid.fleet.odd import FEWEST, odd_ones
from motor_sysid.fleet.spread import Spread, spreads
from motor_sysid.fleet.survey import Fleet, Member, Question, survey

__all__ = [
    'FEWEST', 'Fleet', 'Member', 'Question', 'Spread', 'motors_in', 'odd_ones', 'spreads',
    'survey',
]  # fmt: skip
