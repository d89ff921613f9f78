"""The program of the child process that decodes compressed frames: it opens nothing, and writes to one pipe.

It is run by its path, not as a module of tomomesh, so that it imports only what decodes. It talks in lines of JSON,
each with the number of raw bytes that follow: never in pickles.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import sys
import warnings
from importlib import import_module
from typing import Any, BinaryIO

LIBRARY_BYTES = 2**31
"""Address space for Python, NumPy and the decoders: ten times the 200 MB that they were measured to take on Linux."""

WORKING_COPIES = 32
"""A decoder may hold this many times the bytes of a frame: integers of 32 bits, colors in floats, copies."""

LEAST_SECONDS, SLOWEST_BYTES_PER_SECOND = 20, 2**20
"""Time of the processor for a frame: at least this, and more for large ones. The slowest decoder, of JPEG 2000, was
measured at 10 MB/s, ten times as fast."""

MISSING, FULL = "missing", "MemoryError"
"""Faults with a meaning of their own; any other is the bare name of an exception."""

EXTENDED, LOSSLESS = "1.2.840.10008.1.2.4.51", "1.2.840.10008.1.2.4.57"


def seconds_for(frame_bytes: int) -> int:
    """Return the seconds of the processor that a frame may take."""
    return LEAST_SECONDS + frame_bytes // SLOWEST_BYTES_PER_SECOND


def confine(frame_bytes: int) -> None:
    """Give up, for good, core dumps, new files, new processes and most of the memory; where the system can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    memory = LIBRARY_BYTES + WORKING_COPIES * frame_bytes
    limits = {"CORE": 0, "FSIZE": 0, "NOFILE": 0, "NPROC": 0, "AS": memory}
    for name, limit in limits.items():
        with contextlib.suppress(AttributeError, ValueError, OSError):  # limits that this system does not have
            resource.setrlimit(getattr(resource, f"RLIMIT_{name}"), (limit, limit))


def allow_time(seconds: int) -> None:
    """Let the system end this process after so many more seconds of the processor."""
    try:
        import resource
    except ImportError:
        return
    used = resource.getrusage(resource.RUSAGE_SELF)
    most = resource.getrlimit(resource.RLIMIT_CPU)[1]
    with contextlib.suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_CPU, (int(used.ru_utime + used.ru_stime) + 1 + seconds, most))


def decode(job: dict[str, Any], code: bytes) -> tuple[Any, str]:
    """Return a frame's numbers, and what they stand for after colors were converted."""
    import numpy as np
    from pydicom.encaps import encapsulate
    from pydicom.pixels import get_decoder

    syntax, options = job["syntax"], job["options"]
    if syntax == EXTENDED and options["bits_stored"] > 8:
        syntax = LOSSLESS  # GDCM finds the process in the stream; pydicom does not let it try under this name
    decoder = get_decoder(syntax)
    if not decoder.is_available:
        raise ModuleNotFoundError
    pixels, found = decoder.as_array(encapsulate([code], has_bot=False), index=0, **options)
    return np.ascontiguousarray(pixels), str(found["photometric_interpretation"])


def answer(job: dict[str, Any], code: bytes) -> tuple[dict[str, Any], Any]:
    """Return the head of the answer to a job, and the bytes behind it."""
    try:
        pixels, photometric = decode(job, code)
    except ModuleNotFoundError:
        return {"fault": MISSING}, b""
    except MemoryError:
        return {"fault": FULL}, b""
    except Exception as fault:
        return {"fault": type(fault).__name__}, b""
    return {"kind": pixels.dtype.str, "shape": pixels.shape, "photometric": photometric}, pixels.data


def serve(jobs: BinaryIO, answers: BinaryIO) -> None:
    """Answer jobs until there are no more."""
    while line := jobs.readline():
        job = json.loads(line)
        allow_time(seconds_for(job["frame_bytes"]))
        head, body = answer(job, jobs.read(job["bytes"]))
        answers.write(json.dumps(head).encode() + b"\n")
        answers.write(body)
        answers.flush()


def prepare() -> None:
    """Import whatever decodes, while files may still be opened."""
    for name in ("pydicom.encaps", "pydicom.pixels.decoders", "PIL.JpegImagePlugin", "PIL.Jpeg2KImagePlugin"):
        import_module(name)
    import_module("PIL.Image").preinit()
    warnings.simplefilter("ignore")
    logging.disable()


def main() -> None:
    """Prepare, give up all rights, and serve: standard output is for answers alone, whatever libraries print."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    prepare()
    confine(int(sys.argv[1]))
    serve(sys.stdin.buffer, answers)


if __name__ == "__main__":
    main()
