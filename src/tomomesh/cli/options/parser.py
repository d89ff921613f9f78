"""The parser of all commands. Imports nothing heavy, so that ``--help`` starts at once."""

from __future__ import annotations

import argparse
from typing import Any, NoReturn

from ... import __version__
from ...errors import UsageError
from .commands import add_commands
from .likely import likely_command, likely_instead, likely_option, likely_output


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
        if words and words[0] not in self.commands and words[0] not in self._option_string_actions:
            raise self._no_command(words[0])
        try:
            found, unknown = self.parse_known_args(words, namespace)
        except UsageError as fault:  # of what is missing: it may be there under another name
            raise self._with_hint(fault, words) from None
        if unknown:
            raise _no_option(self.commands[found.command], unknown)
        return found

    def _strange(self, words: list[str]) -> list[str]:
        """Return the first option that the command does not know, and what stands behind it."""
        known = self.commands[words[0]]._option_string_actions if words and words[0] in self.commands else {}
        strange = (
            n for n, word in enumerate(words) if known and word[:2] == "--" and word.partition("=")[0] not in known
        )
        first = next(strange, None)
        return [] if first is None else words[first : first + 2]

    def _with_hint(self, fault: UsageError, words: list[str]) -> UsageError:
        """Return the error of arguments that cannot be parsed, with what was likely meant."""
        if strange := self._strange(words):
            return _no_option(self.commands[words[0]], strange)
        output = likely_output(words) if "required: -o" in str(fault) and len(words) > 1 else ""
        return UsageError("no output is named", expected="-o/--output", hint=output) if output else fault

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
    instead = likely_instead(unknown[0], parser._option_string_actions)
    return UsageError(said, hint=instead or (f"{meant}{value}" if meant else f"`{parser.prog} --help`"))


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
    for command in parser.commands.values():
        command.usage = _usage(command)
    return parser


def _usage(command: argparse.ArgumentParser) -> str:
    """Name what a command cannot do without; every option is described below that."""
    named = [str(action.metavar or action.dest) for action in command._actions if not action.option_strings]
    needed = [
        f"{action.option_strings[0]} {action.metavar}"
        for action in command._actions
        if action.required and action.option_strings
    ]
    return " ".join([command.prog, *named, *needed, "[OPTION ...]"])
