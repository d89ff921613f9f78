"""All pictures of a run, from its stages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.networks import Networks
from .contact import draw_slices
from .fit import draw_fit
from .outline import draw_outlines
from .plane import Plane
from .relief import draw_relief
from .render import View
from .slices import draw_contour, draw_regions, draw_window
from .space import draw_points, draw_shaded, draw_surfaces, draw_wireframe

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..model.contours import Contours
    from ..model.mesh import QuadMesh, TriMesh
    from ..model.points import PointSet
    from ..model.trace import Trace
    from .drawing.page import Page


def draw_all(
    *,
    images: NDArray[Any] | None = None,
    mask: NDArray[np.bool_] | None = None,
    networks: Networks | Contours | None = None,
    points: PointSet | None = None,
    cuberille: QuadMesh | None = None,
    triangulated: TriMesh | None = None,
    smoothed: TriMesh | None = None,
    mesh: TriMesh | None = None,
    on_slices: TriMesh | None = None,
    trace: Trace | None = None,
    plane: Plane = Plane(),  # noqa: B008
    view: View = View(),  # noqa: B008
    tolerance: float | None = None,
) -> Iterator[tuple[str, Page]]:
    """Draw every picture whose stages are given, numbered as the paper's figures.

    Parameters
    ----------
    images : (K, J, I) or (K, J, I, L) array
        The slices.
    mask : (K, J, I) bool array
        The window.
    networks : Networks or Contours
        The trained networks, one a slice or several.
    points, cuberille, triangulated, smoothed, mesh, trace
        The later stages.
    on_slices : TriMesh
        The mesh in the voxel indices (i, j, k) of the slices.
    plane : Plane
        Spacing and sense of the slices.
    view : View
        How space is looked at, its unit and axes.
    tolerance : float, optional
        Where the fit rests.

    Yields
    ------
    name : str
        As ``"03-relief"``, the name for a file.
    page : Page
    """
    if images is not None and mask is not None:
        yield from _of_slice(images, mask, networks, plane)
    if mask is not None and networks is not None and len(networks.slices):
        pages = draw_slices(mask, networks, plane)
        yield from ((f"06-slices-{number}", page) for number, page in enumerate(pages, 1))
    if points is not None and len(points):
        yield "07-points", draw_points(points, view)
    if cuberille is not None or triangulated is not None or smoothed is not None:
        yield "08-surfaces", draw_surfaces(cuberille, triangulated, smoothed, view)
    if mesh is not None and len(mesh.faces):
        yield "09-wireframe", draw_wireframe(mesh, view)
        yield "10-shaded", draw_shaded(mesh, view)
    if trace is not None and len(trace.speed):
        yield "11-fit", draw_fit(trace, tolerance=tolerance, unit=view.unit)
    if images is not None and on_slices is not None and len(on_slices.faces):
        drawn = enumerate(draw_outlines(images, on_slices, plane), 1)
        yield from ((f"12-outlines-{number}", page) for number, page in drawn)


@dataclass
class _OnSlice:
    """All neurons (u, 2) of a slice, the pairs (e, 2) of them that are joined, and which of these cross a gap."""

    name: str
    codebook: NDArray[np.float64]
    edges: NDArray[np.int64]
    bridged: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.codebook)


def _on_slice(found: Networks | Contours, k: int) -> _OnSlice:
    """Return what was trained on a slice, as one graph."""
    if isinstance(found, Networks):
        n = int(np.searchsorted(found.slices, k))
        return _OnSlice(found.lattice.name, found.codebooks[n], found.lattice.edges, found.bridged[n])
    rings = found.on(k)
    first = np.cumsum([0, *map(len, rings)])
    edges = [
        n + np.stack([np.arange(len(ring)), (np.arange(len(ring)) + 1) % len(ring)], axis=1)
        for n, ring in zip(first[:-1], rings, strict=True)
    ]
    books, bridged = ([getattr(ring, name) for ring in rings] for name in ("codebook", "bridged"))
    return _OnSlice("rings", np.concatenate(books), np.concatenate(edges), np.concatenate(bridged))


def _of_slice(
    images: NDArray[Any],
    mask: NDArray[np.bool_],
    networks: Networks | Contours | None,
    plane: Plane,
) -> Iterator[tuple[str, Page]]:
    k = median_slice(mask, None if networks is None else networks.slices)
    note = f"slice {k + 1} of {len(images)}"
    yield "03-relief", draw_relief(images[k], plane)
    yield "04-window", draw_window(images[k], mask[k], plane, note=note)
    if networks is None or k not in networks.slices:
        return
    drawn = _on_slice(networks, k)
    yield "05-regions", draw_regions(images[k], mask[k], drawn.codebook, drawn, plane)
    yield "06-network", draw_contour(mask[k], drawn.codebook, drawn, plane, bridged=drawn.bridged)


def median_slice(mask: NDArray[np.bool_], among: NDArray[np.int32] | None = None) -> int:
    """Return the slice with the median number of window pixels, among those given or those that have any."""
    pixels = np.count_nonzero(mask, axis=(1, 2))
    slices = np.flatnonzero(pixels) if among is None or not len(among) else np.asarray(among)
    if not len(slices):
        return 0
    order = np.argsort(pixels[slices], kind="stable")
    return int(slices[order[(len(order) - 1) // 2]])
