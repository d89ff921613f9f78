"""How a slice lies in its picture: its millimeters, its gray levels, its panels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .drawing.axes import rule
from .drawing.marks import show
from .drawing.page import canvas
from .drawing.style import INK

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .drawing.page import Page, Panel

    Pixels = NDArray[Any]
    Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Plane:
    """A slice's own millimeters, from the center of its first pixel.

    Attributes
    ----------
    spacing_mm : (x, y)
        Distance of the pixels along a row and along a column.
    upward : bool
        Whether the rows rise, as in coronal and sagittal slices, or fall.
    unit : str
        What the spacing is measured in.
    """

    spacing_mm: tuple[float, float] = (1.0, 1.0)
    upward: bool = False
    unit: str = "mm"

    def place(self, indices: Floats) -> Floats:
        """Carry (n, 2) pixel indices (column, row) to millimeters."""
        return np.asarray(indices * np.array(self.spacing_mm))

    def draw(self, ax: Panel, image: Pixels, span: tuple[float, float] = (0, 1)) -> None:
        """Show (J, I) levels in gray, black and white at the ends of the span, or (J, I, 3) uint8 colors."""
        (dx, dy), (rows, columns) = self.spacing_mm, image.shape[:2]
        top, bottom = -0.5 * dy, (rows - 0.5) * dy
        if image.ndim == 2:
            low, high = span
            image = np.round(np.clip((image - low) * (255.0 / ((high - low) or 1.0)), 0, 255)).astype(np.uint8)
        show(ax, image, -0.5 * dx, bottom, (columns - 0.5) * dx, top, upward=self.upward)

    def fit(self, ax: Panel, image: Pixels) -> None:
        """Limit a panel to a whole slice."""
        (dx, dy), (rows, columns) = self.spacing_mm, image.shape[:2]
        self.crop(ax, np.array([[-0.5 * dx, -0.5 * dy], [(columns - 0.5) * dx, (rows - 0.5) * dy]]))

    def bounds(self, mask: Pixels, places: Floats) -> Floats:
        """Return the lowest and highest (x, y) of the window and the places, with a margin, (2, 2)."""
        rows, columns = np.nonzero(mask)
        seen = np.vstack([self.place(np.stack([columns, rows], axis=1)), places])
        low, high = seen.min(axis=0), seen.max(axis=0)
        margin = 0.09 * float((high - low).max()) + max(self.spacing_mm)
        return np.stack([low - margin, high + margin])

    def crop(self, ax: Panel, bounds: Floats) -> None:
        """Limit a panel."""
        (left, low), (right, high) = bounds
        ax.limit(left, low if self.upward else high, right, high if self.upward else low)

    def rule(self, axes: list[Panel]) -> None:
        """Name the axes of a row of panels."""
        for n, ax in enumerate(axes):
            up = "" if n else f"along a column ({self.unit})"
            rule(ax, along=f"along a row ({self.unit})", up=up, color=INK)


FAR = 2.0
"""How far a single level at an end is from the others, in parts of their span, where it is taken for one that nothing
measured, as -9999: it is drawn black or white. Background of 0 around a head is nearer. Only pictures depend on it."""
PIXELS = Plane()
"""A slice whose pixels are squares of 1 mm."""


def on_paper(mask: Pixels, color: tuple[int, int, int]) -> NDArray[np.uint8]:
    """Return a window in a color on white, (J, I, 3)."""
    return np.array([(255, 255, 255), color], np.uint8)[np.asarray(mask, np.uint8)]


def gray(image: Pixels) -> Floats:
    """Return one level a pixel, the mean over the layers of a (J, I, L) image."""
    return np.asarray(image if image.ndim == 2 else image.mean(axis=2), np.float64)


def contrast(levels: Floats) -> tuple[float, float]:
    """Return the span of nearly all levels, or of all where nearly all are equal; no far level at an end counts."""
    for end in (levels.min(), levels.max()):
        others = levels[levels != end]
        low, high = _span(others) if others.size else (end, end)
        if 0 < FAR * (high - low) < min(abs(end - low), abs(end - high)):
            levels = others
    low, high = _span(levels)
    return (low, high) if low < high else (float(levels.min()), float(levels.max()))


def _span(levels: Floats) -> tuple[float, float]:
    low, high = np.percentile(levels, [0.2, 99.8])
    return float(low), float(high)


def panels(width: float, count: int, size: Floats, more: float, **room: float) -> tuple[Page, list[Panel]]:
    """Open a row of panels as high as their content (x, y) needs, and `more` inches for what is written."""
    ratio = float(np.clip(size[1] / size[0], 0.4, 1.8))
    return canvas(width, width / count * ratio + more, 1, count, **room)
