"""Standard input and output in place of files: ``-``; and files whose format is named in place of their suffix."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import sys
from argparse import Namespace
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import OutputError, TomomeshError, UsageError
from ..io.files.private import private_folder
from ..io.files.source import existing
from .formats import TEXTS

if TYPE_CHECKING:
    from collections.abc import Iterator

STREAM = "-"
SOURCES = {"study": "nii", "cloud": "xyz"}
"""Arguments that standard input may take the place of, and its format where none is named."""


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
    given = getattr(chosen, "input_format", None)
    typed = {name: getattr(chosen, name, None) for name in SOURCES}
    inside = next((name for name, path in typed.items() if path == STREAM or (path and given)), "")
    each = getattr(chosen, "each", False)
    outside = getattr(chosen, "output", None) == STREAM and not each
    if getattr(chosen, "format", None) and not (outside or each):
        raise UsageError("a file's suffix tells its format", found=f"--format {chosen.format}", expected="-o -")
    suffix = _suffix(chosen) if outside else ""
    if not inside and not outside:
        yield chosen
        return
    source = str(typed.get(inside, STREAM))
    with private_folder() as folder, _named_as_typed(folder, source):
        files = {}
        if inside:
            read = given or SOURCES[inside]
            kept = Path(folder, f"input.{read}")
            files[inside] = _received(kept) if source == STREAM else _under_suffix(Path(source), kept)
            files["typed"] = f"{shlex.quote(source)} --input-format {read}"
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


def _under_suffix(path: Path, file: Path) -> str:
    """Give a file that is there another suffix, by a link, or a copy where the system has none."""
    if existing(path).is_dir():
        raise UsageError("--input-format names the format of a file", found=f"{path}, a folder", expected="a file")
    try:
        file.symlink_to(path.resolve())
    except OSError:
        shutil.copyfile(path, file)
    return str(file)


@contextmanager
def _named_as_typed(folder: Path, source: str) -> Iterator[None]:
    """Name streams and files in errors as they were typed, not the temporary files in their place."""
    names = {"input": source, "output": STREAM}
    inside = rf"(?:{re.escape(f'{folder}{os.sep}')})?\b(input|output)(\.\w+)+"
    try:
        yield
    except TomomeshError as fault:
        fault.args = (re.sub(inside, lambda found: names[found[1]], str(fault)),)
        raise
