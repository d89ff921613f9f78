"""Kernels: functions that run as machine code from their first call on."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import update_wrapper
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])

COMPILED = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")
"""Whether kernels run as machine code; else they are plain Python."""


class Kernel:
    """A function of one signature that is brought into the process as machine code when it is first called.

    Its arguments are checked: arrays of the very type and order, or a TypeError is raised.
    """

    def __init__(self, signature: str, function: Callable[..., Any]) -> None:
        update_wrapper(self, function)
        self.function, self.signature = function, signature
        self.call: Callable[..., Any] = self._first_call

    def __call__(self, *arguments: Any) -> Any:
        """Run the machine code."""
        return self.call(*arguments)

    def _first_call(self, *arguments: Any) -> Any:
        from .native.load import loaded

        self.call = loaded(self)
        return self.call(*arguments)

    @property
    def _numba_type_(self) -> Any:
        """What Numba asks of a global that it does not know, when it compiles a kernel that calls this one."""
        from .native.compiler import inner

        return inner(self)._numba_type_


def kernel(signature: str) -> Callable[[Function], Function]:
    """Say that a function is a kernel: compiled for one signature, called without the interpreter's lock."""

    def declare(function: Function) -> Function:
        return cast("Function", Kernel(signature, function)) if COMPILED else function

    return declare
