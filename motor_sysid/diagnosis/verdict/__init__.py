"""What a finished ladder says, with evidence and in plain words; no fit is changed here.

In reading order: `left_over` (what a model leaves), `verdict` (the rules), `evidence` (steps and
candidates with their curves), `proof` (what speaks for the effects that were added), `blind_spots`
(what the excitation hides), `between_records` (what is not the same in all of them), `words`, and
`explain`, which puts it all together; `at_rest`, where the motor stands still.
"""
