"""A progress bar for each stage."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, NoReturn

from tqdm import tqdm

if TYPE_CHECKING:
    from types import TracebackType


class Bars:
    """Show one bar a stage on stderr, where that is a terminal; one line a stage where it is not."""

    def __init__(self, *, quiet: bool = False) -> None:
        self._quiet = quiet
        self._bar: tqdm[NoReturn] | None = None
        self._stage = ""

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
            self._stage = stage
            self._bar = tqdm(
                total=total, desc=f"{stage:10s}", file=sys.stderr, leave=True, dynamic_ncols=True,
                bar_format="{desc} {bar:30} {n_fmt}/{total_fmt} {elapsed}",
                mininterval=0.1 if sys.stderr.isatty() else float("inf"),
            )  # fmt: skip
        if self._bar is not None:
            self._bar.total = total
            self._bar.update(done - self._bar.n)

    def _close(self) -> None:
        if self._bar is not None:
            self._bar.refresh()
            self._bar.close()
            self._bar = None
