"""A progress bar for each stage."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager, nullcontext
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from argparse import Namespace
    from collections.abc import Iterator
    from contextlib import AbstractContextManager
    from types import TracebackType
    from typing import NoReturn

    from tqdm import tqdm

FORMAT = "{desc} {bar:30} {n_fmt}/{total_fmt} {elapsed}{postfix}"
TICK = 1.0
"""Seconds from one look at the clock to the next: it counts in whole seconds."""
EVERY = 10.0
"""Seconds from one line of a stage to the next where there is no terminal: some hundred lines for a long run."""


class Bars:
    """Show one bar a stage on stderr where that is a terminal; else a line when it is done, and now and then before."""

    def __init__(self, *, quiet: bool = False) -> None:
        self._quiet = quiet
        self._drawn = sys.stderr.isatty()
        self._stage = ""
        self._since = self._said = 0.0
        self._done = self._total = 0
        self.beside = ""
        """A text that is shown behind the clock, from the next look at it on; any thread may set it."""
        self._bar: tqdm[NoReturn] | None = None
        self._drawing, self._left = Lock(), Event()

    def __enter__(self) -> Bars:
        if not self._quiet:
            Thread(target=self._tick, daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._left.set()
        with self._drawing:
            self._close()
            self._total = self._done  # nothing more is said

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Report progress (see `tomomesh.progress`)."""
        if self._quiet:
            return
        with self._drawing:
            self._show(stage, done, total)

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Put the bar away while something else is printed."""
        with self._drawing:
            if self._bar is not None:
                self._bar.clear(nolock=True)
            yield
            if self._bar is not None:
                self._bar.refresh(nolock=True)

    def _tick(self) -> None:
        """Let the clock go on while a stage reports nothing.

        Drawn without tqdm's own lock, which an interrupt in the midst of drawing would leave locked.
        """
        while not self._left.wait(TICK):
            with self._drawing:
                if self._bar is not None:
                    self._bar.set_postfix_str(self.beside, refresh=False)
                    self._bar.refresh(nolock=True)
                elif self._done < self._total and time.perf_counter() - self._said >= EVERY:
                    self._say()

    def _show(self, stage: str, done: int, total: int) -> None:
        if stage != self._stage:
            self._close()
            self._stage, self._since = stage, time.perf_counter()
            self._said = self._since
            self._bar = _bar_of(stage, total) if self._drawn else None
        self._done, self._total = done, total
        if self._bar is not None:
            self._bar.total = total
            self._bar.set_postfix_str(self.beside, refresh=False)
            self._bar.update(done - self._bar.n)
        elif done == total:
            self._say()

    def _say(self) -> None:
        self._said = time.perf_counter()
        beside = f", {self.beside}" if self.beside else ""
        line = f"{self._stage:10s} {self._done}/{self._total} {self._said - self._since:.1f} s{beside}"
        print(line, file=sys.stderr, flush=True)

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.refresh()
            self._bar.close()
            self._bar = None


def _bar_of(stage: str, total: int) -> tqdm[NoReturn]:
    from tqdm import tqdm

    return tqdm(total=total, desc=f"{stage:10s}", bar_format=FORMAT)


def bars_of(chosen: Namespace) -> AbstractContextManager[Any]:
    """Return what shows the progress of a study: bars here, or whatever tells it to another process."""
    told = getattr(chosen, "told", None)
    return Bars(quiet=chosen.quiet) if told is None else nullcontext(told)
