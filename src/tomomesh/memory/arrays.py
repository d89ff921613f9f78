"""Where the data of NumPy's arrays lie: NumPy asks the functions of a handler that it was given (NEP 49)."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

from .pages import Pages, system

if TYPE_CHECKING:
    from collections.abc import Callable

LARGE = 1 << 22
"""Bytes from which an array may lie in a file. Chosen: with a quarter of it a run takes 6 % more time, for no less
memory that counts."""
SET_HANDLER = 304
"""The place of ``PyDataMem_SetHandler`` in NumPy's table of functions, which keeps its order for good."""
CAPSULE = ctypes.create_string_buffer(b"mem_handler")

_ADDRESS, _SIZE = ctypes.c_void_p, ctypes.c_size_t
_FUNCTIONS = (
    ("malloc", ctypes.CFUNCTYPE(_ADDRESS, _ADDRESS, _SIZE)),
    ("calloc", ctypes.CFUNCTYPE(_ADDRESS, _ADDRESS, _SIZE, _SIZE)),
    ("realloc", ctypes.CFUNCTYPE(_ADDRESS, _ADDRESS, _ADDRESS, _SIZE)),
    ("free", ctypes.CFUNCTYPE(None, _ADDRESS, _ADDRESS, _SIZE)),
)


class _Allocator(ctypes.Structure):
    """``PyDataMemAllocator``."""

    _fields_ = (("ctx", _ADDRESS), *_FUNCTIONS)


class _Handler(ctypes.Structure):
    """``PyDataMem_Handler``, version 1."""

    _fields_ = (("name", ctypes.c_char * 127), ("version", ctypes.c_uint8), ("allocator", _Allocator))


class Arrays:
    """The functions of a handler: large arrays lie in files, but for the first few.

    Parameters
    ----------
    pages : Pages
    room : int
        Bytes of large arrays that are left in the memory.
    """

    def __init__(self, pages: Pages, room: int) -> None:
        self.pages, self.room = pages, room
        self._here: dict[int, int] = {}
        """Sizes of the large arrays in the memory, by their addresses."""
        functions = [kind(getattr(self, name)) for name, kind in _FUNCTIONS]
        self._handler = _Handler(b"tomomesh", 1, _Allocator(None, *functions))
        self.capsule: Any = _api().PyCapsule_New(ctypes.addressof(self._handler), ctypes.addressof(CAPSULE), None)
        _LASTING.append((self, functions))

    def malloc(self, _: int | None, size: int) -> int | None:
        """Return the address of so many bytes; None where there are none."""
        return self._taken(size, lambda: system().malloc(size))

    def calloc(self, _: int | None, count: int, each: int) -> int | None:
        """Return the address of so many bytes, all 0."""
        return self._taken(count * each, lambda: system().calloc(count, each))

    def realloc(self, _: int | None, place: int | None, size: int) -> int | None:
        """Return the address of as many bytes as are asked for now, with what was there."""
        before = None if place is None else self.pages.size(place)
        if before is None or place is None:
            self.room += self._here.pop(place or 0, 0)
            return system().realloc(place, size)  # type: ignore[no-any-return]
        found = self.malloc(None, size)
        if found is not None:
            ctypes.memmove(found, place, min(before, size))
            self.pages.give_back(place)
        return found

    def free(self, _: int | None, place: int | None, size: int) -> None:
        """Take bytes back."""
        if place is not None and self.pages.size(place) is not None:
            self.pages.give_back(place)
            return
        self.room += self._here.pop(place or 0, 0)
        system().free(place)

    def _taken(self, size: int, here: Callable[[], int | None]) -> int | None:
        if size >= LARGE and size > self.room:
            return self.pages.take(size)
        place = here()
        if place is not None and size >= LARGE:
            self._here[place] = size
            self.room -= size
        return place


_LASTING: list[Any] = []
"""Handlers, and the functions of each: arrays that they made may be there until the process ends."""


def swapped(capsule: Any) -> Any:
    """Have NumPy ask another handler from now on, in this thread; return the one before."""
    from numpy._core import _multiarray_umath

    table = _api().PyCapsule_GetPointer(_multiarray_umath._ARRAY_API, None)  # type: ignore[attr-defined] # as import_array() of NumPy's headers does
    address = ctypes.cast(table, ctypes.POINTER(ctypes.c_void_p))[SET_HANDLER]
    return ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object)(address or 0)(capsule)


def _api() -> Any:
    """Return Python's functions on capsules, typed."""
    api = ctypes.pythonapi
    api.PyCapsule_New.restype = ctypes.py_object
    api.PyCapsule_New.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return api
