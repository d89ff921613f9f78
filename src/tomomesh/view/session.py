"""What is looked at, what was chosen, and what was made of it: all that the page shows is here."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..errors import UsageError
from ..settings import Settings
from .events import Events
from .jobs import ENDS, Jobs

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .opened import Opened

MOST = 200
"""Choices that can be taken back."""


@dataclass(frozen=True)
class Choices:
    """Parameters that were chosen, each by its bare name, and what they were before and after.

    Examples
    --------
    >>> choices = Choices().then({"lower": 200.0}).then({"lower": 250.0})
    >>> choices.values, choices.back().values, choices.back().forth().values
    ({'lower': 250.0}, {'lower': 200.0}, {'lower': 250.0})
    """

    values: Mapping[str, Any] = field(default_factory=dict)
    before: tuple[Mapping[str, Any], ...] = ()
    after: tuple[Mapping[str, Any], ...] = ()

    def then(self, changes: Mapping[str, Any]) -> Choices:
        """Choose; None takes a parameter back to its default.

        Raises
        ------
        UsageError
            For what no parameter may be.
        """
        values = {name: value for name, value in {**self.values, **changes}.items() if value is not None}
        settled = Settings().replace(**values)
        known = {name: value for group in vars(settled).values() for name, value in vars(group).items()}
        values = {name: known[name] for name in values}  # as the settings keep them: lists as tuples
        return self if values == self.values else Choices(values, (*self.before, self.values)[-MOST:])

    def back(self) -> Choices:
        """Take the last choice back."""
        return Choices(self.before[-1], self.before[:-1], (self.values, *self.after)) if self.before else self

    def forth(self) -> Choices:
        """Choose again what was taken back."""
        return Choices(self.after[0], (*self.before, self.values), self.after[1:]) if self.after else self


class Session:
    """One page's work.

    Attributes
    ----------
    opened : Opened
        What is looked at.
    choices : Choices
    made : dict
        What was made of it, by the name of the work (``segment``, ``reconstruct``), each with the choices of that time.
    jobs : Jobs
    events : Events
    """

    def __init__(self, opened: Opened, choices: Mapping[str, Any] | None = None) -> None:
        self.opened = opened
        self.choices = Choices().then(choices or {})
        self.made: dict[str, Made] = {}
        self.events = Events()
        self.jobs = Jobs(self._hear)

    @property
    def settings(self) -> Settings:
        """The settings that were chosen."""
        return Settings().replace(**self.choices.values)

    @property
    def command(self) -> str:
        """The command line that repeats what the page does: without a study, its last training; "" before it."""
        if self.opened.kind == "nothing":
            made = self.made.get("train")
            return "" if made is None else str(made.value.command)
        words = ["tomomesh", self.opened.command, *self.opened.words, *self.settings.words(), "-o", "mesh.stl"]
        return shlex.join(words)

    @property
    def state(self) -> dict[str, Any]:
        """What the page has to know at any time."""
        job = self.jobs.now
        return {
            "opened": self.opened.told,
            "choices": {name: _plain(value) for name, value in self.choices.values.items()},
            "undo": len(self.choices.before),
            "redo": len(self.choices.after),
            "command": self.command,
            "made": {name: made.choices == self.choices.values for name, made in self.made.items()},
            "job": None if job is None else job.told,
        }

    def choose(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Change parameters, and tell all pages."""
        if not isinstance(changes, dict):
            raise UsageError("choices are parameters and their values", found=type(changes).__name__)
        return self._now(self.choices.then(changes))

    def undo(self) -> dict[str, Any]:
        """Take the last choice back."""
        return self._now(self.choices.back())

    def redo(self) -> dict[str, Any]:
        """Choose again what was taken back."""
        return self._now(self.choices.forth())

    def keep(self, name: str, value: Any, choices: Mapping[str, Any]) -> None:
        """Keep what was made with some choices."""
        self.made[name] = Made(value, dict(choices))
        self.tell()

    def open(self, opened: Opened) -> None:
        """Look at something else: what was chosen and made before goes."""
        self.opened, self.choices = opened, Choices()
        self.made.clear()
        self.tell()

    def tell(self) -> None:
        """Tell all pages where things stand."""
        self.events.tell({"event": "state", "state": self.state})

    def _hear(self, event: dict[str, Any]) -> None:
        """Tell all pages of work, and where things stand once it has ended: an answer on its way may say it goes on."""
        self.events.tell(event)
        if event["event"] in ENDS:
            self.tell()

    def _now(self, choices: Choices) -> dict[str, Any]:
        self.choices = choices
        self.tell()
        return self.state


@dataclass(frozen=True)
class Made:
    """What some work has made, and the choices that it was made with."""

    value: Any
    choices: Mapping[str, Any]


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
