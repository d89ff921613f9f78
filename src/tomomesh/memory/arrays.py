"""Where the data of NumPy's arrays lie: NumPy asks the functions of a handler that it was given (NEP 49)."""

from __future__ import annotations

import ctypes
import threading
import time
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

LARGE = 1 << 22
"""Bytes from which an array may lie in a file. Chosen: with a quarter of it a run takes 6 % more time, for no less
memory that counts."""
MANY = 1 << 12
"""Large arrays at once; more of them lie in the memory. A run of a cloud has 45 at most."""
LOOK_US = 1000
"""How often the memory is looked at, microseconds: a processor fills some 10 MB meanwhile."""
SET_HANDLER = 304
"""The place of ``PyDataMem_SetHandler`` in NumPy's table of functions, which keeps its order for good."""
CAPSULE = ctypes.create_string_buffer(b"mem_handler")


class _Handler(ctypes.Structure):
    """``PyDataMem_Handler``, version 1: a name, and what is called with `state`."""

    _fields_ = (
        ("name", ctypes.c_char * 127),
        ("version", ctypes.c_uint8),
        *((name, ctypes.c_void_p) for name in ("state", "malloc", "calloc", "realloc", "free")),
    )


class Arrays:
    """A handler whose large arrays lie in files without a name, but for the first few.

    A file is gone with its array, however the process ends.

    Parameters
    ----------
    folder : path
        Where the files are, on a disk; nobody else may read them.
    room : int
        Bytes of large arrays that are left in the memory.
    """

    def __init__(self, folder: Path, room: int) -> None:
        self._name = ctypes.create_string_buffer(bytes(folder))
        places = _places()
        self._state = np.zeros(places.FIRST + 2 * MANY, np.int64)
        self._state[[places.ROOM, places.LARGE, places.FOLDER]] = room, LARGE, ctypes.addressof(self._name)
        self._state[[places.SELF, places.STATM]] = self._state.ctypes.data, -1
        made = {name: entry.address for name, entry in _entries().items()}
        self._watch = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(made.pop("watch"))  # without the interpreter's lock
        self._handler = _Handler(b"tomomesh", 1, self._state.ctypes.data, **made)
        self.capsule: Any = _api().PyCapsule_New(ctypes.addressof(self._handler), ctypes.addressof(CAPSULE), None)
        _api().Py_IncRef(self)  # for good: its arrays may be there until the process ends

    @property
    def fault(self) -> int:
        """The number of the system's error for which an array found no room last; -1 where no file could be made."""
        return int(self._state[_places().FAULT])

    @contextmanager
    def watched(self, full: int) -> Iterator[None]:
        """Let the pages of all files go whenever more than so many bytes of this process are or would be in the memory.

        Others may be at work on them: they are read again where they are needed.
        """
        places, state = _places(), self._state
        watcher = threading.Thread(target=self._watch, args=(state.ctypes.data,), daemon=True)
        with Path("/proc/self/statm").open("rb", buffering=0) as statm:
            state[[places.FULL, places.LOOK, places.DONE]] = full // places.PAGE, LOOK_US, 1
            state[places.STATM] = statm.fileno()
            watcher.start()
            while state[places.DONE]:  # else a call that holds the interpreter's lock could keep it from beginning
                time.sleep(LOOK_US / 1e6)
            try:
                yield
            finally:
                state[places.DONE] = 1
                watcher.join()
                state[places.STATM] = -1


@cache
def _entries() -> dict[str, Any]:
    """Compile what NumPy calls; kept for good, as what was made by it."""
    from ..kernels.native.allocator import entries

    made = entries(_places().FIRST + 2 * MANY)
    _api().Py_IncRef(made)
    return made


def _places() -> Any:
    """Import what needs the compiler: the places in a state."""
    from ..kernels.native import allocator

    return allocator


def swapped(capsule: Any) -> Any:
    """Have NumPy ask another handler from now on, in this thread; return the one before."""
    functions = import_module("numpy._core._multiarray_umath")._ARRAY_API  # as import_array() of its headers does
    table = _api().PyCapsule_GetPointer(functions, None)
    address = ctypes.cast(table, ctypes.POINTER(ctypes.c_void_p))[SET_HANDLER]
    return ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object)(address or 0)(capsule)


def _api() -> Any:
    """Return Python's own functions, typed."""
    api = ctypes.pythonapi
    api.Py_IncRef.argtypes = [ctypes.py_object]
    api.PyCapsule_New.restype = ctypes.py_object
    api.PyCapsule_New.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return api
