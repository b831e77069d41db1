"""Online identification of perturbed motors: compare, diagnose, add the missing effect."""

__version__ = '0.1.0'
