"""The command line: parse, read, call, write."""

from __future__ import annotations

import io
import signal
import sys
from typing import TYPE_CHECKING

from ..errors import InternalCheckError, ResourceError, TomomeshError
from .options import build_parser, joined

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import FrameType

INTERRUPTED, TERMINATED = 130, 143


class _Terminated(BaseException):
    """SIGTERM, raised where the program is, so that nothing is left behind."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``tomomesh`` and return its exit code; every fault is one line on stderr."""
    signal.signal(signal.SIGTERM, _terminate)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        chosen = build_parser().parse_args(joined(sys.argv[1:] if arguments is None else arguments))
        from . import commands

        commands.run(chosen)
        return 0
    except TomomeshError as fault:
        return _complain(fault)
    except MemoryError:
        return _complain(ResourceError("the machine's memory is full", hint="a larger --cell-mm, or fewer slices"))
    except KeyboardInterrupt:
        print("\ninterrupted; no unfinished file is left", file=sys.stderr)
        return INTERRUPTED
    except _Terminated:
        return TERMINATED
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except Exception as fault:  # a traceback shown to a user is a bug: say where it is instead
        return _complain(InternalCheckError(f"a bug: {type(fault).__name__} in {_place(fault)}", found=str(fault)))


def _terminate(number: int, frame: FrameType | None) -> None:
    raise _Terminated


def _complain(fault: TomomeshError) -> int:
    print(f"error: {fault}", file=sys.stderr)
    return fault.exit_code


def _place(fault: BaseException) -> str:
    """Name the module and line where a fault arose, without any path."""
    trace = fault.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return "nowhere" if trace is None else f"{trace.tb_frame.f_globals.get('__name__')}:{trace.tb_lineno}"
