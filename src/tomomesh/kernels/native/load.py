"""From a kernel to a function that runs: out of the cache, or compiled and kept there."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from ..compile import Kernel
from .call import caller
from .code import OURS, keep, kept, read
from .linker import address_of
from .workers import compiled

if TYPE_CHECKING:
    from collections.abc import Callable

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
    """Name the kernels that are not in the cache and that modules in use can call."""
    callers = [vars(module) for name, module in [*sys.modules.items()] if _calls(name)]
    found = {_name(one): None for names in callers for one in [*names.values()] if isinstance(one, Kernel)}
    return [name for name in found if not kept(name)]


def _calls(module: str) -> bool:
    """Tell whether a module is one of ours that call kernels; kernels are compiled into those that call them."""
    return module.startswith("tomomesh.") and not module.startswith(OURS)
