"""The command line: parse, read, call, write."""

from __future__ import annotations

import io
import os
import signal
import sys
from typing import TYPE_CHECKING

from . import shell
from .faults import as_error
from .options import TOLD, build_parser, joined

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
        try:
            return _run(sys.argv[1:] if arguments is None else arguments)
        finally:
            sys.stdout.flush()  # here, so that a pipe that was closed early is noticed
    except BrokenPipeError:
        return _leave_quietly()


def _run(arguments: Sequence[str]) -> int:
    try:
        chosen = build_parser().parse_args(joined(arguments))
        if chosen.command in TOLD:
            shell.tell(chosen)
            return 0
        from . import commands

        commands.run(chosen)
        return 0
    except KeyboardInterrupt:
        print("\ninterrupted; no unfinished file is left", file=sys.stderr)
        return INTERRUPTED
    except _Terminated:
        return TERMINATED
    except BrokenPipeError:
        raise
    except Exception as fault:
        error = as_error(fault)
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code


def _terminate(number: int, frame: FrameType | None) -> None:
    raise _Terminated


def _leave_quietly() -> int:
    """Let what is still to be written go nowhere: who reads it has left, as ``head`` does."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        os.dup2(nowhere, stream.fileno())
    return 0
