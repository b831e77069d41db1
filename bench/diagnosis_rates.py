"""The figures of docs/benchmark.md, from the results of the benchmark of the diagnosis.

FILE=bench/results/present_6900.jsonl
.venv/bin/motor-sysid benchmark diagnosis --seed 6900 --no-peers --results $FILE
.venv/bin/python bench/diagnosis_rates.py $FILE --prefix 'present ' --markdown docs/benchmark.md

The page holds the tables of a long run of an earlier state of the program, and between marks that
begin with `present` some of a shorter one of the present state.  The table of the other methods is
made where `bench/diagnosis_peers.py` has asked them.
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
    parser.add_argument('--prefix', default='', help='what the marks of the tables begin with')
    args = parser.parse_args()
    _, results = merged(args.results)
    for name, make in TABLES.items():
        table = make(results)
        if not table.rows:
            continue
        mark = f'{args.prefix}{name}'
        if args.markdown and f'<!-- {mark} -->' in args.markdown.read_text(encoding='utf-8'):
            text = filled(args.markdown, mark, shown(table))
            args.markdown.write_text(text, encoding='utf-8')
        elif not args.markdown:
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
