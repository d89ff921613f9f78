"""The histogram of a study with its window, as lines that a page draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

WIDTH, HEIGHT = 720.0, 160.0
"""Of the drawing, in its own units."""


@dataclass(frozen=True)
class Histogram:
    """How often gray levels are, and which are kept.

    Attributes
    ----------
    counts : sequence of int
        In bars of the same width.
    low, high : float
        Where the first begins and the last ends.
    lower, upper : float or None
        The window; None where it has no limit.
    unit : str
        Of the levels.
    """

    counts: Sequence[int]
    low: float
    high: float
    lower: float | None = None
    upper: float | None = None
    unit: str = ""

    @property
    def bars(self) -> list[tuple[float, float, float, float]]:
        """Left side, top, width and height of each bar; heights grow as the square root, so that few are seen."""
        high = np.sqrt(np.asarray(self.counts, float))
        tall = HEIGHT * high / (high.max() or 1.0)
        width = WIDTH / len(high)
        return [
            (round(n * width, 2), round(HEIGHT - h, 2), round(0.9 * width, 2), round(h, 2)) for n, h in enumerate(tall)
        ]

    @property
    def window(self) -> tuple[float, float]:
        """Left side and width of what is kept."""
        start, stop = (self._across(end, where) for end, where in ((self.lower, 0.0), (self.upper, WIDTH)))
        return round(start, 2), round(max(stop - start, 0.0), 2)

    @property
    def words(self) -> str:
        """Say what is drawn."""
        unit = f" {self.unit}" if self.unit else ""
        lower, upper = ("any" if one is None else f"{one:g}" for one in (self.lower, self.upper))
        return f"Gray levels from {self.low:g} to {self.high:g}{unit}; kept are those in {lower} < k <= {upper}"

    def _across(self, level: float | None, otherwise: float) -> float:
        """Return where a level lies."""
        if level is None or self.high <= self.low:
            return otherwise
        return float(np.clip((level - self.low) / (self.high - self.low), 0, 1) * WIDTH)
