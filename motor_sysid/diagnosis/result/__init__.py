"""What a diagnosis says: values that the other rooms fill in, and the same values as JSON.

Nothing is estimated here.  In reading order: `curves` (what is drawn of a diagnosis), `findings`
(unknowns, evidence, blind spots, rivalries, differences), `threshold` (what was asked of
evidence), `result` (verdict, candidates, steps, and the diagnosis that holds them all), `names`
(names in a sentence), `figures` (numbers with their units), `plain`, `findings_json` and
`document` (the JSON).
"""
