"""A process that compiles kernels for another: names in, machine code out, a line each."""

from __future__ import annotations

import gc
import os
import signal
import sys
from base64 import b64encode
from importlib import import_module
from threading import Thread

from .code import OURS

OBJECTS = 100_000
"""New objects at which Python looks for garbage: Numba makes many that stay, and at Python's own 700 it looks for a
twentieth of the time."""


def serve() -> None:
    """Answer until nobody asks any more; then, or when who asks is gone, end at once."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(OBJECTS)
    for name in sys.stdin:
        Thread(target=_answer, args=(name.strip(),), daemon=True).start()
    os._exit(0)


def _answer(name: str) -> None:
    """Write a kernel's code, and nothing where it cannot be made."""
    from .compiler import code_of

    module, _, function = name.rpartition(".")
    try:
        packed = code_of(getattr(import_module(OURS + module), function)).packed()
    except Exception:  # who asks will see it, compiling the kernel itself
        packed = b""
    sys.stdout.buffer.write(b64encode(packed) + b"\n")
    sys.stdout.buffer.flush()
