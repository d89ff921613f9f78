"""A slice as the matrix that it is: gray levels as heights (Fig. 3)."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from .camera import Camera, brightness, normals
from .drawing.marks import fill, lines, small_print
from .drawing.page import canvas
from .drawing.style import MUTED, RELIEF
from .plane import PIXELS, Plane, gray
from .render import draw_colored

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .drawing.page import Page, Panel

SIDE = 128
"""Most facets along a side; larger images are averaged down to it."""
HEIGHT = 0.34
"""Height of the relief over the longer side of the slice."""
TABLE = Camera(azimuth=24.0, elevation=38.0)


def draw_relief(image: NDArray[Any], plane: Plane = PIXELS, camera: Camera = TABLE) -> Page:
    """Draw the gray levels of a slice as a landscape (Fig. 3)."""
    levels = gray(image)
    block = -(-max(levels.shape) // SIDE)
    coarse = _averaged(levels, block)
    low, high = float(coarse.min()), float(coarse.max())
    grid = _grid(coarse, low, high, (plane.spacing_mm[0] * block, plane.spacing_mm[1] * block), plane.upward)
    page, (ax,) = canvas(8.2, 5.2)
    box = np.array([*product(*zip(grid.min(axis=(0, 1)), grid.max(axis=(0, 1)), strict=True))])
    _limit(ax, camera.project(box)[:, :2])
    _draw_box(ax, grid, camera, (low, high))
    _draw_landscape(ax, grid, camera)
    ax.heading("A slice as a matrix", f"{levels.shape[1]} x {levels.shape[0]} pixels, height and color by gray level k")
    return page


def _averaged(levels: NDArray[np.float64], block: int) -> NDArray[np.float64]:
    """Average over blocks, what is over at the edges repeated."""
    pad = [(0, -n % block) for n in levels.shape]
    rows, columns = ((n + more) // block for n, (_, more) in zip(levels.shape, pad, strict=True))
    padded = np.pad(levels, pad, mode="edge")
    return np.asarray(padded.reshape(rows, block, columns, block).mean(axis=(1, 3)))


def _grid(
    levels: NDArray[np.float64], low: float, high: float, step: tuple[float, float], upward: bool
) -> NDArray[np.float64]:
    """Place the levels as heights over a table, rows falling toward the viewer, (J, I, 3)."""
    rows, columns = levels.shape
    x = np.arange(columns) * step[0]
    y = np.arange(rows) * step[1] * (1 if upward else -1)
    z = (levels - low) / ((high - low) or 1.0) * HEIGHT * max(np.ptp(x), np.ptp(y), 1e-9)
    return np.stack(np.broadcast_arrays(x[None, :], y[:, None], z), axis=-1)


def _limit(ax: Panel, seen: NDArray[np.float64]) -> None:
    """Fit a panel to places, with room for the words beside them."""
    low, high = seen.min(axis=0), seen.max(axis=0)
    margin = 0.06 * float((high - low).max() or 1.0)
    ax.limit(*(low - margin), *(high + margin))


def _draw_landscape(ax: Panel, grid: NDArray[np.float64], camera: Camera) -> None:
    vertices = grid.reshape(-1, 3)
    number = np.arange(len(vertices)).reshape(grid.shape[:2])
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    facets = np.stack(corners, axis=2).reshape(-1, 4)
    if normals(vertices, facets)[:, 2].sum() < 0:
        facets = facets[:, ::-1]
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    table = np.array([[low[0], low[1], 0], [high[0], low[1], 0], [high[0], high[1], 0], [low[0], high[1], 0]])
    fill(ax, camera.project(table)[None, :, :2], color=RELIEF(0.0))
    seen = camera.project(vertices)
    level = vertices[facets, 2].mean(axis=1) / (grid[..., 2].max() or 1.0)
    toward = normals(seen, facets)
    light = np.stack([brightness(toward), brightness(-toward)])[:, :, None]
    draw_colored(ax, seen, facets, np.round(RELIEF(level) * (0.45 + 0.55 * light)).astype(np.uint8))


def _draw_box(ax: Panel, grid: NDArray[np.float64], camera: Camera, levels: tuple[float, float]) -> None:
    low, high = grid.min(axis=(0, 1)), grid.max(axis=(0, 1))
    near, left, far = [low[0], low[1], 0.0], [low[0], high[1], 0.0], [high[0], low[1], 0.0]
    top = [low[0], high[1], high[2]]
    axes = camera.project(np.array([[near, left], [near, far], [left, top]]))[:, :, :2]
    lines(ax, axes, color=MUTED, width=0.9)
    for name, ends, shift in zip(("row j", "column i"), axes[:2], ((-22, 6), (0, -13)), strict=True):
        small_print(ax, name, ends.mean(axis=0), shift)
    for level, place in zip(levels, axes[2], strict=True):
        small_print(ax, f"k = {level:.0f}", place, (-6, 0), align=1)
