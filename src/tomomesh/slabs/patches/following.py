"""How far a mesh in patches is from what it is to follow."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...followed import SAMPLES, in_voxels
from ...measure.links import Links
from ...measure.report import drawn, placed_on
from ...measure.shape import areas_and_volumes
from .nearest import PatchTrees

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...followed import Apart, Followed
    from ...measure.shape import MeshExtent
    from ..keep import Kept
    from .patch import MeshPatch, Patches

    Floats = NDArray[np.float64]


def apart_in(patches: Patches, followed: Followed, threads: int = 0) -> Apart:
    """Measure what `tomomesh.followed.Followed.apart` measures on a whole mesh, to the last bit.

    Faces over which the study is cut off are no part of it.
    """
    own = patches.moved(_in_voxels, followed.affine)
    volume = np.sum(own.told(_volume, [own.extent]), axis=0)
    return followed.beside(volume, _samples(own), PatchTrees.of(own).reach, threads)


def _in_voxels(patch: MeshPatch, affine: Floats) -> MeshPatch:
    return replace(patch, vertices=in_voxels(patch.vertices, affine))


def _volume(patch: MeshPatch, extent: MeshExtent) -> Floats:
    return extent.volumes(areas_and_volumes(Links(patch), extent)[1])


def _samples(own: Patches) -> Floats:
    """Draw places from the mesh as `tomomesh.measure.report.area_samples` does, (n, 3).

    Areas are added up face after face, so one patch goes on where the other has ended.
    """
    areas, (shares, sides) = own.each(_areas), drawn(SAMPLES)
    parts = [(n, quarters) for quarters in (False, True) for n in range(len(own))]
    ends = [0.0]
    for n, quarters in parts:
        ends += own.slabs.fetch(own.slabs.each(_end, [own.kept[n]], [areas[n]], [quarters], [ends[-1]]))
    if ends[-1] == 0:
        return np.empty((0, 3))
    reached, corners = shares * ends[-1], np.empty((SAMPLES, 3, 3))
    part = np.searchsorted(ends[1:], reached, side="right")
    for m in np.unique(part).tolist():
        n, quarters = parts[m]
        column: list[list[Kept]] = [[one] for one in (own.kept[n], areas[n], quarters, ends[m], reached[part == m])]
        (corners[part == m],) = own.slabs.fetch(own.slabs.each(_chosen, *column))
    return placed_on(corners, sides)


def _areas(patch: MeshPatch) -> Floats:
    return np.where(patch.cut_off, 0.0, areas_and_volumes(Links(patch))[0])


def _rows(patch: MeshPatch, quarters: bool) -> slice:
    return slice(patch.halves, None) if quarters else slice(patch.halves)


def _end(patch: MeshPatch, areas: Floats, quarters: bool, begin: float) -> float:
    """Return what areas add up to, from what those before did."""
    return float(np.cumsum(np.append(begin, areas[_rows(patch, quarters)]))[-1])


def _chosen(patch: MeshPatch, areas: Floats, quarters: bool, begin: float, reached: Floats) -> Floats:
    """Return the corners (n, 3, 3) of the faces at which the areas add up to so much."""
    rows = _rows(patch, quarters)
    sums = np.cumsum(np.append(begin, areas[rows]))[1:]
    return np.asarray(patch.vertices[patch.faces[rows][np.searchsorted(sums, reached, side="right")]])
