"""From a kernel to a function that runs: out of the cache, or compiled and kept there."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any, TypeGuard

from ..compile import Kernel
from .call import caller
from .code import OURS, keep, kept, read
from .linker import address_of
from .workers import compiled

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

    from .code import Code


def loaded(kernel: Kernel) -> Callable[..., Any]:
    """Return a kernel as a function that runs machine code."""
    try:
        return caller(address_of(_code(kernel)), kernel.signature, kernel.__name__)
    except Exception:  # whatever keeps this system from it, Numba can still call what it compiles
        from .compiler import dispatcher

        whole: Callable[..., Any] = dispatcher(kernel)
        return whole


def _code(kernel: Kernel) -> Code:
    """Return the code of a kernel: kept, or made elsewhere, or here; the cache knows the sources of ours alone."""
    if not kernel.__module__.startswith(OURS):
        return _made(kernel)
    name = _name(kernel)
    if code := read(name) or compiled(name, _wanted()):
        return code
    code = _made(kernel)
    keep(name, code)
    return code


def _made(kernel: Kernel) -> Code:
    from .compiler import code_of

    return code_of(kernel)


def _name(kernel: Kernel) -> str:
    return f"{kernel.__module__.removeprefix(OURS)}.{kernel.__name__}"


def _wanted() -> list[str]:
    """Name the kernels that are not in the cache and that the code underway can call, in any thread."""
    reached = dict.fromkeys(name for frame in sys._current_frames().values() for name in _modules(frame))
    found: dict[str, None] = {}
    for name in (waiting := [*reached]):
        for one in [*vars(sys.modules[name]).values()]:
            if isinstance(one, Kernel):
                found[_name(one)] = None
            elif (other := getattr(one, "__module__", None)) not in reached and _calls(other):
                reached[other] = None
                waiting.append(other)
    return [name for name in found if not kept(name)]


def _modules(frame: FrameType | None) -> Iterator[str]:
    """Yield the modules of ours that a frame and its callers run in."""
    while frame is not None:
        if _calls(name := frame.f_globals.get("__name__")):
            yield name
        frame = frame.f_back


def _calls(module: Any) -> TypeGuard[str]:
    """Tell whether a module is one of ours that call kernels; kernels are compiled into those that call them."""
    ours = isinstance(module, str) and module.startswith("tomomesh.") and not module.startswith(OURS)
    return ours and module in sys.modules
