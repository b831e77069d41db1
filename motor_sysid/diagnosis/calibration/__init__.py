"""Calibration: how much evidence noise alone makes, by complete-model runs of the own motor."""
