"""`motor-sysid check`: look data over before it is used."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from motor_sysid.cli.common import add_data_arguments
from motor_sysid.cli.output import write_json
from motor_sysid.cli.reading import load_sheet

if TYPE_CHECKING:
    from motor_sysid.recording import Loaded
    from motor_sysid.signals.finding import Finding

HELP = 'look data over: rate, gaps, units, signs, excitation; each finding with its remedy'
SCHEMA = 'motor_sysid/check/1'
STYLES = {'error': 'bold red', 'warning': 'yellow', 'info': 'dim'}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
    add_data_arguments(parser)
    parser.add_argument(
        '--nominal', type=Path, metavar='DATASHEET',
        help='data sheet (YAML); its torque constant tells a speed in rpm where nothing else can',
    )  # fmt: skip
    parser.add_argument('-q', '--quiet', action='store_true', help='errors and warnings only')


def run(args: argparse.Namespace) -> int:
    """Check each DATA, print what was found; 2 if any of it is unusable."""
    from motor_sysid.recording import load
    from motor_sysid.signals.doctor import by_severity, examine

    sheet = load_sheet(args.nominal)
    k_e = sheet.k_e if sheet else None
    documents, errors = [], 0
    for path in args.data:
        loaded = load(path, args.msg_config)
        findings = by_severity([*loaded.findings, *examine(loaded.records, k_e)])
        errors += sum(finding.severity == 'error' for finding in findings)
        documents.append(_document(loaded, findings))
        _show(loaded, [f for f in findings if not (args.quiet and f.severity == 'info')])
        print(_verdict(findings))
    write_json({'schema': SCHEMA, 'data': documents}, args.json)
    return 2 if errors else 0


def _document(loaded: 'Loaded', findings: Sequence['Finding']) -> dict[str, object]:
    """Return the result for one DATA as plain types."""
    return {
        'source': loaded.source,
        'usable': all(finding.severity != 'error' for finding in findings),
        'signals': {
            name: {'unit': loaded.records[0].units[name], 'from': loaded.origins.get(name, '')}
            for name in loaded.records[0]
        },
        'records': [
            {
                'samples': len(record), 'start_s': float(record.time[0]),
                'duration_s': record.duration, 'dt_s': record.dt, 'sha256': record.digest(),
                'notes': list(record.provenance.notes),
            }
            for record in loaded.records
        ],
        'findings': [finding.to_dict() for finding in findings],
    }  # fmt: skip


def _show(loaded: 'Loaded', findings: Sequence['Finding']) -> None:
    """Print signals and findings, as tables on a terminal that can, else as plain text."""
    try:
        from rich.console import Console
    except ImportError:
        _show_plain(loaded, findings)
        return
    console = Console()
    if console.is_terminal:
        _show_rich(console, loaded, findings)
    else:
        _show_plain(loaded, findings)


def _ranges(loaded: 'Loaded') -> list[tuple[str, str, str, str]]:
    """Signal, its range over all records, its unit, and where it came from."""
    rows = []
    for name in loaded.records[0]:
        low = min(float(r[name].min()) for r in loaded.records if name in r)
        high = max(float(r[name].max()) for r in loaded.records if name in r)
        unit = loaded.records[0].units[name]
        rows.append((name, f'{low:.5g} to {high:.5g}', unit, loaded.origins.get(name, '')))
    return rows


def _show_plain(loaded: 'Loaded', findings: Sequence['Finding']) -> None:
    print(loaded.source)
    for name, span, unit, origin in _ranges(loaded):
        print(f'  {name:<20}{span:>24} {unit:<7}{origin}')
    for finding in findings:
        print(f'{finding.severity:<8} {finding.code}: {finding.message}')
        if finding.consequence:
            print(f'         then: {finding.consequence}')
        if finding.remedy:
            print(f'         do: {finding.remedy}')


def _show_rich(console: object, loaded: 'Loaded', findings: Sequence['Finding']) -> None:
    from rich.console import Console
    from rich.table import Table

    assert isinstance(console, Console)
    console.print(_literal(loaded.source), style='bold')
    signals = Table('signal', 'range', 'unit', 'from')
    for row in _ranges(loaded):
        signals.add_row(*map(_literal, row))
    console.print(signals)
    table = Table('', 'found', 'consequence', 'what to do', show_lines=True)
    for finding in findings:
        style = STYLES[finding.severity.value]
        name = f'[{style}]{finding.severity.value}[/]\n{finding.code}'
        table.add_row(name, *map(_literal, (finding.message, finding.consequence, finding.remedy)))
    console.print(table)


def _literal(text: str) -> str:
    """Protect square brackets (units, fields) from being read as markup."""
    from rich.markup import escape

    return escape(text)


def _verdict(findings: Sequence['Finding']) -> str:
    errors = sum(finding.severity == 'error' for finding in findings)
    warnings = sum(finding.severity == 'warning' for finding in findings)
    counted = f'{errors} error{"s" * (errors != 1)}, {warnings} warning{"s" * (warnings != 1)}'
    if errors:
        return f'not usable as it is: {counted}'
    return f'usable: {counted}' if warnings else 'usable: nothing to complain about'


