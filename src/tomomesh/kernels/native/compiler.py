"""Make machine code with Numba: the one place that imports it."""

from __future__ import annotations

import warnings
from functools import cache
from typing import TYPE_CHECKING, Any

import numba
import numpy as np

from .code import Code

if TYPE_CHECKING:
    from ..compile import Kernel


@cache
def dispatcher(kernel: Kernel) -> Any:
    """Return a kernel as Numba compiles and calls it."""
    return _compiled(kernel)


@cache
def inner(kernel: Kernel) -> Any:
    """Return a kernel as other kernels call it, without what Python needs: a fifth of the time of compiling."""
    return _compiled(kernel, no_cpython_wrapper=True)


def _compiled(kernel: Kernel, **options: bool) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", numba.NumbaWarning)
        options |= {"nogil": True, "no_cfunc_wrapper": True, "_nrt": _makes_arrays(kernel.function.__code__.co_names)}
        return numba.njit(kernel.signature, error_model="numpy", **options)(kernel.function)


def _makes_arrays(names: tuple[str, ...]) -> bool:
    """Tell whether code may make arrays: whether it names a function of NumPy that gives no number for a number.

    Where none is made no references are counted, which is an eighth of the time of compiling.
    """
    named = (getattr(np, name, None) for name in names if name != "shape")
    return any(callable(one) and not isinstance(one, (type, np.ufunc)) for one in named)


def code_of(kernel: Kernel) -> Code:
    """Return the machine code of a kernel.

    Raises
    ------
    ValueError
        If the code holds what exists in this process only.
    """
    (compiled,) = dispatcher(kernel).overloads.values()
    library, names = compiled.library, compiled.fndesc
    if library.has_dynamic_globals or compiled.environment.consts:
        raise ValueError(f"{kernel.__name__} refers to objects of this process")
    _, _, (machine, _) = library.serialize_using_object_code()
    return Code(names.llvm_cpython_wrapper_name, names.env_name, tuple(_externals(library)), machine)


def _externals(library: Any) -> list[str]:
    """Name what the code calls and does not hold, but for what the compiler itself translates."""
    module = library._final_module
    values = [*module.functions, *module.global_variables]
    return sorted(one.name for one in values if one.is_declaration and not one.name.startswith("llvm."))
