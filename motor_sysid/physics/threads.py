"""Threads that simulations share: starting some for each would take as long as a short one."""

from concurrent.futures import ThreadPoolExecutor
from functools import cache


@cache
def shared(threads: int) -> ThreadPoolExecutor:
    """Return the pool of so many threads; what runs in it must not wait for more of it."""
    return ThreadPoolExecutor(threads, thread_name_prefix='simulation')
