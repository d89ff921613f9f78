"""What of its window a surface is to follow: the boundary, the outline that fills what it encloses, or a wall's middle.

Lengths are counted in voxels, along each axis in its own, since a surface is known to about one of them whatever their
shape is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from .isosurface.run_mask import RunMask
from .isosurface.sides import WindowSides
from .kernels.threads import in_blocks
from .measure.links import Links
from .measure.report import area_samples
from .measure.shape import MeshExtent, areas_and_volumes, unfolded
from .measure.tree import Tree
from .model.boxes import box_of
from .model.columns import carried
from .model.sliced import areas_of, ranges_of, some_of
from .segmentation.signal import SOLID, closed

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from .isosurface.voxels import Boundary
    from .model.mesh import TriMesh
    from .model.sliced import Sliced
    from .model.volume import Volume

    Floats = NDArray[np.float64]
    Mask = NDArray[np.bool_]

SHELL = 2 * SOLID / (1 + SOLID)
"""Share of what it encloses that a wall fills at most: an annulus of inner over outer radius q fills 1 - q^2 of its
outline and (1 - q^2) / (1 + q^2) of its ellipse, so this is `tomomesh.segmentation.signal.SOLID` said of outlines."""
WALLS = 2.0
"""Voxels of a wall over the faces around it, which is half of its thickness at most, within which a surface is in it: a
wall is here thin and there thick. Chosen: half of it takes the built-in head's 95 % from .5 to 2 voxels, twice lets 2
voxels more pass on a skull."""
SAMPLES = 5_000
"""Places on the mesh, and on the window, that are looked at. The standard error of a share of 5 % is .3 %."""
PARTS = 200
"""Parts of a window's longest side that a network of a number of neurons is asked to tell apart, where voxels are
finer: a head of 256 x 256 pixels is asked for its pixels, and the same head in pixels of half the width for no more.
Chosen: half of it refuses none of the studies of docs/report.md less or more, twice neither."""


@dataclass(frozen=True)
class Apart:
    """How far a mesh and its window are apart.

    Attributes
    ----------
    share : float
        Volume of the mesh over that of the window.
    offset : float
        Their difference over the area of the window's boundary, voxels: how far the whole surface lies off.
    there, back : (s,) float array
        Distances of places on the mesh to the window, and of places on the window to the mesh, voxels.
    """

    share: float
    offset: float
    there: Floats
    back: Floats


class Places(Protocol):
    """Places that are not held in one array; `len` counts them."""

    def __len__(self) -> int: ...

    def some(self, every: int = 1) -> Floats:
        """Return the first of every so many, (n, 3) as indices (x, y, z)."""

    def distances(self, places: Floats, threads: int = 0) -> Floats:
        """Return the distance of other places (p, 3) to the nearest, (p,)."""


@dataclass(frozen=True)
class Followed:
    """What a surface is to follow.

    Attributes
    ----------
    what : str
        How it is followed, a key of `tomomesh.judgement.LIMITS`.
    affine : (4, 4) float array
        Indices of the voxels that lengths are counted in to patient millimeters.
    places : (n, 3) float array or Places
        On the boundary, as voxel indices (x, y, z); or the faces of a window.
    inside : float
        Voxels that the surface should enclose.
    unit : float
        Voxels that count as one: more than 1 where a network cannot be asked to tell voxels apart.
    wall : (K, J, I) bool array, slices of it, or None
        The window, where the surface runs along its middle.
    besides : WindowSides or None
        Where the surface may lie as well: around what lies in a hole, or over the openings of a wall.
    """

    what: str
    affine: Floats
    places: Floats | Places
    inside: float
    unit: float = 1.0
    wall: Sliced | None = None
    besides: WindowSides | None = None

    @classmethod
    def in_space(cls, found: Boundary, mask: Sliced) -> Followed:
        """Ask a network in space for the boundary of a window (K, J, I)."""
        places, inside = found.crossings.positions, float(found.volumes.sum())
        return cls("space", found.affine, places, inside, unit=unit_of(mask))

    def as_closed(self, what: str) -> Followed:
        """Ask the same of a surface that closes the openings of a wall by itself; else it is followed as `what`."""
        return replace(self, what=what if self.wall is None else "closed wall")

    def apart(self, mesh: TriMesh, *, leave_out: Mask | None = None, threads: int = 0) -> Apart:
        """Measure a mesh in patient millimeters against it; `leave_out` are faces (m,) that are no part of it."""
        own = mesh.moved(in_voxels(mesh.vertices, self.affine))
        links, tree = Links(own), Tree.of_faces(own, threads=threads)
        volume = MeshExtent.of(links).volumes(areas_and_volumes(links, threads=threads)[1])
        samples = area_samples(own, SAMPLES, leave_out=leave_out)
        return self.beside(volume, samples, lambda places: tree.nearest(places, threads=threads)[0], threads)

    def beside(self, volume: Floats, samples: Floats, reach: Callable[[Floats], Floats], threads: int = 0) -> Apart:
        """Return how far a mesh is apart, all in voxels.

        Parameters
        ----------
        volume : (1, FOLDS) float array
            Of the mesh, as `tomomesh.measure.shape.MeshExtent.volumes` sums it up.
        samples : (n, 3) float array
            Places on the mesh.
        reach : callable
            Returns how far places (n, 3) are from the mesh, (n,).
        threads : int
        """
        enclosed, there = abs(float(unfolded(volume)[0])), self._from(samples, threads)
        back = reach(_some(self.places))
        if self.wall is not None:
            back = np.maximum(back - WALLS * int(areas_of(self.wall).sum()) / len(self.places), 0.0)
        offset = (enclosed - self.inside) / len(self.places)
        return Apart(enclosed / max(self.inside, 1.0), offset, there, back)

    def _from(self, samples: Floats, threads: int) -> Floats:
        """Return how far samples (n, 3) are from where the surface may lie; 0 within a wall."""
        there, free = np.zeros(len(samples)), np.ones(len(samples), np.bool_)
        if self.wall is not None:
            free = ~_in(self.wall, samples)
        found = [_distances(one, samples[free], threads) for one in (self.places, self.besides) if one is not None]
        there[free] = np.minimum.reduce(found)
        return there


def in_voxels(places: Floats, affine: Floats) -> Floats:
    """Return places in patient millimeters (n, 3) as indices."""
    turn = np.asarray(np.linalg.inv(affine[:3, :3]).T, np.float64)
    return carried(places - affine[:3, 3], turn, np.zeros(3))


def _distances(places: Floats | Places, samples: Floats, threads: int) -> Floats:
    if isinstance(places, np.ndarray):
        return Tree.of_points(places, threads=threads).nearest(samples, threads=threads)[0]
    return places.distances(samples, threads)


def _some(places: Floats | Places) -> Floats:
    """Return about `SAMPLES` of many places."""
    every = -(-len(places) // SAMPLES)
    return places[::every] if isinstance(places, np.ndarray) else places.some(every)


def boundary_followed(mask: Sliced, volume: Volume) -> Followed:
    """Ask contours for the whole boundary of a window (K, J, I)."""
    return Followed("contours", volume.affine, WindowSides.of(mask), float(areas_of(mask).sum()))


def components_followed(mask: Sliced, volume: Volume, *, outlined: bool, threads: int = 0) -> Followed:
    """Ask for the outline of each component of a window (K, J, I); some of them may lie in holes of others."""
    found = outline_followed(mask, volume, outlined=outlined, threads=threads).as_closed("contours")
    return found if found.wall is not None else replace(found, unit=1.0, besides=WindowSides.of(mask))


def outline_followed(mask: Sliced, volume: Volume, *, outlined: bool = False, threads: int = 0) -> Followed:
    """Ask for the outline of a window (K, J, I) in every slice, or for the middle of one that is a wall.

    Networks that were shown outlines are asked for these. One that was shown the pixels of a solid lies inside of it,
    and is asked for the outline all the same.
    """
    areas = areas_of(mask)
    bearing, box = np.pad(areas > 0, 1), box_of(mask)[1:]
    filled = RunMask.of(_filled(mask, bearing, box, start, stop, threads) for start, stop in ranges_of(mask))
    own, enclosed = int(areas.sum()), filled.count
    if outlined or own > SHELL * enclosed:
        return Followed("outline", volume.affine, WindowSides.of(filled), float(enclosed), unit=unit_of(mask))
    return Followed(
        "wall", volume.affine, WindowSides.of(mask), enclosed - own / 2, unit_of(mask),
        wall=mask, besides=WindowSides.of(filled),
    )  # fmt: skip


def unit_of(mask: Sliced) -> float:
    """Return how many voxels count as one for a network that is laid around a whole window (K, J, I)."""
    longest = max(int(side.stop - side.start) for side in box_of(mask))
    return max(1.0, longest / PARTS)


def _filled(mask: Sliced, bearing: Mask, box: tuple[slice, slice], start: int, stop: int, threads: int) -> Mask:
    """Fill what the outside does not reach in some slices, as `tomomesh.segmentation.signal.outline` does.

    A bare slice between two others is filled where both of them are: a surface goes through it. Which are not is told
    by `bearing` (K + 2,), from the one before the first on.
    """
    some, (rows, columns) = some_of(mask, start, stop), box
    filled = np.zeros_like(some)

    def work(first: int, last: int) -> None:
        for n in range(first, last):
            k = start + n
            if bearing[k + 1]:
                filled[n, rows, columns] = _closed(some[n, rows, columns])
            elif bearing[k] and bearing[k + 2]:
                below, above = mask[k - 1], mask[k + 1]
                filled[n, rows, columns] = _closed(below[rows, columns]) & _closed(above[rows, columns])

    in_blocks(work, len(some), block=1, threads=threads)
    return filled


def _closed(plane: Mask) -> Mask:
    filled, _, margin = closed(plane)
    return filled[margin:-margin, margin:-margin]


def _in(mask: Sliced, places: Floats) -> Mask:
    """Tell which places (n, 3), as indices (x, y, z), lie in a voxel of a window."""
    nearest = np.rint(places).astype(np.int64)
    x, y, z = np.clip(nearest, 0, np.array(mask.shape[::-1]) - 1).T
    found = np.zeros(len(places), np.bool_)
    for start, stop in ranges_of(mask):
        own = np.flatnonzero((z >= start) & (z < stop))
        if len(own):
            found[own] = some_of(mask, start, stop)[z[own] - start, y[own], x[own]]
    return found
