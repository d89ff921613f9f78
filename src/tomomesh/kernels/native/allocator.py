"""The functions that NumPy takes the memory of arrays from, and gives it back to (NEP 49): large ones lie in files.

They are machine code that calls the C library and nothing of Python: NumPy calls them while errors are on their way,
and when the interpreter is at its end. Whoever calls them holds the interpreter's lock, so there is one at a time.

A *state* is an (8 + 2 s,) int64 array: the numbers `ROOM` to `TOP`, and from `FIRST` on an address, 0 where there is
none, and a size for each large array; the size is below 0 where the array lies in the memory.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numba
from numba import types

if TYPE_CHECKING:
    from collections.abc import Callable

Function = TypeVar("Function", bound="Callable[..., Any]")

ROOM, LARGE, FOLDER, FAULT, TOP, FIRST = 0, 1, 2, 3, 4, 8
"""Places in a state: bytes of large arrays that may still lie in the memory; bytes from which an array is large; the
address of the name of the folder of the files; the number of the last error of the system, -1 where a file could not be
made; end of the places in use."""
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
def take(state: Any, size: int, zero: bool) -> int:
    """Return the address of so many bytes, 0 where there are none."""
    at = len(state) if size < state[LARGE] else find(state, 0)
    if at == len(state):
        return int(calloc(1, size) if zero else malloc(size))
    kept = size <= state[ROOM]
    place = (calloc(1, size) if zero else malloc(size)) if kept else map_file(state, size)
    if place:
        state[at], state[at + 1] = place, -size if kept else size
        state[ROOM] -= size if kept else 0
        state[TOP] = max(state[TOP], at + 2)
    return int(place)


@_compiled
def give_back(state: Any, place: int) -> None:
    """Take bytes back."""
    at = find(state, place)
    size = state[at + 1] if place and at < state[TOP] else 0
    if size > 0:
        munmap(place, size)
    else:
        state[ROOM] -= size
        free(place)
    if size:
        state[at] = 0
    while state[TOP] > FIRST and state[state[TOP] - 2] == 0:
        state[TOP] -= 2


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


@_compiled
def leave(state: Any) -> None:
    """Let the pages of all files go; they are read again where they are needed."""
    for at in range(FIRST, state[TOP], 2):
        if state[at] and state[at + 1] > 0:
            madvise(state[at], state[at + 1], DONTNEED)


def entries(length: int) -> dict[str, Any]:
    """Compile what NumPy calls, and ``leave``, over states of a length; each has its ``address``."""

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
    def leave_(state: Any) -> None:
        leave(numba.carray(state, length))

    return {"malloc": malloc_, "calloc": calloc_, "realloc": realloc_, "free": free_, "leave": leave_}
