"""Records that are refused: too short, or with values that are no numbers."""

from collections.abc import Sequence, Set

import numpy as np

from motor_sysid.errors import UserError
from motor_sysid.signals.record import Record

MIN_SAMPLES, MIN_PIECE = 200, 50
"""Fewest samples, of all records that are fitted together and of each, for a diagnosis."""

FEWEST = 20
"""Fewest samples of a record for a fit, which then says how little it knows."""


def refuse_short(train: Sequence[Record], validation: Sequence[Record]) -> None:
    """Refuse records that are too short to tell anything.

    Raises
    ------
    UserError
        If there is no training record, all together have fewer than `MIN_SAMPLES` samples, or one
        has fewer than `MIN_PIECE`.
    """
    if not train:
        raise UserError('no training record; give at least one')
    for record in (*train, *validation):
        if len(record) < MIN_PIECE:
            raise UserError(
                f'{record.provenance.source or "a record"} has {len(record)} samples; a diagnosis '
                f'needs at least {MIN_PIECE} in each record: leave it out'
            )
    count = sum(map(len, train))
    if count < MIN_SAMPLES:
        raise UserError(
            f'{train[0].provenance.source or "the data"}: {count} samples to fit; a diagnosis '
            f'needs at least {MIN_SAMPLES}, better 5000'
        )


def refuse_few(records: Sequence[Record]) -> None:
    """Refuse records of which a fit would not know anything.

    Raises
    ------
    UserError
        If one has fewer than `FEWEST` samples.
    """
    for record in records:
        if len(record) < FEWEST:
            raise UserError(
                f'{record.provenance.source or "a record"} has {len(record)} samples; a fit needs '
                f'at least {FEWEST} in each record: leave it out, or record longer'
            )


def refuse_gaps(record: Record, names: Set[str]) -> None:
    """Refuse signals of a record that are not numbers everywhere.

    Raises
    ------
    UserError
        If one is not.
    """
    for name in sorted(names):
        count = int(np.sum(~np.isfinite(record[name])))
        if count:
            raise UserError(
                f'`{name}` of {record.provenance.source or "a record"} has {count} values of '
                f'{len(record)} that are not finite; drop or mend these samples'
            )
