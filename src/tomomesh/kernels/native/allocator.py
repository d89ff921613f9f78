"""The functions that NumPy takes the memory of arrays from, and gives it back to (NEP 49): large ones lie in files.

They are machine code that calls the C library and nothing of Python: NumPy calls them while errors are on their way,
and when the interpreter is at its end. Whoever calls them holds the interpreter's lock, so there is one at a time, and
one thread beside them that holds none and *watches*.

A *state* is a (`FIRST` + 2 s,) int64 array: numbers, and from `FIRST` on an address, 0 where there is none, and a size
for each large array; the size is below 0 where the array lies in the memory. Who changes it, or lets pages go, locks
it.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
import numpy as np
from numba import types

if TYPE_CHECKING:
    from collections.abc import Callable

Function = TypeVar("Function", bound="Callable[..., Any]")

ROOM, LARGE, FOLDER, FAULT, TOP = 0, 1, 2, 3, 4
"""Places in a state: bytes of large arrays that may still lie in the memory; bytes from which an array is large; the
address of the name of the folder of the files; the number of the last error of the system, -1 where a file could not be
made; end of the places in use."""
SELF, STATM, FULL, LOOK, DONE, LOCK, TEXT, FIRST = 5, 6, 7, 8, 9, 16, 24, 32
"""More places: the state's own address; the open file in which the system tells how many pages are in the memory, -1
where none is watched; pages from which some are let go of; how often that is looked at, in microseconds; whether that
is over; a lock of the C library, of which none has more bytes; what stands in that file; the first large array."""
SPACE, ZERO, PAGE = 32, 48, os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096
READ_WRITE, SHARED, FAILED, DONTNEED = 3, 1, -1, 4
"""Of mmap and madvise: what may be done; what is written goes to the file; no map; the pages are let go of."""
UNNAMED, PRIVATE = os.O_RDWR | getattr(os, "O_TMPFILE", 0) | getattr(os, "O_CLOEXEC", 0), 0o600

ADDRESS, NUMBER, STATE = types.intp, types.int32, types.CPointer(types.int64)


def _of_c(name: str, result: Any, *arguments: Any) -> Any:
    return types.ExternalFunction(name, result(*arguments))


def _compiled(function: Function) -> Function:
    return cast("Function", numba.njit(function))


def _for_c(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    return cast("Callable[[Callable[..., Any]], Any]", numba.cfunc(signature))


malloc = _of_c("malloc", ADDRESS, ADDRESS)
calloc = _of_c("calloc", ADDRESS, ADDRESS, ADDRESS)
realloc = _of_c("realloc", ADDRESS, ADDRESS, ADDRESS)
free = _of_c("free", types.void, ADDRESS)
memcpy = _of_c("memcpy", ADDRESS, ADDRESS, ADDRESS, ADDRESS)
open_ = _of_c("open", NUMBER, ADDRESS, NUMBER, NUMBER)
close = _of_c("close", NUMBER, NUMBER)
fallocate = _of_c("posix_fallocate", NUMBER, NUMBER, ADDRESS, ADDRESS)
mmap = _of_c("mmap", ADDRESS, ADDRESS, ADDRESS, NUMBER, NUMBER, NUMBER, ADDRESS)
munmap = _of_c("munmap", NUMBER, ADDRESS, ADDRESS)
madvise = _of_c("madvise", NUMBER, ADDRESS, ADDRESS, NUMBER)
pread = _of_c("pread", ADDRESS, NUMBER, ADDRESS, ADDRESS, ADDRESS)
usleep = _of_c("usleep", NUMBER, NUMBER)
mutex_lock = _of_c("pthread_mutex_lock", NUMBER, ADDRESS)
mutex_unlock = _of_c("pthread_mutex_unlock", NUMBER, ADDRESS)


@_compiled
def find(state: Any, place: int) -> int:
    """Return where a state has an address; its end where it has not."""
    at = FIRST
    while at < state[TOP] and state[at] != place:
        at += 2
    return at


@_compiled
def map_file(state: Any, size: int) -> int:
    """Return the address of a new file in the memory, all 0; 0 where there is no room.

    Its room on the disk is taken at once: what finds the disk full later ends the process.
    """
    file = open_(state[FOLDER], UNNAMED, PRIVATE)
    if file < 0:
        state[FAULT] = -1
        return 0
    state[FAULT] = fallocate(file, 0, size)
    place = mmap(0, size, READ_WRITE, SHARED, file, 0) if state[FAULT] == 0 else FAILED
    close(file)
    return 0 if place == FAILED else int(place)


@_compiled
def lock(state: Any) -> None:
    """Keep others from a state; all 0 is a lock that nobody holds."""
    mutex_lock(state[SELF] + 8 * LOCK)


@_compiled
def unlock(state: Any) -> None:
    """Let others at a state again."""
    mutex_unlock(state[SELF] + 8 * LOCK)


@_compiled
def resident(state: Any) -> int:
    """Return how many pages of this process are in the memory, the second number that the system tells."""
    text, pages, spaces = state[TEXT:FIRST].view(np.uint8), 0, 0
    for at in range(pread(state[STATM], state[SELF] + 8 * TEXT, len(text), 0)):
        if text[at] == SPACE:
            spaces += 1
        elif spaces == 1:
            pages = 10 * pages + text[at] - ZERO
    return pages


@_compiled
def leave(state: Any, more: int) -> None:
    """Let the pages of all files go if so many more would be too many; they are read again where they are needed."""
    lock(state)
    if resident(state) + more > state[FULL]:
        for at in range(FIRST, state[TOP], 2):
            if state[at] and state[at + 1] > 0:
                madvise(state[at], state[at + 1], DONTNEED)
    unlock(state)


@_compiled
def watch(state: Any) -> None:
    """Let pages go whenever there are too many, until that is over, and once more."""
    state[DONE] = 0
    while state[DONE] == 0:
        leave(state, 0)
        usleep(state[LOOK])
    leave(state, 0)


@_compiled
def take(state: Any, size: int, zero: bool) -> int:
    """Return the address of so many bytes, 0 where there are none."""
    at = len(state) if size < state[LARGE] else find(state, 0)
    if at == len(state):
        return int(calloc(1, size) if zero else malloc(size))
    kept = size <= state[ROOM]
    leave(state, min(size // PAGE, state[FULL] // 3))  # what is larger is not filled before the next look
    place = (calloc(1, size) if zero else malloc(size)) if kept else map_file(state, size)
    if place:
        lock(state)
        state[at], state[at + 1] = place, -size if kept else size
        state[ROOM] -= size if kept else 0
        state[TOP] = max(state[TOP], at + 2)
        unlock(state)
    return int(place)


@_compiled
def forget(state: Any, at: int) -> None:
    """Strike a large array from a state, before its pages go: those of whatever is there next are not to be let go."""
    lock(state)
    state[ROOM] -= min(state[at + 1], 0)
    state[at] = 0
    while state[TOP] > FIRST and state[state[TOP] - 2] == 0:
        state[TOP] -= 2
    unlock(state)


@_compiled
def give_back(state: Any, place: int) -> None:
    """Take bytes back."""
    at = find(state, place)
    size = state[at + 1] if place and at < state[TOP] else 0
    if size:
        forget(state, at)
    if size > 0:
        munmap(place, size)
    else:
        free(place)


@_compiled
def take_again(state: Any, place: int, size: int) -> int:
    """Return the address of as many bytes as are wanted now, with what was at another."""
    at = find(state, place)
    if place == 0 or at >= state[TOP]:
        return int(realloc(place, size))
    found = take(state, size, False)
    if found:
        memcpy(found, place, min(abs(state[at + 1]), size))
        give_back(state, place)
    return int(found)


def entries(length: int) -> dict[str, Any]:
    """Compile what NumPy calls, and ``watch``, over states of a length; each has its ``address``."""

    @_for_c(ADDRESS(STATE, ADDRESS))
    def malloc_(state: Any, size: int) -> int:
        return take(numba.carray(state, length), size, False)

    @_for_c(ADDRESS(STATE, ADDRESS, ADDRESS))
    def calloc_(state: Any, count: int, each: int) -> int:
        return take(numba.carray(state, length), count * each, True)

    @_for_c(ADDRESS(STATE, ADDRESS, ADDRESS))
    def realloc_(state: Any, place: int, size: int) -> int:
        return take_again(numba.carray(state, length), place, size)

    @_for_c(types.void(STATE, ADDRESS, ADDRESS))
    def free_(state: Any, place: int, size: int) -> None:
        give_back(numba.carray(state, length), place)

    @_for_c(types.void(STATE))
    def watch_(state: Any) -> None:
        watch(numba.carray(state, length))

    return {"malloc": malloc_, "calloc": calloc_, "realloc": realloc_, "free": free_, "watch": watch_}
