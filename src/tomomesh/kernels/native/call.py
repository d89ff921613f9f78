"""Call the entry that Numba makes for Python, after the checks that Numba makes before."""

from __future__ import annotations

import re
from ctypes import PYFUNCTYPE, c_void_p, py_object
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

PARTS = re.compile(r"(?:Uni)?Tuple\((?:[^()]|\([^()]*\))*\)|\w+(?:\[[^\]]*\])?")
"""The types in a signature: that of the result, then those of the arguments."""
ENTRY = PYFUNCTYPE(py_object, py_object, py_object, c_void_p)
"""Of a function in C: what it is bound to, its arguments in a tuple, and those with names."""


def caller(address: int, signature: str, name: str) -> Callable[..., Any]:
    """Return a function that runs machine code; the entry sees to the number of arguments, and to scalars.

    It does not look at the type, order and dimensions of arrays: with others than those it would write anywhere.
    """
    _, *kinds = PARTS.findall(signature)
    arrays = [
        (n, np.dtype(kind[:2]), kind.count(",") + 1, "::1" in kind) for n, kind in enumerate(kinds) if "[" in kind
    ]
    entry = ENTRY(address)

    def call(*arguments: Any) -> Any:
        try:
            for n, dtype, ndim, packed in arrays:
                array = arguments[n]
                flags = array.flags
                if array.dtype != dtype or array.ndim != ndim or not (flags.carray if packed else flags.behaved):
                    raise TypeError(f"{name}: argument {n} is not a writable array of type {kinds[n]}")
        except (AttributeError, IndexError):
            raise TypeError(f"{name} takes {', '.join(kinds)}") from None
        return entry(None, arguments, None)

    return call
