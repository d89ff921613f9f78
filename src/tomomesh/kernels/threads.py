"""Share ranges of independent work among threads."""

from __future__ import annotations

import os
import threading
from collections import deque
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from queue import SimpleQueue
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

T = TypeVar("T")

_share = 0
_working = threading.local()
"""Knows the threads of a pool: what they share out themselves they do alone, or all would wait for each other."""


def cores() -> int:
    """Return how many cores the work of this process is for: all, or its share of them."""
    return _share or os.cpu_count() or 1


def share_cores(count: int) -> None:
    """Leave the other cores to other processes that work beside this one; 0 takes them back."""
    global _share
    _share = count


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
        0 is one for each of our `cores`.
    done : callable
        Told how much is finished after each block, from the calling thread; may raise to stop the work.
    """
    starts = range(0, total, max(block, 1))
    workers = min(threads or cores(), len(starts))
    if workers <= 1 or getattr(_working, "here", False):
        for start in starts:
            work(start, min(start + block, total))
            done(min(start + block, total))
        return
    _in_pool(work, starts, total, block, workers, done)


def in_order(
    find: Callable[[int], T], total: int,
    *, block: int = 1, threads: int = 0, done: Callable[[int], None] = lambda count: None,
) -> list[T]:  # fmt: skip
    """Return what ``find(number)`` finds of ``range(total)``, in this order; see `in_blocks`."""
    found: dict[int, T] = {}

    def work(start: int, stop: int) -> None:
        found.update({number: find(number) for number in range(start, stop)})

    in_blocks(work, total, block=block, threads=threads, done=done)
    return [found[number] for number in range(total)]


def _in_pool(
    work: Callable[[int, int], None],
    starts: range,
    total: int,
    block: int,
    workers: int,
    done: Callable[[int], None],
) -> None:
    waiting, told = deque(starts), SimpleQueue[BaseException | None]()

    def work_on() -> None:
        while start := _next(waiting):
            try:
                work(start[0], min(start[0] + block, total))
            except BaseException as failure:
                told.put(failure)  # the calling thread raises it
                return
            told.put(None)

    at_work = [_pool(workers).submit(work_on) for _ in range(workers)]
    try:
        for finished in range(1, len(starts) + 1):
            failure = told.get()
            if failure is not None:
                raise failure
            done(min(finished * block, total))
    except KeyboardInterrupt:
        from .native.workers import stop_waiting

        stop_waiting()
        raise
    finally:
        waiting.clear()
        wait(at_work)


def _next(waiting: deque[int]) -> tuple[int, ...]:
    """Take the next block; none is left for a thread that comes too late."""
    try:
        return (waiting.popleft(),)
    except IndexError:
        return ()


@cache
def _pool(workers: int) -> ThreadPoolExecutor:
    """Return threads that are kept: the mesh takes many short steps."""
    return ThreadPoolExecutor(workers, initializer=_working.__setattr__, initargs=("here", True))


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)
