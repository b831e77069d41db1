r"""The figures of docs/benchmark.md, from the results of the benchmark of the diagnosis.

FILE=bench/results/diagnosis_9500.jsonl
.venv/bin/motor-sysid benchmark diagnosis --seed 9500 --no-peers --results $FILE
.venv/bin/python bench/diagnosis_rates.py $FILE --markdown docs/benchmark.md
.venv/bin/python bench/diagnosis_rates.py bench/results/earlier_*.jsonl --seeds \
    --markdown docs/benchmark.md

With `--seeds` it is a column of rates for each file, and the table of the other methods on those
cases that `bench/diagnosis_peers.py` has asked them about.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys

from pages import filled, markdown

from motor_sysid.benchmark.outcome import Result
from motor_sysid.benchmark.store import merged, ResultsFile
from motor_sysid.benchmark.tables import (
    effect_table,
    leakage_table,
    peer_table,
    rate_table,
    Table,
    time_table,
)
from motor_sysid.benchmark.targets import rates, visible

TABLES = {
    'rates': rate_table,
    'effects': effect_table,
    'times': time_table,
    'base parameters': lambda every: leakage_table([r for r in every if is_large(r)]),
}
"""Mark in the page to table."""

SEEDS = {
    'complete: something missing': 'complete model: something is said to be missing',
    '1 %, visible: first': 'one effect, 1 %: named first, where visible',
    '3 %, visible: first': 'one effect, 3 %: named first, where visible',
    '10 %, visible: first': 'one effect, 10 %: named first, where visible',
    'a wrong name': 'effects in the catalogue: a wrong name',
    'two, visible: exact': 'two effects: exact set, where both are visible',
    'withheld: wrong neighbour': 'effect not in the catalogue: a wrong neighbour named',
    'within 5 % of the truth': 'after adding: held-out error within 5 % of the true structure',
    'intervals': 'effect parameters within their 95 % interval',
}
"""Rates of the table of seeds: its row to the title of the rate."""


def main() -> int:
    """Print the tables, or put them where the page has them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('results', nargs='+', type=Path, help='results files')
    parser.add_argument('--markdown', type=Path, metavar='FILE', help='page to bring up to date')
    parser.add_argument('--seeds', action='store_true', help='a column of rates for each file')
    args = parser.parse_args()
    for mark, text in tables(args.results, seeds=args.seeds).items():
        if args.markdown:
            page = filled(args.markdown, mark, text)
            args.markdown.write_text(page, encoding='utf-8')
        else:
            print(f'{text}\n')  # noqa: T201
    return 0


def tables(files: Sequence[Path], *, seeds: bool) -> dict[str, str]:
    """Return mark to table in Markdown."""
    _, results = merged(files)
    if seeds:
        return {'seeds': by_seed(files), 'peers': shown(peer_table(results))}
    made = {name: make(results) for name, make in TABLES.items()}
    return {name: shown(table) for name, table in made.items() if table.rows}


def by_seed(files: Sequence[Path]) -> str:
    """Return a table in Markdown with a column of rates for each results file."""
    head, columns = ['seed'], []
    for file in files:
        kept, by_name = ResultsFile.read(file)
        results = list(by_name.values())
        found = {rate.title: rate.share for rate in rates(results)}
        head.append(str(kept['seed']))
        shares = [found[title] for title in SEEDS.values()]
        columns.append([len(results), *(f'{one.count} of {one.total}' for one in shares)])
    names = ['cases', *SEEDS]
    rows = zip(names, *columns, strict=True)
    return markdown(head, ([str(cell) for cell in row] for row in rows))


def is_large(result: Result) -> bool:
    """Whether a single effect of 10 % was hidden, one that its records show."""
    return result.category == 'single' and result.size > 0.05 and visible(result)


def shown(table: Table) -> str:
    """Return a table in Markdown, rows without a case left out."""
    rows = ([cell.text for cell in row] for row in table.rows)
    return markdown(table.head, (row for row in rows if row[1] != '0'))


if __name__ == '__main__':
    sys.exit(main())
