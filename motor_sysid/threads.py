"""One thread for each of our programs' linear algebra, two for what is worth a second core.

The matrices are small: on a busy machine the threads of a BLAS wait for each other longer than
they work (a diagnosis of a minute at 1 kHz took 1.4 times the processor time with two).  What is
worth a second core is run in threads of our own.
"""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
import os
from typing import TypeVar

from motor_sysid.effort import counted_by, current

VARIABLES = ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS', 'NUMBA_NUM_THREADS')

WORKERS = 2
"""Tasks that may run at the same time; what they find does not depend on it."""

One = TypeVar('One')
Found = TypeVar('Found')


def use_one() -> None:
    """Ask for one thread, unless the user's environment says otherwise.

    Works before the first import of numpy only, so programs call it, not the library.
    """
    for name in VARIABLES:
        os.environ.setdefault(name, '1')


def in_threads(task: Callable[[One], Found], items: Iterable[One]) -> list[Found]:
    """Return what a task finds for each item, `WORKERS` of them at a time, in their order.

    It pays where a task spends its time in numpy or in compiled code.  What numpy is told about
    errors (`numpy.errstate`) does not reach into a thread: the task says so itself.
    """
    effort = current()

    def counted(item: One) -> Found:
        with counted_by(effort):
            return task(item)

    with ThreadPoolExecutor(WORKERS) as pool:
        return list(pool.map(counted, items))
