"""Read rosbag2's sqlite3 files, also those of a recorder that was killed, into columns."""

from collections.abc import Collection, Mapping
from contextlib import closing
from pathlib import Path
import shutil
import sqlite3
import tempfile

from motor_sysid.errors import UserError
from motor_sysid.recording.messages import from_list, Messages, Topic
from motor_sysid.recording.sqlite_pages import is_cut_short, page_size_of, rows_of
from motor_sysid.signals.finding import Finding, Severity

Rows = dict[str, tuple[list[int], list[bytes], list[int]]]
"""Receive times (ns), messages and their numbers in the file, by topic."""

MOST = 1 << 40
"""Bytes to which a damaged file is filled up at most (its header may be nonsense)."""
MESSAGE_COLUMNS = 4
"""Columns of the table of messages: id, topic, time, bytes."""


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
            self._damaged = _is_cut_short(self._file)
            self.topics = self._read_topics()
        except sqlite3.DatabaseError:
            self._damaged = True
            self._pad()

    def read(self, names: Collection[str]) -> dict[str, Messages]:
        """Return the messages of the named topics, in the order in which they were stored."""
        with closing(self._connect()) as database:
            identities = dict(database.execute('SELECT name, id FROM topics'))
            wanted = {name: identities[name] for name in names if name in identities}
            try:
                rows = {} if self._damaged else _rows(database, wanted)
            except sqlite3.DatabaseError:
                self._damaged = True
        if self._damaged:
            rows = self._salvage(wanted)
        return {name: from_list(*found) for name, found in rows.items()}

    def _connect(self) -> sqlite3.Connection:
        mode = 'immutable=1' if self._copy is None else 'mode=rw'
        return sqlite3.connect(f'file:{_quoted(self._file)}?{mode}', uri=True)

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

    def _pad(self) -> None:
        """Open a copy of a truncated database, filled up so that sqlite can read its start."""
        head = self._file.read_bytes()[:100]
        page = page_size_of(head)
        if not page:
            raise UserError(f'{self.path} is not a sqlite3 database')
        if self._copy is None:
            self._copy = tempfile.TemporaryDirectory(prefix='motor_sysid_')
            self._file = Path(self._copy.name) / self.path.name
            shutil.copyfile(self.path, self._file)
        pages = int.from_bytes(head[28:32], 'big')
        with self._file.open('r+b') as file:
            file.truncate(max(self._file.stat().st_size, min(page * pages, MOST)))
        try:
            self.topics = self._read_topics()
        except sqlite3.DatabaseError as error:
            raise UserError(
                f'{self.path} is damaged beyond reading ({error}); copy it again from its source'
            ) from None

    def _salvage(self, wanted: Mapping[str, int]) -> Rows:
        """Collect the messages that lie in whole pages."""
        found: Rows = {name: ([], [], []) for name in wanted}
        names = {identity: name for name, identity in wanted.items()}
        rows = sorted(rows_of(self.path.read_bytes(), MESSAGE_COLUMNS), key=lambda row: row[0])
        for place, (_, (_, topic, received, data)) in enumerate(rows):
            if not isinstance(received, int) or not isinstance(data, bytes) or received <= 0:
                continue
            if isinstance(topic, int) and topic in names:
                all_received, parts, places = found[names[topic]]
                all_received.append(received)
                parts.append(data)
                places.append(place)
        count = sum(len(parts) for _, parts, _ in found.values())
        self.findings.append(_damage(self.path, count))
        return found


def _rows(database: sqlite3.Connection, wanted: Mapping[str, int]) -> Rows:
    """Return receive times, bytes and numbers by topic."""
    found: Rows = {}
    for name, identity in wanted.items():
        rows = database.execute(
            'SELECT timestamp, data, rowid FROM messages WHERE topic_id = ? ORDER BY rowid',
            (identity,),
        ).fetchall()
        columns = zip(*rows, strict=True) if rows else ((), (), ())
        received, parts, places = map(list, columns)
        found[name] = (received, parts, places)
    return found


def _is_cut_short(path: Path) -> bool:
    with path.open('rb') as file:
        head = file.read(100)
    return len(head) == 100 and is_cut_short(path.stat().st_size, head)


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
