"""Compile side by side, in processes of Python that end with this one."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from base64 import b64decode
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING

from ..threads import cores
from .code import Code, keep

if TYPE_CHECKING:
    from collections.abc import Iterable

SERVE = "import sys; sys.path[:] = {}; from tomomesh.kernels.native.worker import serve; serve()"
PAUSE_S = 0.1
"""How long a wait goes on before it looks for Ctrl-C, which some systems do not tell of within one."""

_changed = threading.Condition()
_made: dict[str, Code | None] = {}
_waiting: deque[str] = deque()
_underway: set[str] = set()
_urgent: set[str] = set()
"""Kernels that are waited for."""
_threads: set[threading.Thread] = set()
_stops = 0


def compiled(name: str, others: Iterable[str] = ()) -> Code | None:
    """Return a kernel's code as another process makes it; others follow while the caller goes on.

    None if no process can be started, or none can make it.
    """
    if not _can_start():
        return None
    with _changed:
        stops = _stops
        _urgent.add(name)
        _waiting.extend(one for one in (name, *others) if one not in {*_made, *_underway, *_waiting})
        if name in _waiting:
            _waiting.remove(name)
            _waiting.appendleft(name)
        _hire()
        while name not in _made:
            _changed.wait(PAUSE_S)
            if stops != _stops:
                raise KeyboardInterrupt
        return _made[name]


def stop_waiting() -> None:
    """Tell the threads that wait for a kernel that the run was stopped."""
    global _stops
    with _changed:
        _stops += 1
        _waiting.clear()
        _changed.notify_all()


def _can_start() -> bool:
    """Tell whether our interpreter is a Python, and no program that holds one."""
    return "python" in Path(sys.executable or "").name.lower() and not getattr(sys, "frozen", False)


def _hire() -> None:
    for _ in range(min(cores(), len(_waiting)) - len(_threads)):
        thread = threading.Thread(target=_work, daemon=True)
        _threads.add(thread)
        thread.start()


def _work() -> None:
    """Keep one process at work until nothing waits."""
    try:
        with subprocess.Popen(
            [sys.executable, "-c", SERVE.format(sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        ) as process:
            name = ""
            while name := _next(name):
                _put(name, _asked(process, name))
    except OSError:
        while name := _next():
            _put(name, None)


def _next(last: str = "") -> str:
    """Take the next kernel; where there is none the thread is not counted on any more.

    The first is waited for. Then those of the folder of the last are taken: they call what is compiled there already.
    """
    with _changed:
        if not _waiting:
            _threads.discard(threading.current_thread())
            return ""
        folder = last.partition(".")[0]
        near = (one for one in _waiting if one.partition(".")[0] == folder)
        name = _waiting[0] if _waiting[0] in _urgent else next(near, _waiting[0])
        _waiting.remove(name)
        _underway.add(name)
        return name


def _asked(process: subprocess.Popen[bytes], name: str) -> Code | None:
    """Return the answer of a process; none if it ended."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(name.encode() + b"\n")
        process.stdin.flush()
        return Code.unpacked(b64decode(process.stdout.readline()))
    except OSError:
        return None


def _put(name: str, code: Code | None) -> None:
    if code is not None:
        keep(name, code)
    with _changed:
        _made[name] = code
        _underway.discard(name)
        _changed.notify_all()


def _forget() -> None:
    """Begin anew in a copy of this process, where no thread works."""
    global _changed
    _changed = threading.Condition()
    for kept in (_waiting, _underway, _urgent, _threads):
        kept.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
