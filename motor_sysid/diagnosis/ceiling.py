"""How much of the data a physical model explains, against what any model of a list explains.

Black-box structures are fitted to the first part of every record and run freely, from its start,
into the part that was held back; the physical model does the same with the parameters that it has.
What a signal's best structure explains of the held-back variance is the ceiling:

    share = mean over signals of explained(model) / mean over signals of max(explained(any))

A ceiling of a list is a lower bound: a structure that is not in it may reach higher.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motor_sysid.diagnosis.result.plain import number
from motor_sysid.diagnosis.search.bench import prepared
from motor_sysid.diagnosis.where.compare import channel_errors, compare
from motor_sysid.errors import UserError
from motor_sysid.estimation.batch import make_chain, observed_outputs
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.model import Model
from motor_sysid.signals.record import Record
from motor_sysid.structures import fit, KINDS, simulate

Array = NDArray[np.float64]

MODEL = 'model'
"""Key of the physical model among the structures."""

ROWS = 12_000
"""Rows of training data that structures look at; more cost minutes."""

_SHORTEST = 100


@dataclass(frozen=True)
class Explained:
    """One model on the held-back data.

    Attributes
    ----------
    key, title:
        Kind of structure, or `MODEL`.
    errors_percent, explained_percent:
        Signal to RMS error over RMS, and to the share of its variance that is explained.
    about:
        Order, sample time and limits, in words.
    """

    key: str
    title: str
    errors_percent: Mapping[str, float]
    explained_percent: Mapping[str, float]
    about: str


@dataclass(frozen=True)
class Ceiling:
    """A physical model against structures.

    Attributes
    ----------
    share_percent:
        What the model explains of what any of all explains, signals averaged.
    rows:
        The model, then the structures that could be fitted, the best first.
    best:
        Signal to the key of what explains most of it.
    reasons:
        Structures that could not be fitted, and why.
    """

    share_percent: float
    rows: tuple[Explained, ...]
    best: Mapping[str, str]
    reasons: tuple[str, ...]


def ceiling(
    model: Model,
    records: Sequence[Record],
    *,
    kinds: Sequence[str] = tuple(KINDS),
    hold_back: float = 0.2,
    progress: Callable[[str], None] | None = None,
) -> Ceiling:
    """Compare a model with structures on the held-back end of each record.

    Parameters
    ----------
    model:
        The physical model; it should have been fitted to no more than what is not held back.
    records:
        Data.
    kinds:
        Structures to try.
    hold_back:
        Part of each record that is judged.
    progress:
        Is told what is going on.

    Raises
    ------
    UserError
        If a kind is unknown or a record is too short.
    """
    if not 0 < hold_back < 1:
        raise UserError(f'hold_back {hold_back:g} is not between 0 and 1; try 0.2')
    tell = progress or (lambda text: None)
    evens = prepared(records, model.motor, model.parameters.values())
    outputs = observed_outputs(model.kind, evens)
    cuts = [round((1 - hold_back) * len(r)) for r in evens]
    left = [min(cut, len(r) - cut) for cut, r in zip(cuts, evens, strict=True)]
    if min(left) < _SHORTEST // 5:
        raise UserError(f'hold_back {hold_back:g} of these records leaves too little; record more')
    rows = [_model_row(model, evens, outputs, hold_back)]
    measured = [
        np.column_stack([r[name] for name in outputs])[cut:]
        for r, cut in zip(evens, cuts, strict=True)
    ]
    training = _training(evens, cuts)
    names = {input_signals(r, model.kind) for r in evens}
    inputs = sorted(names)[0]
    reasons = []
    for key in kinds:
        tell(f'fitting {KINDS[key].title if key in KINDS else key}')
        try:
            structure = fit(training, inputs, outputs, key)
        except UserError as problem:
            if key not in KINDS:
                raise
            reasons.append(f'{KINDS[key].title}: {problem}')
            continue
        errors = [
            m - simulate(structure, r)[cut:]
            for m, r, cut in zip(measured, evens, cuts, strict=True)
        ]
        orders = '/'.join(map(str, structure.orders))
        about = f'order {orders}, {structure.dt:.4g} s; {KINDS[key].limits}'
        rows.append(_row(key, KINDS[key].title, outputs, errors, measured, about))
    return _judged(rows, outputs, tuple(reasons))


def _training(evens: Sequence[Record], cuts: Sequence[int]) -> list[Record]:
    """Return what is not held back, of long records the last part before that."""
    share = min(1.0, ROWS / sum(cuts))
    parts = []
    for record, cut in zip(evens, cuts, strict=True):
        rows = max(round(share * cut), min(cut, _SHORTEST))
        parts.append(record.slice(cut - rows, cut))
    return parts


def _model_row(
    model: Model, evens: Sequence[Record], outputs: Sequence[str], hold_back: float
) -> Explained:
    chains = [
        make_chain(r, model.kind, outputs, train_fraction=1 - hold_back, scored='validate')
        for r in evens
    ]
    found = compare(model, chains, outputs)
    title = ' + '.join([model.kind.title, *model.effects])
    return _row(MODEL, title, outputs, found.residuals, found.measured, 'as given')


def _row(
    key: str, title: str, outputs: Sequence[str], left: Sequence[Array],
    measured: Sequence[Array], about: str,
) -> Explained:  # fmt: skip
    whole = np.concatenate(list(measured))
    spread = np.sum((whole - whole.mean(axis=0)) ** 2, axis=0)
    with np.errstate(over='ignore', invalid='ignore'):
        lost = np.sum(np.concatenate(list(left)) ** 2, axis=0)
        explained = 100 * (1 - lost / np.maximum(spread, 1e-300))
        errors = channel_errors(outputs, left, measured)
    explained = np.where(np.isfinite(explained), explained, -np.inf)
    return Explained(
        key, title, dict(zip(outputs, errors.tolist(), strict=True)),
        dict(zip(outputs, explained.tolist(), strict=True)), about,
    )  # fmt: skip


def _judged(rows: list[Explained], outputs: Sequence[str], reasons: tuple[str, ...]) -> Ceiling:
    top = [max(row.explained_percent[n] for row in rows) for n in outputs]
    best = {
        n: next(row.key for row in rows if row.explained_percent[n] == most)
        for n, most in zip(outputs, top, strict=True)
    }
    own = [max(rows[0].explained_percent[n], 0.0) for n in outputs]
    mean = float(np.mean(np.maximum(top, 0.0)))
    share = min(100 * float(np.mean(own)) / mean, 100.0) if mean > 0 else 0.0  # rounding
    model, *others = rows
    others.sort(key=lambda row: -sum(row.explained_percent.values()))
    return Ceiling(share, (model, *others), best, reasons)


def words(found: Ceiling) -> list[str]:
    """Return the result in sentences and a table."""
    titles = {row.key: row.title for row in found.rows}
    lines = [
        f'your physical model explains {found.share_percent:.1f} % of what any model explains here'
    ]
    for name, key in found.best.items():
        own = found.rows[0].explained_percent[name]
        row = next(r for r in found.rows if r.key == key)
        told = 'no structure explains more'
        if key != MODEL:
            before, after = (r.errors_percent[name] for r in (found.rows[0], row))
            told = f'{titles[key]} explains {row.explained_percent[name]:.2f} %'
            if after > 0.0 and np.isfinite(before):
                told += f', its error is {before / after:.2g} times smaller'
        lines.append(f'  {name}: {own:.2f} % of the held-back variance; {told}')
    for row in found.rows:
        errors = ''.join(f'{e:>11.4g} %' for e in row.errors_percent.values())
        lines.append(f'  {row.title:<34}{errors}   {row.about}')
    return [*lines, *(f'note: {reason}' for reason in found.reasons)]


def ceiling_document(found: Ceiling) -> dict[str, object]:
    """Return the result of plain types, for JSON."""
    return {
        'share_percent': found.share_percent,
        'best': dict(found.best),
        'models': [
            {
                'key': row.key,
                'title': row.title,
                'errors_percent': {n: number(v) for n, v in row.errors_percent.items()},
                'explained_percent': {n: number(v) for n, v in row.explained_percent.items()},
                'about': row.about,
            }
            for row in found.rows
        ],
        'reasons': list(found.reasons),
    }
