"""Write a bag in a thread of its own: a slow disk delays the bag, not the intake."""

from collections.abc import Callable, Sequence
from queue import SimpleQueue
import threading

from motor_sysid.errors import UserError
from motor_sysid.recording.writer import BagWriter, OfferedQos

LIMIT = 2_000_000
"""Messages that may wait for the disk before recording ends with an error."""

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
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        self._ready.wait()
        self._raise()

    def add_topic(
        self, name: str, message_type: str, qos: Sequence[OfferedQos],
        definition: str | None = None, digest: str | None = None,
    ) -> None:  # fmt: skip
        """Announce a topic; waits, so that a type that cannot be recorded is refused here.

        The arguments are those of `BagWriter.add_topic`.

        Raises
        ------
        UserError
            If the type is not known.
        """
        done, refused = threading.Event(), []

        def task(writer: BagWriter) -> None:
            try:
                writer.flush()  # so that an mcap chunk begins with the topics that it holds
                writer.add_topic(name, message_type, qos, definition=definition, digest=digest)
            except UserError as error:
                refused.append(error)
            finally:
                done.set()

        self._tasks.put(task)
        while not done.wait(0.1):
            self._raise()
        if refused:
            raise refused[0]

    def write(self, topic: str, messages: Sequence[tuple[int, bytes]]) -> None:
        """Write messages of one topic: time of reception in ns, and CDR bytes."""
        self._raise()
        if self._tasks.qsize() > LIMIT:
            raise UserError('the disk is too slow for these topics; record fewer, or elsewhere')

        def task(writer: BagWriter) -> None:
            for received, data in messages:
                writer.write(topic, received, data)
            self.written += len(messages)

        self._tasks.put(task)

    def flush(self) -> None:
        """Have everything written so far survive a kill."""
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
            writer = self._make()
        except UserError as error:
            self._error = error
            self._ready.set()
            return
        self._ready.set()
        try:
            with writer:
                while (task := self._tasks.get()) is not None:
                    task(writer)
        except UserError as error:
            self._error = error
