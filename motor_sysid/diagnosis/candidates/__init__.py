"""What could be missing: every effect in every shape, scored at once without a refit.

In reading order: `variants` (effects with each choice of their shape), `columns` (what a touch of
each does to the outputs), `reference_rhythm`, `turns`, `matched_filter` and `proposals` (values of
shapes that the data propose), `left_noise` (the noise that all of them
leave), `score` (which of them explains what is left).
"""
