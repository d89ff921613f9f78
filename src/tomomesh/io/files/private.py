"""A folder for what nobody else may see, gone when the work ends, however it ends."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import OutputError

if TYPE_CHECKING:
    from collections.abc import Iterator

GUARD = "import shutil, sys; sys.stdin.read(); shutil.rmtree(sys.argv[1], ignore_errors=True)"
"""What the guard runs: its input ends when this process does, be it by kill -9."""


@contextmanager
def private_folder() -> Iterator[Path]:
    """Make a temporary folder that only this user may enter, and remove it afterwards.

    A second, small process removes it where this one is killed and cannot.

    Raises
    ------
    OutputError
        Where it cannot be made.
    """
    with _temporary() as folder:
        command = [sys.executable, "-I", "-S", "-c", GUARD, folder]
        # a session of its own: a signal to the whole group of processes does not end it
        with subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        ):
            yield Path(folder)


def _temporary() -> tempfile.TemporaryDirectory[str]:
    try:
        return tempfile.TemporaryDirectory(prefix="tomomesh-", ignore_cleanup_errors=True)
    except OSError as fault:
        raise OutputError(
            "no temporary folder can be made", found=str(fault.strerror).lower(), hint="TMPDIR=FOLDER, one with room"
        ) from None
