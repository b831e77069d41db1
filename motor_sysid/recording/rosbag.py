"""A rosbag2 recording: a folder, one ``.mcap`` or one ``.db3``, whole or damaged."""

from collections.abc import Collection, Iterator, Mapping
import heapq
from pathlib import Path
import re
import struct
import tempfile

import yaml

from motor_sysid.errors import UserError
from motor_sysid.recording.mcap import McapFile
from motor_sysid.recording.messages import concatenate, from_list, Messages, Topic
from motor_sysid.recording.reception import in_one_time
from motor_sysid.recording.sqlite import SqliteFile
from motor_sysid.signals.finding import Finding, Severity

STORAGES: Mapping[str, type[McapFile] | type[SqliteFile]] = {'.mcap': McapFile, '.db3': SqliteFile}
PACKED = ('.mcap.zstd', '.db3.zstd')
ZSTD = b'\x28\xb5\x2f\xfd'
"""First bytes of what zstd compressed; no CDR message begins with them."""


def is_bag(path: Path) -> bool:
    """Tell whether a path looks like a rosbag2 recording (the content may still be damaged)."""
    if path.is_dir():
        return (path / 'metadata.yaml').exists() or bool(_storage_files(path))
    return path.suffix in STORAGES or path.name.endswith(PACKED)


class Bag:
    """A bag, opened for reading; nothing is ever changed.

    Attributes
    ----------
    topics:
        Its topics by name.
    custom_data:
        What the recorder wrote beside the messages (``custom_data`` of metadata.yaml).
    findings:
        What is damaged or missing, as far as known; complete after `read`.

    Raises
    ------
    UserError
        If there is nothing to read.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.findings: list[Finding] = []
        self._unpacked: tempfile.TemporaryDirectory[str] | None = None
        if not self.path.exists():
            raise UserError(f'{path} does not exist; a bag is a folder, an .mcap or a .db3')
        information = self._metadata() if self.path.is_dir() else {}
        self.custom_data = _texts(information.get('custom_data'))
        self._files: list[McapFile | SqliteFile] = []
        for file in self._paths(information):
            self._open(file)
        if not self._files:
            reasons = '; '.join(finding.message for finding in self.findings)
            raise UserError(f'{path} holds no readable .mcap or .db3 file ({reasons})')
        self.topics: Mapping[str, Topic] = {
            topic.name: topic for file in reversed(self._files) for topic in file.topics
        }

    def read(self, names: Collection[str]) -> dict[str, Messages]:
        """Return the messages of the named topics, each in the order of reception."""
        pieces: dict[str, list[Messages]] = {name: [] for name in names}
        begin = 0
        for file in self._files:
            already = len(file.findings)
            try:
                found = file.read(names)
            except (struct.error, ValueError, IndexError) as error:
                raise UserError(
                    f'{file.path} is damaged beyond reading ({error}); copy it again'
                ) from None
            for name, messages in found.items():
                pieces[name].append(self._decompressed(messages).behind(begin))
            begin += 1 + max((int(m.places[-1]) for m in found.values() if len(m)), default=0)
            self.findings += file.findings[already:]
        read = {name: concatenate(found) for name, found in pieces.items() if found}
        read, told = in_one_time(read)
        self.findings += [finding for finding in told if finding not in self.findings]
        return read

    def iterate(self, names: Collection[str] = ()) -> Iterator[tuple[str, int, bytes]]:
        """Yield (topic, receive time in ns, CDR bytes) in the order of reception.

        Parameters
        ----------
        names:
            Topics to read; all of them if empty.
        """
        wanted = names or tuple(self.topics)
        streams = [
            zip(messages.received.tolist(), [name] * len(messages), messages, strict=True)
            for name, messages in self.read(wanted).items()
        ]
        for received, name, data in heapq.merge(*streams, key=lambda item: item[0]):
            yield name, received, data

    def _metadata(self) -> Mapping[str, object]:
        """Content of metadata.yaml; empty, with a finding, where it is missing or broken."""
        file, name = self.path / 'metadata.yaml', self.path.resolve().name
        try:
            content = yaml.safe_load(file.read_text(encoding='utf8'))
            information = content['rosbag2_bagfile_information']
            if not isinstance(information, dict):
                raise TypeError('no mapping')
        except FileNotFoundError:
            self._note('missing_metadata', f'{name} has no metadata.yaml')
            return {}
        except (yaml.YAMLError, KeyError, TypeError, UnicodeDecodeError, OSError):
            self._note('missing_metadata', f'metadata.yaml of {name} cannot be read')
            return {}
        return information

    def _note(self, code: str, message: str) -> None:
        self.findings.append(
            Finding(
                Severity.INFO, code, f'{message}; its storage files were read as they lie',
                'usually the recorder was killed, and the end of the recording is missing',
                '`ros2 bag reindex` writes a new one if other tools need it',
            )
        )  # fmt: skip

    def _paths(self, information: Mapping[str, object]) -> list[Path]:
        if not self.path.is_dir():
            return [self.path]
        listed = information.get('relative_file_paths')
        names = listed if isinstance(listed, list) else []
        named = [self.path / Path(str(name)).name for name in names]
        for file in named:
            if not file.exists():
                self.findings.append(_missing_file(file))
        return [file for file in named if file.exists()] or _storage_files(self.path)

    def _open(self, file: Path) -> None:
        """Open one storage file; a broken one among several is a finding, not the end."""
        try:
            file = self._unpack(file)
            self._files.append(STORAGES[file.suffix](file))
        except KeyError:
            raise UserError(f'{file} is neither .mcap nor .db3') from None
        except (UserError, OSError, struct.error, ValueError, IndexError) as error:
            if not self.path.is_dir():
                raise error if isinstance(error, UserError) else UserError(
                    f'{file} cannot be read ({error}); copy it again from its source'
                ) from None
            self.findings.append(_unreadable(error))

    def _unpack(self, file: Path) -> Path:
        """Decompress a file that rosbag2 compressed as a whole."""
        if file.suffix != '.zstd':
            return file
        if self._unpacked is None:
            self._unpacked = tempfile.TemporaryDirectory(prefix='motor_sysid_')
        target = Path(self._unpacked.name) / file.stem
        target.write_bytes(_zstd(file.read_bytes()))
        return target

    def _decompressed(self, messages: Messages) -> Messages:
        """Decompress messages that rosbag2 compressed one by one; damaged ones are left out."""
        if not len(messages) or not messages[0].startswith(ZSTD):
            return messages
        kept, parts = [], []
        for k, part in enumerate(messages):
            try:
                parts.append(_zstd(part))
                kept.append(k)
            except UserError as error:
                told = _unreadable(error)
                self.findings += [told] if told not in self.findings else []
        return from_list(messages.received[kept].tolist(), parts, messages.places[kept].tolist())


def _storage_files(folder: Path) -> list[Path]:
    """Storage files of a folder in the order of writing (``_2`` before ``_10``)."""
    files = [
        file
        for file in folder.iterdir()
        if file.suffix in STORAGES or file.name.endswith(PACKED)
    ]
    numbers = {file: [int(n) for n in re.findall(r'\d+', file.stem)] or [0] for file in files}
    return sorted(files, key=lambda file: (numbers[file], file.name))


def _zstd(data: bytes) -> bytes:
    # rosbags carries zstd for every Python version.
    from rosbags.rosbag2.storage_mcap import DECOMPRESSORS

    try:
        return DECOMPRESSORS['zstd'](data, 0)
    except Exception as error:  # noqa: BLE001 - the library differs between Python versions
        raise UserError(f'a zstd-compressed part of the bag is damaged: {error}') from None


def _texts(value: object) -> dict[str, str]:
    return {str(k): str(v) for k, v in value.items()} if isinstance(value, dict) else {}


def _missing_file(file: Path) -> Finding:
    return Finding(
        Severity.WARNING, 'damaged_bag', f'{file.name} is named in metadata.yaml but missing',
        'that part of the recording is not in the record', 'copy the whole bag folder',
    )  # fmt: skip


def _unreadable(error: Exception) -> Finding:
    return Finding(
        Severity.WARNING, 'damaged_bag', str(error),
        'that part of the recording is not in the record', 'copy the bag again from its source',
    )  # fmt: skip
