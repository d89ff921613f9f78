"""What is looked at, what was chosen, and what was made of it: all that the page shows is here."""

from __future__ import annotations

import shlex
from dataclasses import dataclass, field, replace
from itertools import count
from typing import TYPE_CHECKING, Any

from ..errors import TomomeshError, UsageError
from ..settings import Settings
from .events import Events
from .jobs import ENDS, Jobs
from .opened import Opened, opened_as
from .reach import Reach
from .remembered import Remembered

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from ..progress import Progress
    from ..results import Surface

    Write = Callable[[str, Surface, Settings, Path, Sequence[str]], None]

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
    write : callable, optional
        Writes a file of a surface as the command line does: what of it, the surface, its settings, the
        path, and the words of the command that repeats it.
    run : callable, optional
        Runs the command line of some words.
    reach : Reach
        What may be opened.
    surveys, studies, selections : Remembered
        What was found out about what is opened, the part of it that is looked at, and what some choices keep of that.
    """

    def __init__(
        self, opened: Opened, choices: Mapping[str, Any] | None = None, reach: Reach | None = None,
        *, write: Write | None = None, run: Callable[[Sequence[str]], None] | None = None,
    ) -> None:  # fmt: skip
        self.opened, self.write, self.run, self.reach = opened, write, run, reach or Reach()
        self._turns, self._told = 0, count(1)
        self.surveys, self.studies, self.selections, self.colors = map(Remembered, (1, 1, 3, 3))
        self.choices = Choices().then(choices or {})
        self.made: dict[str, Outcome] = {}
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
        words = self.opened.command(self.settings)
        return shlex.join(["tomomesh", *words]) if words else ""

    @property
    def state(self) -> dict[str, Any]:
        """What the page has to know at any time; ``told`` grows, so that an answer on its way cannot undo a newer."""
        job = self.jobs.now
        return {
            "told": next(self._told),
            "opened": {**self.opened.told, "turn": self._turns, "browses": self.reach.folder is not None},
            "choices": {name: _plain(value) for name, value in self.choices.values.items()},
            "undo": len(self.choices.before),
            "redo": len(self.choices.after),
            "command": self.command,
            "saving": shlex.join(["tomomesh", *self.opened.converting("mesh.stl")])
            if self.opened.converts
            else self.command,
            "made": {name: made.choices == self.choices.values for name, made in self.made.items()},
            "job": None if job is None else job.told,
            "failed": self.jobs.failed,
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
        self.made[name] = Outcome(value, dict(choices))
        self.colors.clear()
        self.tell()

    def open(self, opened: Opened, choices: Mapping[str, Any] | None = None) -> None:
        """Look at something else, and read it: what was chosen and made before goes."""
        self._check_idle()
        self.choices = Choices().then(choices or {})
        self.made.clear()
        self.read(opened)

    def read(self, opened: Opened) -> None:
        """Read what is named, beside the page.

        Raises
        ------
        UsageError
            Where other work is underway.
        """
        self._check_idle()
        self._look_at(Opened(opened.kind, opened.words, opened.beside))
        if opened.words:
            self.jobs.start("read", self._read)

    def _check_idle(self) -> None:
        if (job := self.jobs.now) is not None:
            raise UsageError("work is underway", found=job.name, hint="the same once it is done, or stop it")

    def _read(self, progress: Progress) -> dict[str, Any]:
        opened = self.opened
        try:
            self._look_at(opened_as(opened.kind, opened.words[0], self.settings, progress, beside=opened.beside))
        except TomomeshError as fault:
            self._look_at(replace(opened, refused=str(fault), flags=fault.flags))
            raise
        return {}

    def _look_at(self, opened: Opened) -> None:
        self.opened, self._turns = opened, self._turns + 1
        self.surveys.clear()
        self.studies.clear()
        self.selections.clear()
        self.colors.clear()
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
        """Take choices; where they change how a study is read, it is read again."""
        if again := self.opened.reads_otherwise(self.settings, Settings().replace(**choices.values)):
            self._check_idle()
        self.choices = choices
        if again:
            self.read(self.opened)
        self.tell()
        return self.state


@dataclass(frozen=True)
class Outcome:
    """What some work has made, and the choices that it was made with."""

    value: Any
    choices: Mapping[str, Any]


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
