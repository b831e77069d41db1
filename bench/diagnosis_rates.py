"""The figures of docs/benchmark.md, from the results of the benchmark of the diagnosis.

FILE=bench/results/diagnosis_6800.jsonl
.venv/bin/motor-sysid benchmark diagnosis --seed 6800 --no-peers --results $FILE
.venv/bin/python bench/diagnosis_rates.py $FILE --markdown docs/benchmark.md

The table of the other methods is made where `bench/diagnosis_peers.py` has asked them.
"""

import argparse
from pathlib import Path
import sys

from pages import filled, markdown

from motor_sysid.benchmark.outcome import Result
from motor_sysid.benchmark.store import merged
from motor_sysid.benchmark.tables import (
    effect_table,
    leakage_table,
    peer_table,
    rate_table,
    Table,
    time_table,
)
from motor_sysid.benchmark.targets import visible

TABLES = {
    'rates': rate_table,
    'effects': effect_table,
    'peers': peer_table,
    'times': time_table,
    'base parameters': lambda every: leakage_table([r for r in every if is_large(r)]),
}
"""Mark in the page to table."""


def main() -> int:
    """Print the tables, or put them where the page has them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('results', nargs='+', type=Path, help='results files')
    parser.add_argument('--markdown', type=Path, metavar='FILE', help='page to bring up to date')
    args = parser.parse_args()
    _, results = merged(args.results)
    for name, make in TABLES.items():
        table = make(results)
        if not table.rows:
            continue
        if args.markdown:
            text = filled(args.markdown, name, shown(table))
            args.markdown.write_text(text, encoding='utf-8')
        else:
            print(f'{shown(table)}\n')  # noqa: T201
    return 0


def is_large(result: Result) -> bool:
    """Whether a single effect of 10 % was hidden, one that its records show."""
    return result.category == 'single' and result.size > 0.05 and visible(result)


def shown(table: Table) -> str:
    """Return a table in Markdown, rows without a case left out."""
    rows = ([cell.text for cell in row] for row in table.rows)
    return markdown(table.head, (row for row in rows if row[1] != '0'))


if __name__ == '__main__':
    sys.exit(main())
