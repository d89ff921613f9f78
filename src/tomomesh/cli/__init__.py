"""The command line: parse, read, call, write."""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
import time
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from . import shell
from .faults import as_error, is_full
from .options import build_parser
from .options.commands import TOLD
from .options.parameters import joined

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from types import FrameType
    from typing import TextIO

INTERRUPTED, TERMINATED = 130, 143


class _Terminated(BaseException):
    """SIGTERM, raised where the program is, so that nothing is left behind."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``tomomesh`` and return its exit code; every fault is one line on stderr, and all is put back."""
    with _terminated(), _printable(sys.stdout, sys.stderr):
        return _told(sys.argv[1:] if arguments is None else arguments)


def _told(arguments: Sequence[str]) -> int:
    """Run, and put every fault into one line."""
    try:
        try:
            return _run(arguments)
        finally:
            print(end="", flush=True)  # here, so that a pipe that was closed early, or a full disk, is noticed
    except BrokenPipeError:  # who reads it has left, as `head` does
        _drop(sys.stdout, sys.stderr)
        return 0
    except Exception as fault:
        if is_full(fault):
            _drop(sys.stdout)
        error = as_error(fault)
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code


def _run(arguments: Sequence[str]) -> int:
    try:
        begun = time.perf_counter()
        chosen = build_parser().parse_args(joined(arguments))
        chosen.begun, chosen.words = begun, tuple(arguments)
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


@contextmanager
def _printable(*streams: TextIO) -> Iterator[None]:
    """Print what a stream's encoding lacks as question marks, and put the streams back as they were."""
    texts = [stream for stream in streams if isinstance(stream, io.TextIOWrapper)]
    before = [stream.errors for stream in texts]
    for stream in texts:
        stream.reconfigure(errors="replace")
    try:
        yield
    finally:
        for stream, errors in zip(texts, before, strict=True):
            with suppress(OSError, ValueError):  # what could not be written was told; a stream may be closed by now
                stream.reconfigure(errors=errors)


@contextmanager
def _terminated() -> Iterator[None]:
    """Raise SIGTERM as an exception, and put the handler back that was there; only a main thread can."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    finally:
        # None: a handler that was not set from Python, and cannot be named
        signal.signal(signal.SIGTERM, signal.SIG_DFL if before is None else before)


def _terminate(number: int, frame: FrameType | None) -> None:
    raise _Terminated


def _drop(*streams: TextIO) -> None:
    """Let what is still to be written go nowhere."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in streams:
        os.dup2(nowhere, stream.fileno())
