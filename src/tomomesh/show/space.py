"""The way through space: points, cuberille, triangles, the fitted mesh (Fig. 7-10)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgba

from ..model.points import BRIDGE, CAP, NEURON
from .marks import dots
from .render import View, draw_faces, draw_smooth, draw_wires, frame, page
from .style import ACCENT, HEIGHT, INK, NETWORK, canvas, heading, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ..model.mesh import QuadMesh, TriMesh
    from ..model.points import PointSet

MOST_POINTS = 60_000
MOST_LINED = 20_000
"""Faces of a panel whose sides are drawn: those of more are under four dots long, and their lines a mud."""
KINDS = {NEURON: ("o", NETWORK), BRIDGE: ("D", ACCENT), CAP: ("s", INK)}
OF_NETWORKS, OF_VOXELS = ("neurons", "bridges", "caps"), ("crossings", "beside added voxels", "on the border")
"""What points of each kind are called, where there are networks and where there are none."""
FRONT = View()


@styled
def draw_points(points: PointSet, view: View = FRONT) -> Figure:
    """Draw the set P, colored by height; the nearer, the larger and the stronger (Fig. 7)."""
    every = -(-len(points) // MOST_POINTS)
    positions, kinds = points.positions[::every], points.kinds[::every]
    width, height = page(view, positions, 5.6, 0.6)
    figure, (ax,) = canvas(width + 0.8, height)
    names = OF_NETWORKS if (points.neurons >= 0).any() else OF_VOXELS
    bar = figure.colorbar(_scatter(ax, positions, kinds, names, view), ax=ax, shrink=0.45, aspect=22, pad=0.01)
    bar.outline.set_visible(False)
    bar.set_label(f"height z ({view.unit})")
    if (kinds != NEURON).any():
        ax.legend(loc="lower center", ncols=3, handletextpad=0.1, columnspacing=1.2)
    frame(ax, positions, view)
    note = f"{len(points):,} points" + (f" in {_slices(points)} slices" if _slices(points) else "")
    heading(ax, "The points P", note + (f", one in {every} drawn" if every > 1 else ""))
    return figure


def _slices(points: PointSet) -> int:
    return len(np.unique(points.slices[points.slices >= 0]))


def _scatter(
    ax: Axes, positions: NDArray[np.float64], kinds: NDArray[np.uint8], names: tuple[str, ...], view: View
) -> ScalarMappable:
    """Draw the points from far to near, and return the scale of their heights."""
    seen = view.camera.project(positions)
    order = np.argsort(seen[:, 2], kind="stable")
    nearness = (seen[:, 2] - seen[:, 2].min()) / (np.ptp(seen[:, 2]) or 1.0)
    scale = ScalarMappable(Normalize(positions[:, 2].min(), positions[:, 2].max()), HEIGHT)
    size = 26 * min(1.0, (3000 / len(seen)) ** 0.5)
    for name, (kind, (marker, color)) in zip(names, KINDS.items(), strict=True):
        chosen = order[kinds[order] == kind]
        if not len(chosen):
            continue
        paint = scale.to_rgba(positions[chosen, 2]) if kind == NEURON else np.tile(to_rgba(color), (len(chosen), 1))
        paint[:, 3] = 0.25 + 0.75 * nearness[chosen] ** 1.5
        spread = size * (0.35 + 0.65 * nearness[chosen]) * (1.0 if kind == NEURON else 0.6)
        dots(ax, seen[chosen, :2], size=spread, color=paint, marker=marker)
        ax.scatter([], [], s=16, color=color, marker=marker, linewidths=0, label=f"{name} ({len(chosen):,})")
    return scale


@styled
def draw_surfaces(
    cuberille: QuadMesh | None, triangulated: TriMesh | None, smoothed: TriMesh | None, view: View = FRONT
) -> Figure:
    """Draw the rough surface, its triangles and the smoothed surface side by side, those given (Fig. 8)."""
    panels = []
    if cuberille is not None:
        note = f"{len(cuberille.quads):,} squares"
        panels.append(("Cuberille", note, cuberille.vertices[cuberille.quads]))
    if triangulated is not None:
        panels.append(("Triangulated", f"{len(triangulated.faces):,} triangles", triangulated.corners))
    if smoothed is not None:
        panels.append(("Smoothed", "low-pass filter", smoothed.corners))
    places = np.concatenate([polygons.reshape(-1, 3) for *_, polygons in panels])
    width, height = page(view, places, 4.1, 0.6)
    figure, axes = canvas(width * len(panels), height, 1, len(panels))
    for letter, ax, (title, note, polygons) in zip("abc", axes, panels, strict=False):
        lined = len(polygons) <= MOST_LINED
        draw_faces(
            ax, polygons, view.camera, edge="#5c4f43" if lined else "face",
            width=_line_width(len(polygons)) if lined else 0.3,
        )  # fmt: skip
        frame(ax, places, view)
        heading(ax, f"{letter}  {title}", note)
    return figure


@styled
def draw_wireframe(mesh: TriMesh, view: View = FRONT, title: str = "The fitted mesh") -> Figure:
    """Draw the edges that face the viewer (Fig. 9)."""
    figure, (ax,) = canvas(*page(view, mesh.vertices, 6.0, 0.6))
    draw_wires(ax, mesh.corners, view.camera, width=1.2 * _line_width(len(mesh.faces)))
    frame(ax, mesh.vertices, view)
    heading(ax, title, f"{len(mesh.vertices):,} vertices, {len(mesh.faces):,} triangles")
    return figure


@styled
def draw_shaded(mesh: TriMesh, view: View = FRONT, title: str = "The fitted surface") -> Figure:
    """Draw the surface in light and shade (Fig. 10)."""
    figure, (ax,) = canvas(*page(view, mesh.vertices, 6.0, 0.6))
    draw_smooth(ax, mesh, view.camera)
    frame(ax, mesh.vertices, view)
    heading(ax, title, f"{len(mesh.faces):,} triangles, shaded")
    return figure


def _line_width(faces: int) -> float:
    """Thin the lines with the number of faces, so that a fine mesh does not turn black."""
    return float(np.clip(0.45 * (6000 / max(faces, 1)) ** 0.5, 0.06, 0.6))
