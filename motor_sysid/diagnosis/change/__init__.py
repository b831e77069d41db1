"""Since when a model no longer holds.

In reading order: `change_point` (the moment at which errors become larger or smaller, at a stated
false-alarm rate), `until_when` (until when a model held, from fits to either end of a record).
"""
