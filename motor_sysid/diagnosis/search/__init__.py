"""The search: fit a model, refit it with each promising candidate, gate, add, prune, go on.

In reading order: `standstill`, `motor_kind` (what records allow), `rotor_axes` (d and q of
phases), `held_back`, `refusals`, `speed_sensors`, `bench` (records and scales), `ready` (what fits
begin with), `moments`, `rung` (a fitted model), `sense` (whether what a fit made of an effect
makes any), `gain` (by how much errors fall), `gates` (whether that is real), `trial` (a candidate
after its refit), `starts`, `grid_starts`, `refit`; `confusable`, `synonyms` and `ranking` (who
wins a round, and who does as well); `further` (what is tried where nothing helps), `lacking` (what
follows what equations lack), `rounds`; what a climb by single effects misses: `step_ahead`,
`pairs`, `exchange`; `prune`; how exact a fit is: `edges`, `delay_profile`, `valleys`,
`standard_errors`, `feedback` (of a controller), `pits`, `strides`, `delay_walk`,
`integration_steps`; what is done to a finished ladder: `needless`, `polish`, `retelling`; and what
is not the same in all records: `may_differ`, `by_record`.
"""
