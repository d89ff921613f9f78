"""Standard input and output in place of files: ``-``."""

from __future__ import annotations

import os
import re
import shutil
import sys
from argparse import Namespace
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import OutputError, TomomeshError, UsageError
from ..io.files.private import private_folder
from .formats import TEXTS

if TYPE_CHECKING:
    from collections.abc import Iterator

STREAM = "-"
SOURCES = ("study", "cloud")
"""Arguments that standard input may take the place of."""


@contextmanager
def streamed(chosen: Namespace) -> Iterator[Namespace]:
    """Put files in the place of streams while a command runs.

    What is read comes into a temporary file first, so that readers find what they check files for. What is written
    goes to standard output once the command has ended well, so that nothing or all of it comes out; whatever else
    would be printed goes to stderr.

    Raises
    ------
    UsageError
        For a format that is not named, and where a terminal would get bytes that are no text.
    """
    inside = next((name for name in SOURCES if getattr(chosen, name, None) == STREAM), "")
    each = getattr(chosen, "each", False)
    outside = getattr(chosen, "output", None) == STREAM and not each
    if getattr(chosen, "format", None) and not (outside or each):
        raise UsageError("a file's suffix tells its format", found=f"--format {chosen.format}", expected="-o -")
    suffix = _suffix(chosen) if outside else ""
    if not inside and not outside:
        yield chosen
        return
    with private_folder() as folder, _named_as_typed(folder):
        files = {}
        if inside:
            files[inside] = _received(Path(folder, f"input.{chosen.input_format}"))
            files["typed"] = f"{STREAM} --input-format {chosen.input_format}"
        if not outside:
            yield Namespace(**vars(chosen) | files)
            return
        files |= {"output": str(Path(folder, f"output{suffix}")), "shown": "standard output"}
        with redirect_stdout(sys.stderr):
            yield Namespace(**vars(chosen) | files)
        with Path(files["output"]).open("rb") as file:
            shutil.copyfileobj(file, sys.stdout.buffer)


def _suffix(chosen: Namespace) -> str:
    """Return the suffix of what goes to standard output."""
    if not chosen.format:
        raise UsageError("standard output has no suffix to tell its format", found="-o -", hint="--format")
    if chosen.format not in TEXTS and sys.stdout.isatty():
        raise UsageError(
            "a terminal cannot show this format", found=f"--format {chosen.format}",
            hint=f"a pipe or a file: `> mesh.{chosen.format}`",
        )  # fmt: skip
    return f".{chosen.format}"


def _received(path: Path) -> str:
    """Write standard input to a file."""
    try:
        with path.open("wb") as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
    except OSError as fault:
        raise OutputError(
            "standard input cannot be kept in the temporary folder", found=str(fault.strerror).lower(),
            hint="TMPDIR=FOLDER, one with more room",
        ) from None  # fmt: skip
    return str(path)


@contextmanager
def _named_as_typed(folder: Path) -> Iterator[None]:
    """Name streams in errors as they were typed, not the temporary files in their place."""
    try:
        yield
    except TomomeshError as fault:
        inside = re.escape(f"{folder}{os.sep}")
        fault.args = (re.sub(rf"{inside}(input|output)(\.\w+)+", STREAM, str(fault)),)
        raise
