"""A slice as the matrix that it is: gray levels as heights (Fig. 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .camera import Camera, brightness, normals, painted
from .marks import fill, lines, small_print
from .plane import PIXELS, Plane, gray
from .style import MUTED, RELIEF, canvas, heading, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

SIDE = 128
"""Most facets along a side; larger images are averaged down to it."""
HEIGHT = 0.34
"""Height of the relief over the longer side of the slice."""
TABLE = Camera(azimuth=24.0, elevation=38.0)


@styled
def draw_relief(image: NDArray[Any], plane: Plane = PIXELS, camera: Camera = TABLE) -> Figure:
    """Draw the gray levels of a slice as a landscape (Fig. 3)."""
    levels = gray(image)
    block = -(-max(levels.shape) // SIDE)
    coarse = _averaged(levels, block)
    low, high = float(coarse.min()), float(coarse.max())
    grid = _grid(coarse, low, high, (plane.spacing_mm[0] * block, plane.spacing_mm[1] * block), plane.upward)
    figure, (ax,) = canvas(8.2, 5.2)
    _draw_box(ax, grid, camera, (low, high))
    _draw_landscape(ax, grid, camera)
    note = f"{levels.shape[1]} x {levels.shape[0]} pixels, height and color by gray level k"
    heading(ax, "A slice as a matrix", note)
    return figure


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


def _draw_landscape(ax: Axes, grid: NDArray[np.float64], camera: Camera) -> None:
    corners = [grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]]
    facets = np.stack(corners, axis=2).reshape(-1, 4, 3)
    upright = facets if normals(facets)[:, 2].sum() > 0 else facets[:, ::-1]
    seen = camera.project(upright)
    order = painted(seen)
    low, high = grid.min(axis=(0, 1)), grid.max(axis=(0, 1))
    table = [[low[0], low[1], 0], [high[0], low[1], 0], [high[0], high[1], 0], [low[0], high[1], 0]]
    fill(ax, camera.project(np.array([table]))[:, :, :2], color=RELIEF(0.0))
    level = upright[order, :, 2].mean(axis=1) / (grid[..., 2].max() or 1.0)
    colors = RELIEF(level)
    colors[:, :3] *= (0.45 + 0.55 * brightness(normals(seen[order])))[:, None]
    fill(ax, seen[order, :, :2], color=colors)


def _draw_box(ax: Axes, grid: NDArray[np.float64], camera: Camera, levels: tuple[float, float]) -> None:
    low, high = grid.min(axis=(0, 1)), grid.max(axis=(0, 1))
    near, left, far = [low[0], low[1], 0.0], [low[0], high[1], 0.0], [high[0], low[1], 0.0]
    top = [low[0], high[1], high[2]]
    axes = camera.project(np.array([[near, left], [near, far], [left, top]]))[:, :, :2]
    lines(ax, axes, color=MUTED, width=0.9)
    for name, ends, shift in zip(("row j", "column i"), axes[:2], ((-22, 6), (0, -13)), strict=True):
        small_print(ax, name, ends.mean(axis=0), shift)
    for level, place in zip(levels, axes[2], strict=True):
        small_print(ax, f"k = {level:.0f}", place, (-6, 0), align="right")
    ax.set_axis_off()
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.margins(0.06)
