"""Calibration: how much evidence noise alone makes, by complete-model runs of the own motor.

In reading order: `situation` (what a calibration is valid for), `noise`, `mixture`, `controller`,
`twin` (a motor like the own one, complete by construction), `spectrum`, `null` (what a search
finds in its runs), `tail` (the quantile), `calibration`, `store`.
"""
