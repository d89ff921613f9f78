"""Surfaces as collections of a panel: filled faces, smooth shading, points, and a scale to read them by."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import TriMesh as GouraudTriangles
from matplotlib.tri import Triangulation

from .camera import Camera, brightness, normals, painted
from .marks import fill, lines, small_print
from .style import BONE, INK, MUTED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh


NARROWEST = 0.45
"""Shorter over longer side of a page at least, so that what is written has room."""


@dataclass(frozen=True)
class View:
    """How space is looked at and named: the camera, the unit, and what +x, +y and +z are called."""

    camera: Camera = field(default_factory=Camera)
    unit: str = "mm"
    axes: tuple[str, str, str] = ("L", "P", "S")


def draw_faces(
    ax: Axes, polygons: NDArray[np.float64], camera: Camera, *, edge: str = "face", width: float = 0.3
) -> None:
    """Fill (m, 3 or 4, 3) polygons, one shade each."""
    seen = camera.project(polygons)
    order = painted(seen)
    fill(ax, seen[order, :, :2], color=BONE(brightness(normals(seen[order]))), edge=edge, width=width)


def draw_wires(ax: Axes, polygons: NDArray[np.float64], camera: Camera, *, width: float) -> None:
    """Draw the sides of the polygons that face the viewer, those behind others hidden."""
    seen = camera.project(polygons)
    fill(ax, seen[painted(seen), :, :2], color="white", edge=INK, width=width)


def draw_smooth(ax: Axes, mesh: TriMesh, camera: Camera) -> None:
    """Shade a mesh by its vertices' normals, the shades interpolated inside the triangles (Gouraud 1971)."""
    seen = camera.project(mesh.vertices)
    order = painted(seen[mesh.faces])
    if not len(order):
        return
    triangles = Triangulation(seen[:, 0], seen[:, 1], mesh.faces[order])
    shades = GouraudTriangles(triangles, cmap=BONE)
    shades.set_array(brightness(camera.project(mesh.vertex_normals)))
    shades.set_clim(0, 1)
    ax.add_collection(shades, autolim=False)


def frame(ax: Axes, points: NDArray[np.float64], view: View) -> None:
    """Fit a panel to (n, 3) points, and give it a scale bar and the directions of the axes."""
    low, high = _box(view, points)
    side = float((high - low).max())
    ax.set_axis_off()
    ax.set_aspect("equal")
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    _scale_bar(ax, low + side * np.array([0.04, 0.06]), float(high[0] - low[0]), view.unit)
    _directions(ax, np.array([high[0] - 0.13 * side, low[1] + 0.06 * side]), 0.08 * side, view)


def page(view: View, points: NDArray[np.float64], width: float, more: float) -> tuple[float, float]:
    """Return the width and height, in inches, of a page of one panel on which (n, 3) points leave no half empty.

    The longer side of the panel is `width`; `more` inches are written above it.
    """
    low, high = _box(view, points)
    across, up = high - low
    side = max(across, up)
    return width * across / side, max(width * up / side, NARROWEST * width) + more


def _box(view: View, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest and the highest place of a panel that holds points, its scale bar and its axes side by side."""
    seen = view.camera.project(points)[:, :2]
    low, high = seen.min(axis=0), seen.max(axis=0)
    size = float((high - low).max()) or 1.0
    low, high = low - size * np.array([0.04, 0.20]), high + 0.04 * size
    room = max(NARROWEST * (high[1] - low[1]) - (high[0] - low[0]), 0.0) * np.array([0.5, 0.0])
    return low - room, high + room


def nice_length(size: float) -> float:
    """Return the longest of 1, 2 or 5 times a power of ten that is at most a third of the size."""
    power = 10.0 ** np.floor(np.log10(size / 3))
    return float(max(step * power for step in (1, 2, 5) if step * power <= size / 3 * (1 + 1e-9)))


def _scale_bar(ax: Axes, corner: NDArray[np.float64], size: float, unit: str) -> None:
    length = nice_length(size)
    lines(ax, np.array([[corner, corner + np.array([length, 0.0])]]), color=INK, width=2)
    small_print(ax, f"{length:g} {unit}".strip(), corner, (0, 9), align="left")


def _directions(ax: Axes, origin: NDArray[np.float64], length: float, view: View) -> None:
    steps = length * view.camera.project(np.eye(3))[:, :2]
    lines(ax, np.stack([np.tile(origin, (3, 1)), origin + steps], axis=1), color=MUTED, width=1)
    for name, step in zip(view.axes, steps, strict=True):
        small_print(ax, name, origin + 1.35 * step)
