"""Share ranges of independent work among threads."""

from __future__ import annotations

import os
import threading
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

_working = threading.local()
"""Knows the threads of a pool: what they share out themselves they do alone, or all would wait for each other."""


def in_blocks(
    work: Callable[[int, int], None],
    total: int,
    *,
    block: int,
    threads: int = 0,
    done: Callable[[int], None] = lambda count: None,
) -> None:
    """Call ``work(start, stop)`` on blocks that cover ``range(total)``.

    Parameters
    ----------
    work : callable
        Must write only to its own range, so that the result does not depend on the threads.
    total, block : int
        Amount of work, and how much of it one call takes: at most 100 ms, so that Ctrl-C answers at once.
    threads : int
        0 is one a core.
    done : callable
        Told how much is finished after each block, from the calling thread; may raise to stop the work.
    """
    starts = range(0, total, max(block, 1))
    workers = min(threads or os.cpu_count() or 1, len(starts))
    if workers <= 1 or getattr(_working, "here", False):
        for start in starts:
            work(start, min(start + block, total))
            done(min(start + block, total))
        return
    _in_pool(work, starts, total, block, workers, done)


def _in_pool(
    work: Callable[[int, int], None],
    starts: range,
    total: int,
    block: int,
    workers: int,
    done: Callable[[int], None],
) -> None:
    waiting = {_pool(workers).submit(work, start, min(start + block, total)) for start in starts}
    finished = 0
    try:
        while waiting:
            ready, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in ready:
                future.result()
            finished = min(finished + len(ready) * block, total)
            done(finished)
    finally:
        wait([future for future in waiting if not future.cancel()])


@cache
def _pool(workers: int) -> ThreadPoolExecutor:
    """Return threads that are kept: the mesh takes many short steps."""
    return ThreadPoolExecutor(workers, initializer=_working.__setattr__, initargs=("here", True))


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)
