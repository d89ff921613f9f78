"""The finished mesh on the slices: its cut with the plane of each, over the gray levels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..measure.section import section
from .contact import COLUMNS, pages, scale_bar, write_beside
from .marks import lines
from .plane import PIXELS, Plane, contrast, gray
from .style import INK, MUTED, canvas, styled

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Floats = NDArray[np.float64]

OUTLINE = "#ff7a1a"
INSIDE = 0.5
"""Slices by which a cut keeps from the ends of the mesh: in the plane of a cap there is no outline to see."""


def draw_outlines(images: NDArray[Any], mesh: TriMesh, plane: Plane = PIXELS) -> Iterator[Figure]:
    """Draw all slices that a mesh cuts with its outline, page by page, at one scale and one contrast.

    Parameters
    ----------
    images : (K, J, I) or (K, J, I, L) array
        Gray levels.
    mesh : TriMesh
        In voxel indices (i, j, k).
    plane : Plane
        Spacing and sense of the slices.

    Yields
    ------
    Figure
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    every = np.arange(max(0, int(np.ceil(low[2]))), min(len(images), int(np.floor(high[2])) + 1))
    if not len(every):
        return
    inset = min(INSIDE, float(high[2] - low[2]) / 2)
    ends = plane.place(np.stack([low, high])[:, :2])
    margin = 0.05 * (ends[1] - ends[0]).max() * np.array([[-1.0], [1.0]])
    span = contrast(gray(images[every[len(every) // 2]]))
    for part in pages(every):
        which = f"Slices {part[0] + 1} to {part[-1] + 1} of {len(images)}"
        heights = np.clip(part, low[2] + inset, high[2] - inset)
        cuts = [plane.place(section(mesh, float(k)).reshape(-1, 2)).reshape(-1, 2, 2) for k in heights]
        yield _page([gray(images[k]) for k in part], cuts, part, plane, ends + margin, span, which)


@styled
def _page(
    images: list[Floats], cuts: list[Floats], part: NDArray[np.intp], plane: Plane, bounds: Floats,
    span: tuple[float, float], which: str,
) -> Figure:  # fmt: skip
    width, height = bounds[1] - bounds[0]
    rows, columns = -(-len(part) // COLUMNS), min(len(part), COLUMNS)
    panel = 1.75 * float(np.clip(height / width, 0.4, 1.8)) + 0.2
    figure, axes = canvas(1.75 * COLUMNS, rows * panel + 0.7, rows, columns, gap=0.01)
    for ax, image, cut, k in zip(axes, images, cuts, part, strict=False):
        plane.draw(ax, image, span)
        lines(ax, cut, color=OUTLINE, width=0.8)
        plane.crop(ax, bounds)
        write_beside(ax, f"{k + 1}", 0, 1.0, color=INK, weight="bold")
    for ax in axes:
        ax.set_axis_off()
    scale_bar(axes[0], bounds, plane)
    figure.suptitle(which, x=0.01, ha="left", fontsize=10, fontweight="bold")
    note = "the mesh where the plane of each slice cuts it, at its ends half a slice inside"
    figure.text(0.99, 1 - 0.12 / figure.get_figheight(), note, ha="right", va="top", color=MUTED, fontsize=8)
    return figure
