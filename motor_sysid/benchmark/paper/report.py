"""The benchmark as tables: what the terminal, the page and the JSON file show."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from scipy.stats import mannwhitneyu

from motor_sysid.benchmark.paper.fitting import told_by
from motor_sysid.benchmark.paper.gates import Gate, gates
from motor_sysid.benchmark.paper.methods import METHODS
from motor_sysid.benchmark.paper.motor import HiddenRun, MotorRun
from motor_sysid.benchmark.paper.motor import TRUE as MOTOR
from motor_sysid.benchmark.paper.plant import seen, TRUE
from motor_sysid.benchmark.paper.published import CLOSED, ESTIMATES, OPEN, VALIDATION
from motor_sysid.benchmark.paper.runs import grouped, Run, study_key
from motor_sysid.benchmark.paper.statements import statements
from motor_sysid.benchmark.paper.studies import NOISE, READINGS, record, RECORDS, unseen
from motor_sysid.benchmark.tables import Cell, Table
from motor_sysid.signals.metrics import metrics

SCHEMA = 'motor_sysid/paper_benchmark/1'

CLOSE, EXACT = 5.0, 0.1
"""Worst errors under which a run counts as near, and as right, percent."""


@dataclass(frozen=True)
class Results:
    """Everything that ran."""

    runs: Sequence[Run]
    motors: Sequence[MotorRun] = ()
    hidden: Sequence[HiddenRun] = ()


def tables(results: Results) -> list[Table]:
    """Return every table that has rows."""
    every = [
        gate_table(results),
        statement_table(),
        *(reading_table(key, results.runs) for key in READINGS),
        estimate_table(results.runs),
        validation_table(results.runs),
        *(record_table(key, results.runs) for key in RECORDS),
        bound_table(results.runs),
        motor_table(results.motors),
    ]
    return [table for table in every if table.rows]


def gate_table(results: Results) -> Table:
    """Return the gates."""
    rows = [
        (Cell(g.title), _verdict(g), *_cells(g.goal, g.measured, g.note))
        for g in gates(results.runs, results.motors, results.hidden)
    ]  # fmt: skip
    return Table(
        'Gates', 'What was set before, and what came out; few runs are no verdict.',
        ('what', 'verdict', 'goal', 'measured', 'note'), tuple(rows),
    )  # fmt: skip


def _verdict(gate: Gate) -> Cell:
    if gate.few:
        return Cell('few runs', 'soft', 0.35)
    return Cell('pass' if gate.passed else 'FAIL', 'good' if gate.passed else 'bad', 0.35)


def statement_table() -> Table:
    """Return what has to be said of the paper's set-up."""
    rows = tuple(_cells(*one) for one in statements())
    return Table('The set-up, read plainly', 'Computed, not quoted, where there is a number.',
                 ('what', 'fact'), rows)  # fmt: skip


def reading_table(key: str, runs: Sequence[Run]) -> Table:
    """Return one reading: ITAE over seeds beside the paper's column."""
    groups = {m: g for (s, m), g in grouped(list(runs)).items() if s == key}
    printed = OPEN if key == 'R1' else CLOSED
    rows = []
    for method in METHODS:
        if method not in groups:
            continue
        group, column = groups[method], METHODS[method].column
        values = np.array([r.itae for r in group])
        paper = printed.get(column) if key != 'R3' and not method.endswith('polished') else None
        rows.append(_cells(
            METHODS[method].title, *map(_short, (values.mean(), values.min(), np.median(values),
            np.quantile(values, 0.95), values.std(ddof=1) if values.size > 1 else 0.0)),
            _short(np.median([r.worst for r in group])), _share(group, CLOSE),
            _share(group, EXACT), f'{sum(r.on_bound for r in group)}', _rank(group, groups),
            f'{np.median([r.simulations for r in group]):.0f}',
            f'{np.median([r.seconds for r in group]):.2f}',
            f'{paper.mean:.4g} / {paper.least:.3g}'.replace('nan', '?') if paper else '',
            f'{paper.seconds:.0f}' if paper else '',
        ))  # fmt: skip
    return Table(
        READINGS[key].title,
        f'ITAE over the seeds, as in Table 4; worst error of a0, a1, b (over a2) and tau; runs '
        f'within {CLOSE:g} % and {EXACT:g} %; runs that end on a wall of the box; p of a rank '
        'test against PSO (Mann-Whitney, two-sided); the last columns are printed there.',
        ('method', 'mean', 'min', 'median', 'p95', 'std', 'worst %', f'< {CLOSE:g} %',
         f'< {EXACT:g} %', 'wall', 'p', 'simulations', 's', 'paper mean / min', 'paper s'),
        tuple(rows),
    )  # fmt: skip


def estimate_table(runs: Sequence[Run]) -> Table:
    """Return the errors of the printed estimates in what can be identified, and of ours."""
    true, fresh = seen(TRUE), READINGS['R1'].study()
    rows = []
    for name, candidate in ESTIMATES.items():
        errors = 100 * (seen(np.array(candidate)) / true - 1)
        again = metrics(fresh.measured, fresh.simulate(np.array([candidate]))[0], fresh.time).itae
        rows.append(_cells(f'printed: {name}', *(f'{e:+.0f} %' for e in errors), _short(again)))
    groups = grouped(list(runs))
    for method in ('pso', 'gwo', 'ba', 'ga', 'pso_polished', 'best'):
        group = groups.get(('R1', method), [])
        if group:
            best = min(group, key=lambda r: r.itae)
            rows.append(_cells(f'here, best of {len(group)}: {METHODS[method].title}',
                               *(f'{100 * e:+.2g} %' for e in best.errors),
                               _short(best.itae)))  # fmt: skip
    return Table(
        'Estimates, as in Table 5',
        'Errors of the four numbers that records hold; raw parameters have a free common factor. '
        'The last column is the open-loop ITAE over 10 s of each set: those printed there do not '
        'have the ITAE that Table 4 says they have.',
        ('set', 'a0/a2', 'a1/a2', 'b/a2', 'tau', 'ITAE'), tuple(rows),
    )  # fmt: skip


def validation_table(runs: Sequence[Run]) -> Table:
    """Return errors on steps that were not fitted."""
    fresh, rows = unseen(), []
    for name, candidate in ESTIMATES.items():
        found = metrics(fresh.measured, fresh.simulate(np.array([candidate]))[0], fresh.time)
        column, way = name.split()
        printed = VALIDATION[column][way == 'CL']
        rows.append(_cells(f'printed: {name}', _short(found.itae), '', f'{found.fit_percent:.1f}',
                           _short(printed)))  # fmt: skip
    for (study, method), group in sorted(grouped(list(runs)).items()):
        if study in ('R1', 'R2', 'D2@30'):
            values = [r.unseen_itae for r in group]
            rows.append(_cells(
                f'{study}: {METHODS[method].title}', _short(np.median(values)),
                _short(np.quantile(values, 0.95)),
                f'{np.median([r.unseen_fit for r in group]):.5g}', '',
            ))  # fmt: skip
    return Table(
        'Validation, as in Table 6',
        'ITAE and fit over 30 s on six levels that were not fitted, without noise: the sets that '
        'the paper prints, and medians over seeds here.  The input of Table 6 is not printed.',
        ('set', 'ITAE', 'p95', 'fit %', 'paper'), tuple(rows), wide=True,
    )  # fmt: skip


def record_table(key: str, runs: Sequence[Run]) -> Table:
    """Return the worst errors on one record over noise."""
    groups, rows = grouped(list(runs)), []
    for method in METHODS:
        columns = [groups.get((study_key(key, db), method), []) for db in (None, *NOISE)]
        if any(columns):
            texts = [
                f'{_short(np.median(w))} ({_short(np.quantile(w, 0.95))})' if w else ''
                for w in ([r.worst for r in group] for group in columns)
            ]
            every = [r for group in columns for r in group]
            rows.append(_cells(METHODS[method].title, *texts, _share(every, CLOSE),
                               f'{np.median([r.seconds for r in every]):.2f}'))  # fmt: skip
    return Table(
        RECORDS[key], 'Worst error of a0, a1, b and tau in percent, median (95th percentile).',
        ('method', 'no noise', *(f'{db} dB' for db in NOISE), f'< {CLOSE:g} %', 's'), tuple(rows),
    )  # fmt: skip


def bound_table(runs: Sequence[Run]) -> Table:
    """Return Cramer-Rao bounds, and errors of the recommended fit over them."""
    groups, rows, true = grouped(list(runs)), [], seen(TRUE)
    for data in RECORDS:
        for decibel in NOISE:
            group = groups.get((study_key(data, decibel), 'best'), [])
            if group:
                study = record(data, decibel, 0)
                bounds = 100 * told_by(study, TRUE, study.sigma).bound / true
                ratios = np.sqrt(np.mean(np.array([r.scores for r in group]) ** 2, axis=0))
                held = 100 * np.mean([r.covered for r in group])
                rows.append(_cells(
                    f'{data} at {decibel} dB', *(f'{b:.3g} %' for b in bounds),
                    ' '.join(f'{x:.2f}' for x in ratios), f'{held:.0f} %',
                ))  # fmt: skip
    return Table(
        'Cramer-Rao bounds',
        'Smallest standard deviations that an unbiased estimate can have; RMS errors of the '
        'recommended fit over them; how often its 95 % intervals hold the truth.',
        ('record', 'a0', 'a1', 'b', 'tau', 'RMS over bound', 'intervals'), tuple(rows),
    )  # fmt: skip


def motor_table(motors: Sequence[MotorRun]) -> Table:
    """Return the fits of the physically consistent motor."""
    rows = []
    for decibel in NOISE:
        group = [r for r in motors if r.decibel == decibel]
        if group:
            rms = 100 * np.sqrt(np.mean(np.array([r.errors for r in group]) ** 2, axis=0))
            ratio = np.sqrt(np.mean(np.array([r.scores for r in group]) ** 2))
            rows.append(_cells(
                f'{decibel} dB', *(f'{x:.2g} %' for x in rms), f'{ratio:.2f}',
                f'{100 * np.mean([r.covered for r in group]):.0f} %',
                f'{np.median([r.seconds for r in group]):.2f}',
            ))  # fmt: skip
    return Table(
        'A motor that could exist, with its current measured',
        "K_t = K_e = sqrt(3), the same poles and delay; RMS errors of `refit` with the package's "
        'own model from values that are wrong by factors of up to three.',
        ('noise', *MOTOR, 'RMS over bound', 'intervals', 's'), tuple(rows),
    )  # fmt: skip


def as_dict(results: Results) -> dict[str, object]:
    """Return everything for a JSON file."""
    found = gates(results.runs, results.motors, results.hidden)
    return {
        'schema': SCHEMA,
        'gates': [asdict(g) for g in found],
        'passed': sum(g.passed and not g.few for g in found),
        'statements': [list(one) for one in statements()],
        'runs': [{**asdict(r), 'worst_percent': r.worst} for r in results.runs],
        'motor': [asdict(r) for r in results.motors],
        'hidden': [asdict(r) for r in results.hidden],
    }


def _cells(*texts: str) -> tuple[Cell, ...]:
    return tuple(Cell(text) for text in texts)


def _short(value: float | np.floating) -> str:
    return f'{float(value):.3g}'


def _share(group: Sequence[Run], percent: float) -> str:
    return f'{sum(r.worst <= percent for r in group)}/{len(group)}'


def _rank(group: Sequence[Run], groups: dict[str, list[Run]]) -> str:
    """Return p of a rank test against PSO."""
    other = groups.get('pso', [])
    if not other or group is other or len(group) < 3:
        return ''
    p = mannwhitneyu([r.itae for r in group], [r.itae for r in other]).pvalue
    return f'{p:.2g}'
