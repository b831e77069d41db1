"""Write a bag in a thread of its own: a slow disk delays the bag, not the intake."""

from collections.abc import Callable, Sequence
from queue import SimpleQueue
import threading

from motor_sysid.errors import UserError
from motor_sysid.recording.writer import BagWriter, OfferedQos

LIMIT = 512_000_000
"""Bytes that may wait for the disk before recording ends with an error."""
OVERHEAD = 150
"""Bytes that a message takes besides its own."""

Task = Callable[[BagWriter], None]


class BagThread:
    """A `BagWriter` behind a queue; every call returns at once.

    A commit waits for the disk, which may take seconds on a busy machine.  The database belongs to
    the thread that made it, so the thread does everything.

    Parameters
    ----------
    make:
        Makes the writer, in the thread.

    Raises
    ------
    UserError
        If the bag cannot be created; and later, from any call, if it cannot be written.
    """

    def __init__(self, make: Callable[[], BagWriter]) -> None:
        self._tasks: SimpleQueue[Task | None] = SimpleQueue()
        self._error: UserError | None = None
        self._ready = threading.Event()
        self._make = make
        self.written = 0
        self._put = self._done = 0  # bytes; each is counted by one thread
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        self._ready.wait()
        self._raise()

    def add_topic(
        self, name: str, message_type: str, qos: Sequence[OfferedQos],
        definition: str | None = None, digest: str | None = None,
    ) -> str:  # fmt: skip
        """Announce a topic; waits for what comes of it.

        The arguments are those of `BagWriter.add_topic`.

        Returns
        -------
        str
            Why the type cannot be recorded; empty if it can.
        """
        done, refused = threading.Event(), ['']

        def task(writer: BagWriter) -> None:
            refused[0] = '' if definition is not None else writer.refusal(name, message_type)
            if not refused[0]:
                writer.flush()  # so that an mcap chunk begins with the topics that it holds
                writer.add_topic(name, message_type, qos, definition=definition, digest=digest)
            done.set()

        self._tasks.put(task)
        while not done.wait(0.1):
            self._raise()
        return refused[0]

    def write(self, topic: str, messages: Sequence[tuple[int, bytes]]) -> None:
        """Write messages of one topic: time of reception in ns, and CDR bytes."""
        self._raise()
        size = sum(len(data) + OVERHEAD for _, data in messages)
        self._put += size
        if self._put - self._done > LIMIT:
            raise UserError(
                f'more than {LIMIT / 1e6:g} MB wait for the disk: it is too slow for these '
                'topics; record fewer, or elsewhere'
            )

        def task(writer: BagWriter) -> None:
            for received, data in messages:
                writer.write(topic, received, data)
            self.written += len(messages)
            self._done += size

        self._tasks.put(task)

    def flush(self) -> None:
        """Have everything written so far survive a power cut."""
        self._raise()
        self._tasks.put(BagWriter.flush)

    def close(self) -> None:
        """Write what waits, close the bag, and wait for that."""
        self._tasks.put(None)
        self._thread.join()
        self._raise()

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error

    def _run(self) -> None:
        try:
            with self._make() as writer:
                self._ready.set()
                while (task := self._tasks.get()) is not None:
                    task(writer)
        except UserError as error:
            self._error = error
        except Exception as error:  # noqa: BLE001 - nobody else hears of what ends this thread
            self._error = UserError(f'the bag cannot be written: {type(error).__name__}: {error}')
        finally:
            self._ready.set()
