"""Read rosbag2's sqlite3 files, also those of a recorder that was killed, into columns."""

from collections.abc import Collection
from contextlib import closing
from pathlib import Path
import shutil
import sqlite3
import struct
import tempfile

from motor_sysid.errors import UserError
from motor_sysid.recording.messages import from_list, Messages, Topic
from motor_sysid.signals.finding import Finding, Severity

BLOCK = 100
"""Rows per query while salvaging: a damaged page costs at most one block of messages."""
MISSES = 500
"""Blocks without a readable row after which the end is taken to be reached."""


class SqliteFile:
    """One ``.db3`` file, opened for reading; the file itself is never changed.

    Attributes
    ----------
    topics:
        Its topics.
    findings:
        What is damaged, filled while reading.

    Raises
    ------
    UserError
        If the file is empty or no rosbag2 database.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.findings: list[Finding] = []
        self._copy: tempfile.TemporaryDirectory[str] | None = None
        if path.stat().st_size == 0:
            raise UserError(f'{path} is empty (0 bytes); nothing was recorded')
        self._file = path
        self._damaged = False
        if any(_companion(path, suffix) for suffix in ('-journal', '-wal')):
            self._repair()
        try:
            self.topics = self._read_topics()
        except sqlite3.DatabaseError:
            self._salvage()

    def read(self, names: Collection[str]) -> dict[str, Messages]:
        """Return the messages of the named topics, in the order in which they were received."""
        with closing(self._connect()) as database:
            identities = database.execute('SELECT id, name FROM topics').fetchall()
            found: dict[str, Messages] = {}
            for identity, name in identities:
                if name in names:
                    rows = self._rows(database, identity)
                    received, parts = zip(*rows, strict=True) if rows else ((), ())
                    found[name] = from_list(received, parts).in_time_order()
        if self._damaged:
            self.findings.append(_damage(self.path, sum(map(len, found.values()))))
        return found

    def _connect(self) -> sqlite3.Connection:
        mode = 'immutable=1' if self._copy is None else 'mode=rw'
        return sqlite3.connect(f'file:{_quoted(self._file)}?{mode}', uri=True)

    def _rows(self, database: sqlite3.Connection, topic: int) -> list[tuple[int, bytes]]:
        query = 'SELECT timestamp, data FROM messages WHERE topic_id = ?'
        try:
            return database.execute(query, (topic,)).fetchall()
        except sqlite3.DatabaseError:
            self._damaged = True
            return _salvaged_rows(database, topic)

    def _read_topics(self) -> tuple[Topic, ...]:
        with closing(self._connect()) as database:
            tables = {name for (name,) in database.execute('SELECT name FROM sqlite_master')}
            if not {'topics', 'messages'} <= tables:
                raise UserError(
                    f'{self.path} is no rosbag2 database (it has no tables `topics`, `messages`)'
                )
            definitions: dict[str, tuple[str, str]] = {}
            if 'message_definitions' in tables:
                for name, encoding, text in database.execute(
                    'SELECT topic_type, encoding, encoded_message_definition '
                    'FROM message_definitions'
                ):
                    definitions[name] = (text, encoding)
            cursor = database.execute('SELECT * FROM topics ORDER BY id')
            columns = [column[0] for column in cursor.description]
            rows = [dict(zip(columns, row, strict=True)) for row in cursor]
        return tuple(
            Topic(
                row['name'], row['type'], *definitions.get(row['type'], ('', '')),
                row.get('type_description_hash', ''), row.get('offered_qos_profiles', ''),
                row.get('serialization_format', 'cdr'),
            )
            for row in rows
        )  # fmt: skip

    def _repair(self) -> None:
        """Open a copy together with its journal, so that sqlite rolls back what was unfinished."""
        self._copy = tempfile.TemporaryDirectory(prefix='motor_sysid_')
        self._file = Path(self._copy.name) / self.path.name
        shutil.copyfile(self.path, self._file)
        for suffix in ('-journal', '-wal'):
            if companion := _companion(self.path, suffix):
                shutil.copyfile(companion, f'{self._file}{suffix}')
        self.findings.append(
            Finding(
                Severity.INFO, 'unclean_close',
                f'{self.path.name} was not closed (its recorder was killed)',
                'up to about one second at the end is missing',
                'nothing to do; end a recording with Ctrl-C to keep all of it',
            )
        )  # fmt: skip

    def _salvage(self) -> None:
        """Open a copy of a truncated database, filled up to its full length with zeros."""
        if self._copy is None:
            self._copy = tempfile.TemporaryDirectory(prefix='motor_sysid_')
            self._file = Path(self._copy.name) / self.path.name
            shutil.copyfile(self.path, self._file)
        head = self._file.read_bytes()[:100]
        if not head.startswith(b'SQLite format 3') or len(head) < 100:
            raise UserError(f'{self.path} is not a sqlite3 database')
        page, pages = struct.unpack('>H', head[16:18])[0], struct.unpack('>I', head[28:32])[0]
        size = (65536 if page == 1 else page) * pages
        with self._file.open('r+b') as file:
            file.truncate(max(size, self._file.stat().st_size))
        try:
            self.topics = self._read_topics()
        except sqlite3.DatabaseError as error:
            raise UserError(
                f'{self.path} is damaged beyond reading ({error}); copy it again from its source'
            ) from None


def _salvaged_rows(database: sqlite3.Connection, topic: int) -> list[tuple[int, bytes]]:
    """Read block by block of row ids and leave out the blocks that cannot be read."""
    query = 'SELECT timestamp, data FROM messages WHERE id >= ? AND id < ? AND topic_id = ?'
    rows: list[tuple[int, bytes]] = []
    start = misses = 0
    while misses < MISSES:
        try:
            found = database.execute(query, (start, start + BLOCK, topic)).fetchall()
        except sqlite3.DatabaseError:
            found = []
        misses = 0 if found else misses + 1
        rows += found
        start += BLOCK
    return [row for row in rows if isinstance(row[0], int) and isinstance(row[1], bytes)]


def _damage(path: Path, count: int) -> Finding:
    return Finding(
        Severity.WARNING, 'damaged_bag',
        f'{path.name} is damaged (truncated or overwritten); {count} messages could be read',
        'the record has holes or ends early where messages are lost',
        'copy the bag again from its source, or record again',
        {'messages': count},
    )  # fmt: skip


def _companion(path: Path, suffix: str) -> Path | None:
    file = path.with_name(path.name + suffix)
    return file if file.exists() and file.stat().st_size > 0 else None


def _quoted(path: Path) -> str:
    from urllib.parse import quote

    return quote(str(path))
