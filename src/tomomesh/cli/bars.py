"""A progress bar for each stage."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

from tqdm import tqdm

if TYPE_CHECKING:
    from types import TracebackType
    from typing import NoReturn

FORMAT = "{desc} {bar:30} {n_fmt}/{total_fmt} {elapsed}"


class Bars:
    """Show one bar a stage on stderr where that is a terminal, and one line a finished stage where it is not."""

    def __init__(self, *, quiet: bool = False) -> None:
        self._quiet = quiet
        self._drawn = sys.stderr.isatty()
        self._stage = ""
        self._since = 0.0
        self._bar: tqdm[NoReturn] | None = None

    def __enter__(self) -> Bars:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, fault: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Report progress (see `tomomesh.progress`)."""
        if self._quiet:
            return
        if stage != self._stage:
            self._close()
            self._stage, self._since = stage, time.perf_counter()
            self._bar = tqdm(total=total, desc=f"{stage:10s}", bar_format=FORMAT) if self._drawn else None
        if self._bar is not None:
            self._bar.total = total
            self._bar.update(done - self._bar.n)
        elif done == total:
            print(f"{stage:10s} {total}/{total} {time.perf_counter() - self._since:.1f} s", file=sys.stderr)

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.refresh()
            self._bar.close()
            self._bar = None
