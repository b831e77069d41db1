"""How the coefficients of one linear equation are learned, sample by sample: a rule a file."""
