"""Ask the other methods about cases that the diagnosis benchmark ran without them.

.venv/bin/pip install 'pysindy>=2.0'
.venv/bin/python bench/diagnosis_peers.py bench/results/earlier_6900.jsonl --cases 200

The records are drawn again from the seed of the results file, which is written anew after every
case.
"""

import argparse
from collections.abc import Mapping
from dataclasses import replace
import json
from pathlib import Path
import sys

from motor_sysid.benchmark import workers
from motor_sysid.benchmark.cases import draw
from motor_sysid.benchmark.diagnosis import asked, Task, TIME_LIMIT
from motor_sysid.benchmark.outcome import Named, Result
from motor_sysid.benchmark.peers import PEERS
from motor_sysid.benchmark.scenarios import named_case
from motor_sysid.benchmark.store import ResultsFile


def main() -> int:
    """Ask, and keep what they say beside what the diagnosis said."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('results', type=Path, help='results file')
    parser.add_argument('--cases', type=int, default=200, help='of its first ones')
    parser.add_argument('--workers', type=int, default=1, help='processes')
    args = parser.parse_args()
    for peer in PEERS.values():
        if peer.lacks:
            print(f'{peer.title} is left out: {peer.lacks}')  # noqa: T201
    peers = tuple(name for name, peer in PEERS.items() if not peer.lacks)
    head, results = ResultsFile.read(args.results)
    first = list(results.values())[: args.cases]
    tasks = [
        Task(one.case, int(str(head['seed'])), peers)
        for one in first
        if set(peers) - set(one.peers or {})
    ]
    for done, (task, said) in enumerate(
        workers.each(tasks, ask, workers=args.workers, limit=TIME_LIMIT), start=1
    ):
        if isinstance(said, workers.Lost):
            said = {name: Named((), said.seconds, said.reason) for name in task.peers}
        known = results[task.case]
        results[task.case] = replace(known, peers={**(known.peers or {}), **said})
        write(args.results, head, results)
        print(f'{done} of {len(tasks)}: {task.case}', flush=True)  # noqa: T201
    return 0


def ask(task: Task) -> Mapping[str, Named]:
    """Return what each peer names."""
    scenario, number = named_case(task.case)
    return asked(task.peers, draw(scenario, task.seed, number))


def write(path: Path, head: Mapping[str, object], results: Mapping[str, Result]) -> None:
    """Replace a results file; it is whole at any time."""
    lines = [head, *(one.as_dict() for one in results.values())]
    fresh = path.with_suffix('.part')
    fresh.write_text(''.join(json.dumps(line) + '\n' for line in lines), encoding='utf-8')
    fresh.replace(path)


if __name__ == '__main__':
    sys.exit(main())
