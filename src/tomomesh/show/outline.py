"""The finished mesh on the slices: its cut with the plane of each, over the gray levels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..measure.section import section
from .contact import contact_sheet, pages, write_beside
from .drawing.marks import lines
from .drawing.style import INK
from .plane import PIXELS, Plane, contrast, gray

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..model.mesh import TriMesh
    from .drawing.page import Page

    Floats = NDArray[np.float64]

OUTLINE = "#ff7a1a"
INSIDE = 0.5
"""Slices by which a cut keeps from the ends of the mesh: in the plane of a cap there is no outline to see."""


def draw_outlines(images: NDArray[Any], mesh: TriMesh, plane: Plane = PIXELS) -> Iterator[Page]:
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
    Page
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


def _page(
    images: list[Floats], cuts: list[Floats], part: NDArray[np.intp], plane: Plane, bounds: Floats,
    span: tuple[float, float], which: str,
) -> Page:  # fmt: skip
    note = "the mesh where the plane of each slice cuts it, at its ends half a slice inside"
    page, axes = contact_sheet(len(part), bounds, plane, which, note)
    for ax, image, cut, k in zip(axes, images, cuts, part, strict=True):
        plane.draw(ax, image, span)
        lines(ax, cut, color=OUTLINE, width=0.8)
        write_beside(ax, f"{k + 1}", 0, above=True, color=INK, strong=True)
    return page
