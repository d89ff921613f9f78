"""Standard input and output in place of files, ``-``, and files whose format is named and not told by their suffix."""

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

from ..errors import OutputError, TomomeshError, UsageError, printable
from ..io.files.private import private_folder
from ..io.files.source import existing, existing_file, suffix_of
from .options.formats import TEXTS

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
    inside = next((name for name in SOURCES if getattr(chosen, name, None) == STREAM), "")
    source = inside or _of_named_format(chosen)
    each = getattr(chosen, "each", False) or getattr(chosen, "each_label", False)
    outside = getattr(chosen, "output", None) == STREAM and not each
    if getattr(chosen, "format", None) and not (outside or each):
        raise UsageError("a file's suffix tells its format", found=f"--format {chosen.format}", expected="-o -")
    suffix = _suffix(chosen) if outside else ""
    if not source and not outside:
        yield chosen
        return
    typed = getattr(chosen, source) if source else STREAM
    with private_folder() as folder, _named_as_typed(folder, typed):
        files = {}
        if source:
            suffix_in = chosen.input_format or SOURCES[source]
            place = Path(folder, f"input.{suffix_in}")
            files[source] = _received(place) if inside else _linked(place, typed)
            files["typed"] = f"{shlex.quote(typed)} --input-format {suffix_in}"
        if not outside:
            yield Namespace(**vars(chosen) | files)
            return
        files |= {"output": str(Path(folder, f"output{suffix}")), "shown": "standard output"}
        with redirect_stdout(sys.stderr):
            yield Namespace(**vars(chosen) | files)
        with Path(files["output"]).open("rb") as file:
            shutil.copyfileobj(file, sys.stdout.buffer)


def _of_named_format(chosen: Namespace) -> str:
    """Return which argument is a file whose format is named; empty where none is, or its suffix says the same."""
    named = getattr(chosen, "input_format", None)
    source = next((name for name in SOURCES if getattr(chosen, name, None)), "")
    if not named or not source:
        return ""
    path = getattr(chosen, source)
    if not isinstance(path, str) or existing(path).is_dir():
        raise UsageError("a format is that of one file", found=f"--input-format {named}", expected="a file, or -")
    return "" if suffix_of(path) == f".{named}" else source


def _linked(place: Path, typed: str) -> str:
    """Give a file another name; a copy where the system has no links."""
    path = existing_file(typed)
    try:
        place.symlink_to(path.resolve())
    except OSError:
        shutil.copyfile(path, place)
    return str(place)


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
def _named_as_typed(folder: Path, typed: str) -> Iterator[None]:
    """Name what is read and written in errors as it was typed, not the temporary files in its place."""
    try:
        yield
    except TomomeshError as fault:
        inside = re.escape(f"{folder}{os.sep}")
        words = re.sub(rf"({inside})?\binput(\.\w+)+", lambda _: printable(typed), str(fault))
        fault.args = (re.sub(rf"{inside}output(\.\w+)+", STREAM, words),)
        raise
