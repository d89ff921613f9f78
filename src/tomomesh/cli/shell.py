"""What a shell is told of the commands: completion and the manual page, both made from the parser."""

from __future__ import annotations

import argparse
import re
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..errors import UsageError
from .options import build_parser

if TYPE_CHECKING:
    from collections.abc import Iterator

FOLDERS = ("FOLDER",)
FILES = ("FILE", "FILE.json", "FILE.toml", "MESH", "POINTS", "REGION", "STUDY")
"""Names of values that are paths."""
UNWRAPPED = 1_000_000
"""Columns of a line that is left for roff to fill."""


def tell(chosen: argparse.Namespace) -> None:
    """Print what a shell is told."""
    print(manual() if chosen.command == "man" else completion(chosen.shell), end="")


def completion(shell: str) -> str:
    """Return the script by which a shell completes commands, options, choices and paths.

    Raises
    ------
    UsageError
        Where the package shtab is not installed, or does not know the shell.
    """
    shtab = _library("shtab")
    if shell not in shtab.SUPPORTED_SHELLS:
        raise UsageError(f"shtab {shtab.__version__} does not know this shell", found=shell, hint="a newer shtab")
    parser = build_parser()
    for action in _actions(parser):
        if action.metavar in FOLDERS + FILES:
            vars(action)["complete"] = shtab.DIRECTORY if action.metavar in FOLDERS else shtab.FILE
    return str(shtab.complete(parser, shell))


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the options of a parser and of all its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)


def manual() -> str:
    """Return the manual page as roff: the same bytes on every day and in every terminal.

    Raises
    ------
    UsageError
        Where the package argparse-manpage is not installed.
    """
    library = _library("argparse_manpage.manpage")
    parser: Any = build_parser()
    parser.formatter_class = partial(argparse.HelpFormatter, width=UNWRAPPED)
    page = library.Manpage(parser, format="single-commands-section")
    page.description, page.date = parser.description, ""
    page.source, page.manual = f"tomomesh {__version__}", "tomomesh"
    # a line that begins with a dot is a command of roff, and would be lost: no suffix is one
    return re.sub(r"(?m)^(?=\.[a-z0-9]{3}|')", r"\\&", str(page))


def _library(module: str) -> Any:
    try:
        return import_module(module)
    except ImportError:
        package = module.partition(".")[0].replace("_", "-")
        raise UsageError(
            "this command needs a package that is not installed", expected=package, hint='pip install "tomomesh[shell]"'
        ) from None
