"""The parser of all commands. Imports nothing heavy, so that ``--help`` starts at once."""

from __future__ import annotations

import argparse
from typing import Any, NoReturn

from ... import __version__
from ...errors import UsageError
from .commands import add_commands
from .likely import likely_command, likely_option


class _Parser(argparse.ArgumentParser):
    """A parser whose faults are tomomesh's own one-line errors, and that takes no abbreviations."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(allow_abbrev=False, **kwargs)
        self.commands: dict[str, argparse.ArgumentParser] = {}

    def error(self, message: str) -> NoReturn:
        """Raise instead of printing a page and leaving."""
        raise UsageError(message, hint=f"`{self.prog} --help`")

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; of an option or a command that there is not, say which was likely meant."""
        words = list(args or ())
        if words and not words[0].startswith("-") and words[0] not in self.commands:
            raise self._no_command(words[0])
        found, unknown = self.parse_known_args(words, namespace)
        if unknown:
            raise _no_option(self.commands[found.command], unknown)
        return found

    def _no_command(self, word: str) -> UsageError:
        meant = likely_command(word, self.commands)
        return UsageError(
            "there is no such command", found=word, expected=" | ".join(self.commands),
            hint=meant or f"`{self.prog} --help`",
        )  # fmt: skip


def _no_option(parser: argparse.ArgumentParser, unknown: list[str]) -> UsageError:
    """Return the error of arguments that a command does not know, with the line that was likely meant."""
    meant = likely_option(unknown[0], parser._option_string_actions) if unknown[0].startswith("-") else ""
    given = unknown[0].partition("=")
    value = f"={given[2]}" if given[1] else "".join(f" {word}" for word in unknown[1:2])
    said = f"unrecognized arguments: {' '.join(unknown)}"
    return UsageError(said, hint=f"{meant}{value}" if meant else f"`{parser.prog} --help`")


def build_parser() -> _Parser:
    """Return the parser of all commands."""
    parser = _Parser(
        prog="tomomesh",
        description="Slices or points in, a closed surface mesh with its proof out.",
        epilog="Exit codes: 0 ok, 2 usage, 3 not found, 4 bad file, 5 geometry needs a decision, 6 empty result, "
        "7 over a limit, 8 output not written, 9 internal check failed, 10 some studies of a batch failed, "
        "130 interrupted.",
    )
    parser.add_argument("--version", action="version", version=f"tomomesh {__version__}")
    commands = parser.add_subparsers(
        title="Commands", dest="command", required=True, metavar="COMMAND", parser_class=_Parser
    )
    add_commands(commands)
    parser.commands = dict(commands.choices)
    return parser
