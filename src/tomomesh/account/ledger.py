"""What every account keeps: sections, times and warnings."""

from __future__ import annotations

import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..settings import Settings


class Ledger:
    """Sections of a report in the making."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._sections: dict[str, dict[str, Any]] = {}
        self._timings: dict[str, float] = {}
        self._warnings: list[str] = []

    @contextmanager
    def timed(self, stage: str) -> Iterator[None]:
        """Measure a stage."""
        start = time.perf_counter()
        yield
        self._timings[f"{stage}_s"] = self._timings.get(f"{stage}_s", 0.0) + time.perf_counter() - start

    def warn(self, message: str) -> None:
        """Note what a reader of the result must know."""
        self._warnings.append(message)
