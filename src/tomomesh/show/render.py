"""Surfaces on a panel: filled faces, wires, smooth shading; and a scale to read them by."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from .camera import Camera, brightness, normals
from .drawing.marks import lines, small_print
from .drawing.style import BEHIND, BONE, INK, MUTED
from .drawing.surface import draw_polygons

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh
    from .drawing.page import Panel

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int64]
    Bytes = NDArray[np.uint8]


NARROWEST = 0.45
"""Shorter over longer side of a page at least, so that what is written has room."""


@dataclass(frozen=True)
class View:
    """How space is looked at and named: the camera, the unit, and what +x, +y and +z are called."""

    camera: Camera = field(default_factory=Camera)
    unit: str = "mm"
    axes: tuple[str, str, str] = ("L", "P", "S")


def draw_faces(
    ax: Panel, vertices: Floats, polygons: Ints, camera: Camera, *, edge: str = INK, width: float = 0.0
) -> None:
    """Fill (m, 3 or 4) polygons, one shade each, with their sides as lines `width` points wide."""
    seen = camera.project(vertices)
    draw_colored(ax, seen, polygons, _lit(normals(seen, polygons)), edge=edge, width=width)


def draw_wires(ax: Panel, mesh: TriMesh, camera: Camera, *, width: float) -> None:
    """Draw the sides of the faces, those behind others hidden."""
    white = np.full((2, len(mesh.faces), 3), 255, np.uint8)
    draw_colored(ax, camera.project(mesh.vertices), mesh.faces, white, width=width)


def draw_smooth(ax: Panel, mesh: TriMesh, camera: Camera) -> None:
    """Shade a mesh by its vertices' normals, the shades blended inside the triangles (Gouraud 1971)."""
    shades = _lit(camera.project(mesh.vertex_normals))
    draw_colored(ax, camera.project(mesh.vertices), mesh.faces, shades, smooth=True)


def _lit(directions: Floats) -> Bytes:
    """Return the colors of surfaces with the given normals, of the camera's frame, from the front and from behind."""
    return np.stack([BONE(brightness(directions)), BEHIND(brightness(-directions))])


def draw_colored(
    ax: Panel, seen: Floats, polygons: Ints, colors: Bytes, *, smooth: bool = False, edge: str = INK,
    width: float = 0.0,
) -> None:  # fmt: skip
    """Draw (m, 3 or 4) polygons over (n, 3) places of the camera's frame in the colors of both of their sides."""
    corners = np.column_stack([ax.place(seen[:, :2]) - ax.box[:2], ax.scale * seen[:, 2]])
    draw_polygons(ax.pixels, corners, polygons, colors, smooth=smooth, line=ax.page.points(width), ink=edge)


def frame(ax: Panel, points: Floats, view: View) -> None:
    """Fit a panel to (n, 3) points, and give it a scale bar and the directions of the axes."""
    low, high = _box(view, points)
    side = float((high - low).max())
    ax.limit(low[0], low[1], high[0], high[1])
    _scale_bar(ax, low + side * np.array([0.04, 0.06]), float(high[0] - low[0]), view.unit)
    _directions(ax, np.array([high[0] - 0.13 * side, low[1] + 0.06 * side]), 0.08 * side, view)


def page(view: View, points: Floats, width: float, more: float) -> tuple[float, float]:
    """Return the width and height, in inches, of a page of one panel on which (n, 3) points leave no half empty.

    The longer side of the panel is `width`; `more` inches are written above it.
    """
    low, high = _box(view, points)
    across, up = high - low
    side = max(across, up)
    return width * across / side, max(width * up / side, NARROWEST * width) + more


def _box(view: View, points: Floats) -> tuple[Floats, Floats]:
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


def _scale_bar(ax: Panel, corner: Floats, size: float, unit: str) -> None:
    length = nice_length(size)
    ax.rule(ax.place(np.array([corner, corner + np.array([length, 0.0])])), 2, INK)
    small_print(ax, f"{length:g} {unit}".strip(), corner, (0, 9), align=0)


def _directions(ax: Panel, origin: Floats, length: float, view: View) -> None:
    steps = length * view.camera.project(np.eye(3))[:, :2]
    lines(ax, np.stack([np.tile(origin, (3, 1)), origin + steps], axis=1), color=MUTED, width=1)
    for name, step in zip(view.axes, steps, strict=True):
        small_print(ax, name, origin + 1.35 * step)
