"""What the reference of a closed loop explains of the input: free of the noise that is fed back.

The input is projected on the reference behind first-order lags of many time constants, a basis for
the response of any damped loop.  (Van den Hof and Schrama 1993, doi:10.1016/0005-1098(93)90015-L.)
"""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from motor_sysid.errors import UserError
from motor_sysid.physics.drive import input_signals
from motor_sysid.physics.motors.base import Motor
from motor_sysid.signals.record import Record

Array = NDArray[np.float64]

REFERENCES = ('speed_reference', 'position_reference')

_LAGS = 8
_LONGEST = 0.1
_SMALL = 1e-10


def moving_references(record: Record) -> list[str]:
    """Return the references that a controller followed and that move."""
    return [name for name in REFERENCES if name in record and np.ptp(record[name]) > 0]


def noise_free_input(record: Record, kind: Motor) -> Record:
    """Return the record with what its reference explains of each input.

    Raises
    ------
    UserError
        If it has no reference.
    """
    if not moving_references(record):
        raise UserError(
            'two-stage identification needs `speed_reference` or `position_reference` in the '
            'record; without a controller use the method `least_squares`'
        )
    inputs = input_signals(record, kind)
    explained = led_by_reference(record, np.column_stack([record[name] for name in inputs]))
    for name, values in zip(inputs, explained.T, strict=True):
        record = record.with_signal(name, values, record.units[name])
    return record


def led_by_reference(record: Record, values: Array, first: int = 0) -> Array:
    """Return what the reference explains of (K, k) values, one for each row from `first` on.

    Without a reference, that is all of them.
    """
    names = moving_references(record)
    if not names:
        return values
    basis = _basis(record, names)[first:]
    explained: Array = basis @ np.linalg.lstsq(basis, values, rcond=_SMALL)[0]
    return explained


def _basis(record: Record, names: list[str]) -> Array:
    columns = [np.ones(len(record))]
    for name in names:
        r = record[name]
        columns += [r, np.concatenate(([0.0], np.diff(r)))]
        for lag in np.geomspace(1.0, _LONGEST * len(record), _LAGS):
            keep = np.exp(-1 / lag)
            columns.append(np.asarray(lfilter([1 - keep], [1, -keep], r, zi=[keep * r[0]])[0]))
    return np.column_stack(columns)
