"""Read rows out of the pages of a damaged sqlite3 file, without its index.

A truncated database often lacks the inner pages of its trees, so sqlite itself finds no row at
all, though nearly all leaf pages are there.  Here every leaf page of a table is read on its own;
see https://www.sqlite.org/fileformat2.html, sections 1.6 (pages) and 2.1 (records).
"""

from collections.abc import Iterator
import struct

LEAF = 0x0D
HEADER = 100
"""Bytes of the database header in front of the first page's content."""
INTEGERS = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}
"""Serial type to bytes."""

Value = int | bytes | None
Row = tuple[Value, ...]


def page_size_of(data: bytes) -> int:
    """Return the page size of a database, 0 if it is none."""
    if len(data) < HEADER or not data.startswith(b'SQLite format 3\0'):
        return 0
    size = int(struct.unpack_from('>H', data, 16)[0])
    return 65536 if size == 1 else size


def is_cut_short(data_size: int, head: bytes) -> bool:
    """Tell whether a file is shorter than its header says.

    Parameters
    ----------
    data_size:
        Size of the file in bytes.
    head:
        Its first 100 bytes.
    """
    counter, pages = struct.unpack_from('>II', head, 24)
    (valid_for,) = struct.unpack_from('>I', head, 92)
    return bool(counter == valid_for and data_size < pages * page_size_of(head))


def rows_of(data: bytes, columns: int) -> Iterator[tuple[int, Row]]:
    """Yield row id and values of every whole row with that many columns.

    Parameters
    ----------
    data:
        The file, as far as it exists.
    columns:
        Number of columns of the table that is looked for.
    """
    size = page_size_of(data)
    for start in range(0, len(data) if size else 0, size or 1):
        page = data[start : start + size]
        first = HEADER if start == 0 else 0
        if len(page) < first + 8 or page[first] != LEAF:
            continue
        (count,) = struct.unpack_from('>H', page, first + 3)
        for k in range(count):
            try:
                (cell,) = struct.unpack_from('>H', page, first + 8 + 2 * k)
                row = _row(data, page, cell, size, columns)
            except (IndexError, struct.error):
                continue
            if row is not None:
                yield row


def _row(data: bytes, page: bytes, cell: int, size: int, columns: int) -> tuple[int, Row] | None:
    """Decode one cell; None if it is not whole or has other columns."""
    length, cell = _varint(page, cell)
    identity, cell = _varint(page, cell)
    payload = _payload(data, page, cell, length, size)
    if payload is None or identity <= 0:
        return None
    end, position = _varint(payload, 0)
    kinds = []
    while position < end:
        kind, position = _varint(payload, position)
        kinds.append(kind)
    if len(kinds) != columns:
        return None
    values = []
    for kind in kinds:
        value, position = _value(payload, position, kind)
        values.append(value)
    return (identity, tuple(values)) if position == len(payload) else None


def _payload(data: bytes, page: bytes, cell: int, length: int, size: int) -> bytes | None:
    """Return the bytes of a record, from its page and the overflow pages behind it."""
    usable = size - data[20]
    most, least = usable - 35, (usable - 12) * 32 // 255 - 23
    local = length
    if length > most:
        local = least + (length - least) % (usable - 4)
        local = local if local <= most else least
    if cell + local > len(page):
        return None
    payload = page[cell : cell + local]
    following = struct.unpack_from('>I', page, cell + local)[0] if local < length else 0
    while len(payload) < length:
        start = (following - 1) * size
        if following < 2 or start + 4 > len(data):
            return None
        (following,) = struct.unpack_from('>I', data, start)
        piece = data[start + 4 : start + usable][: length - len(payload)]
        if not piece:
            return None
        payload += piece
    return payload


def _varint(data: bytes, position: int) -> tuple[int, int]:
    value = 0
    for k in range(9):
        byte = data[position + k]
        if k == 8:
            return value << 8 | byte, position + 9
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, position + k + 1
    raise AssertionError('unreachable')


def _value(payload: bytes, position: int, kind: int) -> tuple[Value, int]:
    if kind in INTEGERS:
        end = position + INTEGERS[kind]
        return int.from_bytes(payload[position:end], 'big', signed=True), end
    if kind >= 12:
        end = position + (kind - 12) // 2
        return payload[position:end], end
    return {8: 0, 9: 1}.get(kind), position + (8 if kind == 7 else 0)
