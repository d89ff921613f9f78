"""From a stack of contours to a closed surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..errors import EmptyError, GeometryError
from ..isosurface.voxels import Boundary, VoxelSurface, boundary, voxel_surface
from ..kernels.threads import in_blocks
from ..model.volume import Grid, Volume
from ..progress import Progress, silent
from ..settings import FitSettings
from .assembly import Stack
from .curves import DENSE, chord, fine_curve
from .levels import slices_at, typical_gap
from .parts import Part, width_of
from .rings import Outline, nested, outline
from .shape_interpolation import filled_between
from .tracks import link_parts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..model.mesh import TriMesh
    from .slices import Slices

    Floats = NDArray[np.float64]

MOST_VOXELS = 60_000_000
"""Voxels of the interpolated volume, over which they are made larger. 240 MB of 32-bit levels."""
COARSER = 1.02
"""Factor by which they are, as often as it takes. Three powers of it are 6 %: at most so much of the memory is given
away."""
SPRINGS = 0.4
"""Share of the springs' stiffness: interpolated distances are smooth, and small parts should keep their width. Chosen:
half of it changes the distance by +3.3 %, twice by -0.5 %."""
MEASURED = 0.75
"""Faces farther than this from every point, in slice distances, are filled rather than measured. Chosen: half and twice
of it change no case of benchmarks/constants.py."""


@dataclass(frozen=True)
class ContourSurface:
    """The surface of a stack of contours.

    Attributes
    ----------
    boundary : Boundary
        The interpolated volume's boundary.
    rest : VoxelSurface
        The net around it at rest.
    filled : (m,) bool array
        Faces that are far from every point: on the ends of parts, and where slices are missing.
    stack : Stack
        The parts, and how they go on.
    slices, contours, open : int
        Sliced, contours, and those among them that did not close by themselves.
    reach : float
        Longest gap that was closed, in local sampling distances.
    asked_edge : float
        Edge of the voxels without a limit on the memory.
    voxels : int
        Voxels interpolated.
    """

    boundary: Boundary
    rest: VoxelSurface
    filled: NDArray[np.bool_]
    stack: Stack
    slices: int
    contours: int
    open: int
    reach: float
    asked_edge: float
    voxels: int

    @property
    def mesh(self) -> TriMesh:
        """The surface."""
        return self.rest.mesh

    @property
    def edge(self) -> float:
        """Edge of the voxels."""
        return self.stack.edge


def contour_surface(
    points: Floats,
    slices: Slices,
    *,
    edge: float | None = None,
    thickness: float | None = None,
    allow_leaks: bool = False,
    fit: FitSettings | None = None,
    threads: int = 0,
    progress: Progress = silent,
) -> ContourSurface:
    """Close the surface of a stack of contours.

    Parameters
    ----------
    points : (n, 3) float array
    slices : Slices
        As `find_slices` finds them.
    edge : float, optional
        Edge of the voxels; the sampling distance within the slices where not given.
    thickness : float, optional
        How thick a part is that goes on in no other slice; a slice distance where not given.
    allow_leaks : bool
        Close open contours by their chord.
    fit : FitSettings, optional
    threads : int
    progress : callable

    Returns
    -------
    ContourSurface

    Raises
    ------
    GeometryError
        Where a contour does not close; names the height of its slice.
    EmptyError
        Where no contour encloses anything, or all are too thin for the voxels.
    """
    drawn, found = _drawn(points, slices, allow_leaks, threads, progress)
    _refuse_open(found, slices, allow_leaks)
    asked = edge or slices.spacing
    stack = _stack(drawn, found, slices, asked, thickness)
    levels = _levels(stack, threads, progress)
    volume = _volume(levels, stack, slices)
    inside = levels > 0
    _require_any(inside, stack.edge)
    edges = boundary(volume, inside, lower=0.0, threads=threads)
    fit = fit or FitSettings()
    softer = replace(fit, stiffness=SPRINGS * fit.stiffness)
    rest = voxel_surface(edges, softer, threads=threads, progress=progress)
    centers = rest.mesh.corners.mean(axis=1)
    measured = _along(stack, slices) if slices.rings else points
    away, _ = scipy.spatial.cKDTree(measured).query(centers, distance_upper_bound=MEASURED * stack.step)
    return ContourSurface(
        edges, rest, np.isinf(away), stack, slices_at(slices.heights, width_of(stack.parts)),
        sum(len(outlined.rings) for outlined in found),
        sum(len(outlined.open) for outlined in found), max(outlined.reach for outlined in found), asked, levels.size,
    )  # fmt: skip


def solid_between(
    slices: Slices, heights: Floats, *, threads: int = 0, progress: Progress = silent
) -> tuple[NDArray[np.float32], Floats, float]:
    """Interpolate the inside of rings that are known to layers of pixels.

    Parameters
    ----------
    slices : Slices
        With `rings`; the pixels are as wide as its `spacing`, and lie at whole multiples of it, or wider where there
        would be too many.
    heights : (K,) float array
        Of the layers, rising.
    threads : int
    progress : callable

    Returns
    -------
    (K, J, I) float32 array, (2,) float array, float
        Depths in pixels, over 0 inside; the middle of the first pixel, in the frame of the slices; its edge.

    Raises
    ------
    EmptyError
        Where fewer than two slices enclose anything.
    """
    drawn, found = _drawn(np.empty((0, 3)), slices, False, threads, progress)
    stack = replace(_stack(drawn, found, slices, slices.spacing, None), on_pixels=True)
    return _levels(stack, threads, progress, heights), stack.low[:2], stack.edge


def _levels(stack: Stack, threads: int, progress: Progress, at: Floats | None = None) -> NDArray[np.float32]:
    """Return depths inside of the parts and between them."""
    levels = filled_between(stack, at, threads=threads, progress=progress)
    return np.negative(levels, out=levels)


def _drawn(
    points: Floats, slices: Slices, allow_leaks: bool, threads: int, progress: Progress
) -> tuple[list[Floats], list[Outline]]:
    """Return the points (n, 3) of each plane, and the inside along them."""
    placed = slices.placed(points)
    drawn = [np.unique(placed[slices.labels == k], axis=0) for k in range(len(slices.heights))]
    found: list[Outline] = [outline(placed[:0, :2])] * len(drawn)

    def work(start: int, stop: int) -> None:
        for k in range(start, stop):
            rings = [slices.placed(ring) for ring in slices.rings[k]] if slices.rings else []
            drawn[k], found[k] = _known(rings) if rings else _outlined(drawn[k], allow_leaks)

    in_blocks(work, len(drawn), block=1, threads=threads, done=lambda n: progress("contours", n, len(drawn)))
    return drawn, found


def _require_any(inside: NDArray[np.bool_], edge: float) -> None:
    """Refuse contours that enclose the center of no voxel."""
    if not inside.any():
        raise EmptyError(
            "the contours enclose no voxel", found=f"edge = {edge:.4g}", expected="contours wider than a voxel",
            hint="a smaller --cell",
        )  # fmt: skip


def _known(rings: Sequence[Floats]) -> tuple[Floats, Outline]:
    """Return the points (n, 3) of rings that are known, each once, and the outline along them."""
    curves = [ring[(ring != np.roll(ring, 1, axis=0))[:, :2].any(axis=1)] for ring in rings]
    return np.concatenate(curves), nested([curve[:, :2] for curve in curves])


def _outlined(points: Floats, allow_leaks: bool) -> tuple[Floats, Outline]:
    """Return the outline of a slice, and its points (n, 3) with those of the chords that close it."""
    placed, first = np.unique(points[:, :2], axis=0, return_index=True)
    heights = points[first, 2]
    found = outline(placed)
    if not (found.open and allow_leaks):
        return np.column_stack([placed, heights]), found
    chords = [(chord(placed[numbers]), heights[numbers].mean()) for numbers in found.open]
    more = [np.column_stack([line, np.full(len(line), height)]) for line, height in chords]
    closed, again = _outlined(np.concatenate([np.column_stack([placed, heights]), *more]), allow_leaks=False)
    return closed, Outline(again.rings, again.parts, found.open, again.reach)


def _refuse_open(found: list[Outline], slices: Slices, allow_leaks: bool) -> None:
    opened = [k for k, outlined in enumerate(found) if outlined.open]
    if opened and not allow_leaks:
        middle = slices.origin + slices.heights[opened[0]] * slices.normal
        raise GeometryError(
            "a contour of the stack does not close",
            found=f"slice at {slices.normal @ middle:.6g} along ({', '.join(f'{n:.3g}' for n in slices.normal)}), "
            f"{len(opened)} of {len(found)} slices",
            expected="contours whose gaps are narrower than their inside",
            hint="--allow-leaks, which closes them by their chords",
        )


def _stack(
    drawn: list[Floats], found: list[Outline], slices: Slices, edge: float, thickness: float | None = None
) -> Stack:
    """Link the parts of all slices."""
    parts = [
        part
        for k, (points, outlined) in enumerate(zip(drawn, found, strict=True))
        for part in _parts(points, outlined, DENSE * edge, k)
    ]
    if len({part.plane for part in parts}) < (2 if thickness is None else 1):
        raise EmptyError("the contours enclose nothing", expected="at least two slices with closed contours")
    links = link_parts(parts, slices.groups, edge, complete=slices.complete, sparse=slices.sparse)
    stack = Stack(parts, links, edge, typical_gap(slices.heights, width_of(parts)) or thickness or 0.0, thickness)
    while np.prod(stack.shape) > MOST_VOXELS:
        stack = replace(stack, edge=COARSER * stack.edge)
    return stack


def _along(stack: Stack, slices: Slices) -> Floats:
    """Return places about a voxel apart along the curves of all slices, in space."""
    step = round(1 / DENSE)
    curves = [(curve[::step], part.height) for part in stack.parts for curve in part.curves]
    placed = np.concatenate([np.column_stack([curve, np.full(len(curve), height)]) for curve, height in curves])
    return np.asarray(slices.origin + placed @ slices.axes)


def _parts(points: Floats, outlined: Outline, distance: float, plane: int) -> list[Part]:
    """Draw the rings of a slice finely, and gather those around one part; ordered by the parts' places."""
    rings: dict[int, list[Floats]] = {}
    for ring, part in zip(outlined.rings, outlined.parts, strict=True):
        rings.setdefault(part, []).append(points[ring])
    parts = [
        Part.within([fine_curve(ring[:, :2], distance) for ring in one], float(np.concatenate(one)[:, 2].mean()), plane)
        for one in rings.values()
    ]
    return sorted((part for part in parts if part.moments.area > 0), key=lambda part: tuple(part.moments.center))


def _volume(levels: NDArray[np.float32], stack: Stack, slices: Slices) -> Volume:
    """Place the interpolated voxels in space."""
    affine = np.eye(4)
    affine[:3, :3] = slices.axes.T * stack.edge
    affine[:3, 3] = slices.origin + slices.axes.T @ stack.low
    return Volume(levels, affine, Grid((0, 1, 2), (False, False, False), affine))
