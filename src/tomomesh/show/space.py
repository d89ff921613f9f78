"""The way through space: points, cuberille, triangles, the fitted mesh (Fig. 7-10)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model.points import BRIDGE, CAP, NEURON
from .drawing.axes import color_bar, legend
from .drawing.marks import dots
from .drawing.page import canvas
from .drawing.style import ACCENT, HEIGHT, INK, NETWORK, opaque
from .render import View, draw_faces, draw_smooth, draw_wires, frame, page

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import QuadMesh, TriMesh
    from ..model.points import PointSet
    from .drawing.page import Page, Panel

    Floats = NDArray[np.float64]

MOST_POINTS = 60_000
MOST_LINED = 20_000
"""Faces of a panel whose sides are drawn: those of more are under four dots long, and their lines a mud."""
KINDS = {NEURON: ("o", NETWORK), BRIDGE: ("D", ACCENT), CAP: ("s", INK)}
OF_NETWORKS, OF_VOXELS = ("neurons", "bridges", "caps"), ("crossings", "beside added voxels", "on the border")
"""What points of each kind are called, where there are networks and where there are none."""
FRONT = View()


def draw_points(points: PointSet, view: View = FRONT) -> Page:
    """Draw the set P, colored by height; the nearer, the larger and the stronger (Fig. 7)."""
    every = -(-len(points) // MOST_POINTS)
    positions, kinds = points.positions[::every], points.kinds[::every]
    width, height = page(view, positions, 5.6, 0.85)
    sheet, (ax,) = canvas(width + 0.9, height, below=0.25, right=0.75)
    frame(ax, positions, view)
    low, high = float(positions[:, 2].min()), float(positions[:, 2].max())
    names = OF_NETWORKS if (points.neurons >= 0).any() else OF_VOXELS
    drawn = _scatter(ax, positions, kinds, names, view)
    if (kinds != NEURON).any():
        legend(sheet, drawn, ((ax.box[0] + ax.box[2]) / 2, ax.box[3] + 0.12 * sheet.dpi))
    middle, reach = (ax.box[1] + ax.box[3]) / 2, 0.24 * (ax.box[3] - ax.box[1])
    bar = np.array([ax.box[2] + 0.1 * sheet.dpi, middle - reach, ax.box[2] + 0.19 * sheet.dpi, middle + reach])
    color_bar(sheet, bar, low, high, HEIGHT, f"height z ({view.unit})" if view.unit else "height z")
    note = f"{len(points):,} points" + (f" in {_slices(points)} slices" if _slices(points) else "")
    ax.heading("The points P", note + (f", one in {every} drawn" if every > 1 else ""))
    return sheet


def _slices(points: PointSet) -> int:
    return len(np.unique(points.slices[points.slices >= 0]))


def _scatter(
    ax: Panel, positions: Floats, kinds: NDArray[np.uint8], names: tuple[str, ...], view: View
) -> list[tuple[str, str, str]]:
    """Draw the points from far to near, and return what the legend says of each kind that there is."""
    seen = view.camera.project(positions)
    order = np.lexsort([*positions.T, seen[:, 2]])
    nearness = (seen[:, 2] - seen[:, 2].min()) / (np.ptp(seen[:, 2]) or 1.0)
    height = (positions[:, 2] - positions[:, 2].min()) / (np.ptp(positions[:, 2]) or 1.0)
    paint = np.column_stack([HEIGHT(height), 0.25 + 0.75 * nearness**1.5])
    size = 5.1 * (min(1.0, (3000 / len(seen)) ** 0.5) * (0.35 + 0.65 * nearness)) ** 0.5
    entries = []
    for name, (kind, (marker, color)) in zip(names, KINDS.items(), strict=True):
        chosen = order[kinds[order] == kind]
        if not len(chosen):
            continue
        if kind != NEURON:
            paint[chosen, :3], size[chosen] = opaque(color, 1)[:, :3], 0.77 * size[chosen]
        dots(ax, seen[chosen, :2], size=size[chosen], color=paint[chosen], marker=marker)
        entries.append((marker, color, f"{name} ({len(chosen):,})"))
    return entries


def draw_surfaces(
    cuberille: QuadMesh | None, triangulated: TriMesh | None, smoothed: TriMesh | None, view: View = FRONT
) -> Page:
    """Draw the rough surface, its triangles and the smoothed surface side by side, those given (Fig. 8)."""
    panels = []
    if cuberille is not None:
        panels.append(("Cuberille", f"{len(cuberille.quads):,} squares", cuberille.vertices, cuberille.quads))
    if triangulated is not None:
        told = f"{len(triangulated.faces):,} triangles"
        panels.append(("Triangulated", told, triangulated.vertices, triangulated.faces))
    if smoothed is not None:
        panels.append(("Smoothed", "low-pass filter", smoothed.vertices, smoothed.faces))
    places = np.concatenate([vertices for _, _, vertices, _ in panels])
    width, height = page(view, places, 4.1, 0.6)
    sheet, axes = canvas(width * len(panels), height, 1, len(panels))
    for letter, ax, (title, note, vertices, polygons) in zip("abc", axes, panels, strict=False):
        width = _line_width(len(polygons)) if len(polygons) <= MOST_LINED else 0.0
        frame(ax, places, view)
        draw_faces(ax, vertices, polygons, view.camera, edge="#5c4f43", width=width)
        ax.heading(f"{letter}  {title}", note)
    return sheet


def draw_wireframe(mesh: TriMesh, view: View = FRONT, title: str = "The fitted mesh") -> Page:
    """Draw the edges that nothing hides (Fig. 9)."""
    sheet, (ax,) = canvas(*page(view, mesh.vertices, 6.0, 0.6))
    frame(ax, mesh.vertices, view)
    draw_wires(ax, mesh, view.camera, width=1.2 * _line_width(len(mesh.faces)))
    ax.heading(title, f"{len(mesh.vertices):,} vertices, {len(mesh.faces):,} triangles")
    return sheet


def draw_shaded(mesh: TriMesh, view: View = FRONT, title: str = "The fitted surface") -> Page:
    """Draw the surface in light and shade (Fig. 10)."""
    sheet, (ax,) = canvas(*page(view, mesh.vertices, 6.0, 0.6))
    frame(ax, mesh.vertices, view)
    draw_smooth(ax, mesh, view.camera)
    ax.heading(title, f"{len(mesh.faces):,} triangles, shaded")
    return sheet


def _line_width(faces: int) -> float:
    """Thin the lines with the number of faces, so that a fine mesh does not turn black."""
    return float(np.clip(0.45 * (6000 / max(faces, 1)) ** 0.5, 0.06, 0.6))
