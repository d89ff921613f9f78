"""Long work, beside the page: one at a time, with its progress, and stopped where that is asked for."""

from __future__ import annotations

import re
import threading
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..errors import TomomeshError
from ..html.places import named_places
from ..settings import asked_by, parameters

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..progress import Progress

    Tell = Callable[[dict[str, Any]], None]
    Work = Callable[[Progress], Any]

OFTEN = 0.1
"""Seconds from one word of progress to the next: a page shows no more."""


ENDS = ("done", "stopped", "failed")
"""Events with which work ends."""


class Stopped(BaseException):
    """The user has stopped the work: no fault, so no handler of faults may keep it."""


@dataclass
class Job:
    """A piece of work that takes its time.

    Attributes
    ----------
    number : int
    name : str
        What it is called to the page: read, reconstruct, color, segment, train.
    stage, done, total
        Where it is, as `tomomesh.progress` says.
    """

    number: int
    name: str
    stage: str = ""
    done: int = 0
    total: int = 0
    stopping: threading.Event = field(default_factory=threading.Event, repr=False)
    thread: threading.Thread | None = field(default=None, repr=False)

    @property
    def told(self) -> dict[str, Any]:
        """Where it is, for the page."""
        return {
            "job": self.number, "name": self.name, "stage": self.stage, "done": self.done, "total": self.total,
            "stopping": self.stopping.is_set(),
        }  # fmt: skip


class Jobs:
    """What is worked on.

    Parameters
    ----------
    tell : callable
        Takes the events for the page; called from any thread.
    """

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._lock = threading.Lock()
        self._count = 0
        self.now: Job | None = None
        self.failed: dict[str, Any] | None = None
        """What the last work has failed by, as its event tells it."""

    def start(self, name: str, work: Work) -> Job:
        """Begin some work, unless work is underway: a second click is no second run.

        Parameters
        ----------
        name : str
        work : callable
            Takes a `Progress`, and keeps what it has made; what it returns is told to the page.

        Returns
        -------
        Job
            The one that was underway, or the new one.
        """
        with self._lock:
            if self.now is not None:
                return self.now
            self._count += 1
            job = self.now = Job(self._count, name)
            self.failed = None
        job.thread = threading.Thread(target=self._run, args=(job, work), daemon=True)
        job.thread.start()
        return job

    def stop(self) -> None:
        """Have the work end where it next says where it is."""
        job = self.now
        if job is not None:
            job.stopping.set()
            self._tell({"event": "progress", **job.told})

    def _run(self, job: Job, work: Work) -> None:
        self._tell({"event": "progress", **job.told})
        told = {"job": job.number, "name": job.name, **_outcome(work, self._progress(job))}
        with self._lock:
            self.now, self.failed = None, told if told["event"] == "failed" else None
        self._tell(told)

    def _progress(self, job: Job) -> Progress:
        said = 0.0

        def progress(stage: str, done: int, total: int) -> None:
            nonlocal said
            if job.stopping.is_set():
                raise Stopped
            new, now = stage != job.stage, time.monotonic()
            job.stage, job.done, job.total = stage, done, total
            if new or done == total or now - said > OFTEN:
                said = now
                self._tell({"event": "progress", **job.told})

        return progress


def _outcome(work: Work, progress: Progress) -> dict[str, Any]:
    try:
        return {"event": "done", **(work(progress) or {})}
    except Stopped:
        return {"event": "stopped"}
    except TomomeshError as error:
        line = str(error)
        flags = [*error.flags] or switches_in(line)
        return {"event": "failed", "error": line, "flags": flags, "places": named_places(line)}
    except MemoryError:
        return {"event": "failed", "error": "the machine's memory is full", "flags": [], "places": ()}
    except Exception as fault:  # a bug; not in its own words, which may quote what a study says of a patient
        return {"event": "failed", "error": f"a bug: {type(fault).__name__}", "flags": [], "places": ()}


def switches_in(line: str) -> list[str]:
    """Return the switches that a line names, which a page can offer as they are.

    Examples
    --------
    >>> switches_in("it has two walls. Try: --fill-holes to cap what is open, or a smaller --cell.")
    ['--fill-holes']
    """
    switches = {asked_by(entry) for _, entry in parameters() if entry.metadata["kind"] is bool}
    return [option for option in dict.fromkeys(re.findall(r"--[a-z]+(?:-[a-z]+)*", line)) if option in switches]
