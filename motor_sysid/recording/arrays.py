"""Read a MATLAB ``.mat`` or numpy ``.npz`` file as a table of columns."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
import zipfile
import zlib

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from motor_sysid.errors import UserError
from motor_sysid.signals.finding import Finding, Severity

Array = NDArray[np.float64]

SUFFIXES = ('.mat', '.npz')
_BROKEN = MatReadError, OSError, NotImplementedError, ValueError, TypeError, zlib.error
"""What scipy raises on files that are no MATLAB files, or cut off."""

_HDF5 = b'\x89HDF\r\n\x1a\n'
_WIDEST = 64
"""Most columns of a matrix that are taken for signals."""


@dataclass
class ArrayTable:
    """Named arrays of numbers as columns; the same to a reader as a `Table`.

    Attributes
    ----------
    path:
        The file.
    columns:
        Name to values (N,), as they stand in the file.  A variable is known by its name, a field
        of a structure by ``structure.field``, a column of a matrix by ``matrix[0]``.
    findings:
        What was left out.
    """

    path: Path
    columns: Mapping[str, Array]
    findings: list[Finding] = field(default_factory=list)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.columns)

    @property
    def dated(self) -> frozenset[str]:
        """Names of the columns that hold dates: none."""
        return frozenset()

    def numbers(self, columns: Sequence[str]) -> dict[str, Array]:
        """Return columns (N,) of equal length.

        Raises
        ------
        UserError
            If there is no such column, or their lengths differ.
        """
        for name in columns:
            self.position(name)
        found = {name: self.columns[name].copy() for name in columns}
        if len({values.size for values in found.values()}) > 1:
            sizes = ', '.join(f'`{name}` {values.size}' for name, values in found.items())
            raise UserError(
                f'{self.path}: columns have different numbers of values ({sizes}); they belong '
                'to different records, or are sampled differently; name those of one record in '
                'a msg_config file'
            )
        return found

    def dates(self, column: str) -> Array:
        """Refuse: dates are text, which only a CSV holds.

        Raises
        ------
        UserError
            Always.
        """
        self.position(column)
        raise UserError(
            f'{self.path}: column `{column}` holds numbers, no dates; give the unit of the time '
            'in the msg_config file (s, ms, us, ns)'
        )

    def texts(self, column: str) -> list[str]:
        """Return one column as texts."""
        return [f'{value:g}' for value in self.numbers([column])[column]]

    def position(self, name: str) -> int:
        """Return the position of a column.

        Raises
        ------
        UserError
            If there is no such column.
        """
        if name not in self.columns:
            raise UserError(
                f'{self.path} has no column `{name}`; its columns are {", ".join(self.names)}'
            )
        return self.names.index(name)


def read_arrays(path: Path) -> ArrayTable:
    """Open a ``.mat`` file (up to version 7) or a ``.npz`` file.

    Raises
    ------
    UserError
        If it cannot be read, or holds no column of numbers.
    """
    content = _mat(path) if path.suffix.lower() == '.mat' else _npz(path)
    columns: dict[str, Array] = {}
    left: list[str] = []
    for name, values in content:
        found = _columns(name, values)
        columns |= found
        left += [] if found else [name]
    if not columns:
        named = f'; it holds {", ".join(left)}' if left else ''
        raise UserError(f'{path} holds no column of two or more numbers{named}')
    return ArrayTable(path, columns, _left_out(left))


def _columns(name: str, array: object) -> dict[str, Array]:
    """Return the columns in an array; none if it is none, as cells are, or not of numbers."""
    if not isinstance(array, np.ndarray):
        return {}
    if array.dtype.kind not in 'fiub' or array.size < 2 or array.ndim > 2:
        return {}
    if array.ndim == 1 or 1 in array.shape:
        return {name: array.ravel().astype(np.float64)}
    tall = array if array.shape[0] >= array.shape[1] else array.T
    if tall.shape[1] > _WIDEST:
        return {}
    return {f'{name}[{k}]': tall[:, k].astype(np.float64) for k in range(tall.shape[1])}


def _mat(path: Path) -> Iterator[tuple[str, object]]:
    with path.open('rb') as file:
        begin = file.read(1024)
    if _HDF5 in begin:
        raise UserError(
            f'{path} is a MATLAB 7.3 file, which is HDF5 and cannot be read here; write it anew '
            'with `save(..., "-v7")`, or as CSV'
        )
    try:
        content = loadmat(path, simplify_cells=True)
    except _BROKEN as error:
        raise UserError(f'{path} cannot be read as a MATLAB file: {error}') from None
    for name, values in content.items():
        if not name.startswith('__'):
            yield from _flat(name, values)


def _flat(name: str, values: object) -> Iterator[tuple[str, object]]:
    """Yield the fields of a structure, and of those within it, each by its path."""
    if not isinstance(values, dict):
        yield name, values
        return
    for key, value in values.items():
        yield from _flat(f'{name}.{key}', value)


def _npz(path: Path) -> Iterator[tuple[str, object]]:
    if not zipfile.is_zipfile(path):
        raise UserError(f'{path} is no .npz file (`numpy.savez`), or is cut off; copy it again')
    try:
        with np.load(path, allow_pickle=False) as content:
            for name in content.files:
                try:
                    yield name, content[name]
                except ValueError:  # Python objects, which could run anything
                    yield name, None
    except (zipfile.BadZipFile, ValueError, zlib.error) as error:
        raise UserError(f'{path} cannot be read as a numpy .npz file: {error}') from None


def _left_out(names: list[str]) -> list[Finding]:
    if not names:
        return []
    return [
        Finding(
            Severity.INFO, 'ignored_columns', f'variables that are no column: {", ".join(names)}',
            'nothing, if they are not needed',
            'a column is a vector of numbers, or a matrix with one column for each signal',
            {'columns': len(names)},
        )
    ]  # fmt: skip
