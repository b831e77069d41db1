"""Where a model fails, and what the rest that it leaves looks like; no model is refitted here.

A model is compared with records, its errors are laid along axes, and what its equations lack is
read from the outputs.  In reading order: `axes`, `bands` (means with a band of noise),
`equation_errors` (what equations lack, from measured states), `unexplained` (the same from the
output error), `where` (errors along axes and on maps), `compare`; what a force that no effect of
the catalogue explains looks like: `shapes`, `orthogonal_rows`, `free_functions`, `unknown`; and
whether what is left is noise: `uneven_records`, `drift`, `spell`, `oscillation`,
`other_values`, `predictable`, `remainder`.
"""
