"""One thread for each of our programs' linear algebra.

The matrices are small: on a busy machine the threads of a BLAS wait for each other longer than
they work (a diagnosis of a minute at 1 kHz took 1.4 times the processor time with two).  What is
worth a second core is run in threads of our own.
"""

import os

VARIABLES = ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS', 'NUMBA_NUM_THREADS')


def use_one() -> None:
    """Ask for one thread, unless the user's environment says otherwise.

    Works before the first import of numpy only, so programs call it, not the library.
    """
    for name in VARIABLES:
        os.environ.setdefault(name, '1')
