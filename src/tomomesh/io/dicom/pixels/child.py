"""The child process that decodes compressed frames, seen from its parent: one for a study."""

from __future__ import annotations

import io
import json
import math
import os
import signal
import subprocess
import sys
from contextlib import suppress
from threading import Timer
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import FormatError, ResourceError
from . import decoding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .layout import PixelLayout

PROGRAM = decoding.__file__

PATIENCE = 3
"""Seconds on the clock for each second of the processor: the machine may be busy with three times its cores."""

FRAME_TYPES = {f"{order}{kind}{size}" for order in "<|" for kind in "iu" for size in (1, 2, 4, 8)}
"""What a frame of numbers may consist of."""

LONGEST_ANSWER = 2**12
"""Bytes of the line in front of a frame: it has a shape, a type and a word, about 100."""

EXTRA = 'pip install "tomomesh[dicom]"'


class Child:
    """A process with little memory and time, and no files, that decodes frame after frame.

    Nothing that it does is trusted: a crash, a limit or a wrong answer is an error of the file.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._frame_bytes = 0

    def decode(self, code: bytes, layout: PixelLayout) -> tuple[NDArray[Any], str]:
        """Return the stored numbers of a compressed frame, and what they stand for.

        Raises
        ------
        FormatError
            For a frame that cannot be decoded.
        ResourceError
            For one that takes too long, or more memory than its size explains.
        """
        process = self.ready(layout.frame_bytes)
        clock = Timer(PATIENCE * decoding.seconds_for(layout.frame_bytes), process.kill)
        clock.start()
        try:
            return self._asked(process, code, layout)
        except (OSError, ValueError, KeyError, TypeError):
            raise self._fault(process, layout, late=not clock.is_alive()) from None
        finally:
            clock.cancel()

    def ready(self, frame_bytes: int) -> subprocess.Popen[bytes]:
        """Return the process, a new one where it would have too little memory for a frame."""
        if self._process is None or frame_bytes > self._frame_bytes:
            self.end()
            self._process, self._frame_bytes = _started(frame_bytes), frame_bytes
        return self._process

    def _asked(self, process: subprocess.Popen[bytes], code: bytes, layout: PixelLayout) -> tuple[NDArray[Any], str]:
        assert process.stdin is not None
        assert isinstance(process.stdout, io.BufferedReader)
        options = {**layout.options(), "number_of_frames": 1, "correct_unused_bits": False}
        job = {
            "syntax": str(layout.syntax),
            "bytes": len(code),
            "frame_bytes": layout.frame_bytes,
            "options": options,
        }
        process.stdin.write(json.dumps(job).encode() + b"\n" + code)
        process.stdin.flush()
        head = json.loads(process.stdout.readline(LONGEST_ANSWER))
        if "fault" in head:
            raise _refusal(str(head["fault"]), layout)
        if tuple(head["shape"]) != layout.shape or head["kind"] not in FRAME_TYPES:
            raise ValueError
        pixels = np.empty(layout.shape, head["kind"])
        if process.stdout.readinto(pixels.reshape(-1).view(np.uint8).data) != pixels.nbytes:
            raise ValueError
        return pixels, str(head["photometric"])

    def _fault(self, process: subprocess.Popen[bytes], layout: PixelLayout, *, late: bool) -> Exception:
        """Return what to say of a child that did not answer as it should; it is ended."""
        with suppress(subprocess.TimeoutExpired):
            process.wait(0.5)  # a crash takes a moment to be known
        code = process.poll()
        self.end()
        if late or code == -getattr(signal, "SIGXCPU", 0) != 0:
            return ResourceError(
                "the compressed pixels take too long to decode",
                file=layout.name,
                found=f"TransferSyntaxUID = {layout.syntax.name}",
                expected=f"at most {decoding.seconds_for(layout.frame_bytes)} s a frame",
            )
        return _refusal("crash" if code else "answer", layout)

    def end(self) -> None:
        """End the process, whatever it is doing."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError):
                if pipe is not None:
                    pipe.close()


def _started(frame_bytes: int) -> subprocess.Popen[bytes]:
    """Start the process: with the packages of this one, and nothing else of its environment."""
    kept = {name: os.environ[name] for name in ("SYSTEMROOT", "LD_LIBRARY_PATH", "TMPDIR") if name in os.environ}
    packages = os.pathsep.join(path for path in sys.path if path)
    return subprocess.Popen(
        [sys.executable, "-P", "-B", PROGRAM, str(frame_bytes)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**kept, "PYTHONPATH": packages, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        start_new_session=True,  # Ctrl-C is for the parent, which ends the child
    )


def _refusal(fault: str, layout: PixelLayout) -> Exception:
    """Return what to say of a frame that the child could not decode."""
    found = f"TransferSyntaxUID = {layout.syntax.name}"
    if fault == decoding.MISSING:
        return FormatError("the compression of the pixels cannot be decoded", file=layout.name, found=found, hint=EXTRA)
    if fault == decoding.FULL:
        return ResourceError(
            "the compressed pixels take too much memory to decode",
            file=layout.name,
            found=found,
            expected=f"at most {decoding.WORKING_COPIES} times the {math.prod(layout.shape)} pixels of a frame",
        )
    return FormatError(
        "the compressed pixels cannot be decoded",
        file=layout.name,
        found=f"{found}, {fault}",
        expected="a whole and valid stream",
    )
