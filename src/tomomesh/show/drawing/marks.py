"""The marks on a panel: dots, lines, polygons, arrows, images and small print."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from ...kernels.rendering.strokes import draw_dots, draw_segments
from .style import ACCENT, MUTED, opaque
from .surface import draw_polygons

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .letters import Word
    from .page import Page, Panel

    Floats = NDArray[np.float64]

SHAPES = {"o": 0, "s": 1, "D": 2}
"""Discs, squares, and squares that stand on a corner."""
DASH, GAP = 3.7, 1.6
"""Of dashed lines, in parts of their width."""


def dots(
    ax: Panel,
    places: Floats,
    *,
    size: float | Floats,
    color: Any = None,
    marker: str = "o",
    rim: Any = None,
    width: float = 0.0,
) -> None:
    """Mark (n, 2) places in their order; `size` is the width in points, and `width` that of the rim."""
    count, page = len(places), ax.page
    where = _inside(ax, ax.place(places))
    radii = np.broadcast_to(page.points(1) * np.asarray(size, np.float64) / 2, count).copy()
    if color is not None:
        draw_dots(where, radii, opaque(color, count), SHAPES[marker], 0.0, ax.pixels)
    if rim is not None:
        draw_dots(where, radii, opaque(rim, count), SHAPES[marker], page.points(width), ax.pixels)


def lines(ax: Panel, segments: Floats, *, color: Any, width: float | Floats, dashed: bool = False) -> None:
    """Draw (n, 2, 2) segments in their order; `width` is in points."""
    count = len(segments)
    wide = ax.page.points(1) * np.asarray(width, np.float64)
    dash, gap = (float(wide.max()) * DASH, float(wide.max()) * GAP) if dashed else (0.0, 0.0)
    ends = _inside(ax, ax.place(segments))
    widths = np.broadcast_to(wide, count).copy()
    draw_segments(ends, widths, opaque(color, count), dash, gap, ax.pixels)


def _inside(ax: Panel, places: Floats) -> Floats:
    """Carry pixels of the page to those of the panel."""
    return np.ascontiguousarray(places - np.maximum(np.round(ax.box[:2]), 0))


def fill(ax: Panel, polygons: Floats, *, color: Any) -> None:
    """Fill (n, c, 2) convex polygons, which do not overlap; neighbors leave no seam."""
    count, corners = polygons.shape[:2]
    flat = np.zeros((count * corners, 3))
    flat[:, :2] = _inside(ax, ax.place(polygons.reshape(-1, 2)))
    sides = np.arange(count * corners).reshape(count, corners)
    shades = np.round(opaque(color, count)[:, :3]).astype(np.uint8)
    draw_polygons(ax.pixels, flat, sides, np.stack([shades, shades]))


def show(
    ax: Panel, image: NDArray[np.uint8], left: float, bottom: float, right: float, top: float, *, upward: bool
) -> None:
    """Show (J, I) levels or (J, I, 3) colors between the given places, the first row at `top`; `upward`, rows rise.

    Pixels that are larger than the page's keep their edges; smaller ones are averaged.
    """
    corners = ax.place(np.array([[left, bottom if upward else top], [right, top if upward else bottom]]))
    image = image[::-1] if upward else image
    low, high = np.maximum(np.round(corners[0]), ax.box[:2]), np.minimum(np.round(corners[1]), ax.box[2:])
    if (high <= low).any():
        return
    size = np.array(image.shape[1::-1])
    per = size / (corners[1] - corners[0])
    part = np.clip(np.concatenate([(low - corners[0]) * per, (high - corners[0]) * per]), 0, np.tile(size, 2))
    (i, j), (width, height) = low.astype(int), (high - low).astype(int)
    resized = Image.fromarray(np.ascontiguousarray(image)).resize((width, height), Image.Resampling.BOX, tuple(part))
    sized = np.asarray(resized)
    ax.page.pixels[j : j + height, i : i + width] = sized if sized.ndim == 3 else sized[:, :, None]


def small_print(
    ax: Panel,
    text: str,
    place: Floats,
    shift: tuple[float, float] = (0, 0),
    *,
    color: str = MUTED,
    align: float = 0.5,
    size: float = 8,
) -> Word:
    """Write a word beside an (x, y) place, shifted by points to the right and up."""
    (x, y), by = ax.place(place), ax.page.points(1)
    return ax.page.write(
        text, (float(x) + by * shift[0], float(y) - by * shift[1]), size=size, color=color, align=align, up=0.5
    )


def arrow(ax: Panel, tail: Floats, tip: Floats, *, color: str = ACCENT, text: str = "") -> None:
    """Point from one (x, y) place to another, beginning 8 points after the first and ending 3 before the other."""
    ends, by = ax.place(np.stack([tail, tip])), ax.page.points(1)
    along = _direction(ends)
    pointer(ax.page, ends + by * np.stack([8 * along, -3 * along]), color=color)
    if text:
        small_print(ax, text, tail, color=color, size=8.5)


def pointer(page: Page, ends: Floats, *, color: str) -> None:
    """Draw an arrow from one pixel of a page to another."""
    along, by, paper = _direction(ends), page.points(1), page.paper
    across = np.array([-along[1], along[0]])
    stem = np.stack([ends[0], ends[1] - 3 * by * along])
    head = np.stack([ends[1], ends[1] - by * (5 * along - 2.2 * across), ends[1] - by * (5 * along + 2.2 * across)])
    lines(paper, stem[None], color=color, width=1.3)
    fill(paper, head[None], color=color)


def _direction(ends: Floats) -> Floats:
    step = ends[1] - ends[0]
    return np.asarray(step / max(float(np.hypot(*step)), 1e-9))
