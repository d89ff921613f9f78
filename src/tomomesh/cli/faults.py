"""Whatever is raised, as one of tomomesh's own errors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import NO_ROOM, InternalCheckError, OutputError, ResourceError, TomomeshError

if TYPE_CHECKING:
    from typing import TypeGuard


def as_error(fault: Exception) -> TomomeshError:
    """Return the error that a user is told; a traceback shown to a user is a bug, so it says where it is instead."""
    if isinstance(fault, TomomeshError):
        return fault
    if isinstance(fault, MemoryError):
        return ResourceError("the machine's memory is full", hint="a larger --cell-mm, or fewer slices")
    if is_full(fault):
        return OutputError("there is no room for what is written", found=str(fault.strerror).lower())
    # not in its own words: they may quote what a study says of a patient
    return InternalCheckError(f"a bug: {type(fault).__name__} in {_place(fault)}")


def is_full(fault: Exception) -> TypeGuard[OSError]:
    """Tell whether something could not be written for want of room."""
    return isinstance(fault, OSError) and fault.errno in NO_ROOM


def _place(fault: BaseException) -> str:
    """Name the module and line where a fault arose, without any path."""
    trace = fault.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return "nowhere" if trace is None else f"{trace.tb_frame.f_globals.get('__name__')}:{trace.tb_lineno}"
