"""The patches of a mesh joined: what is counted on each, added up, and what only several of them together tell."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...kernels.measure.edges import find_roots, join_borders, join_corners, join_pairs
from ...measure.links import Links
from ...measure.shape import unfolded
from ...measure.topology import Topology
from ...model.mesh import TriMesh
from .counts import PatchCounts, Rim, Tally, at_marked, counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .patch import Patches

    Bools = NDArray[np.bool_]
    Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Seams:
    """All faces with a shared vertex, as one small mesh in which the neighborhoods of these vertices are whole.

    Attributes
    ----------
    links : Links
    shared : (n,) bool array
        Its vertices that several patches may use.
    rim : Rim
        What the patches said of its faces; connected pieces and lines of borders are told apart from those of others.
    """

    links: Links
    shared: Bools
    rim: Rim

    @classmethod
    def between(cls, rims: Sequence[Rim], pieces: Sequence[int], shared: NDArray[np.int64]) -> Seams:
        """Put the rims of patches with so many connected pieces together; `shared` (s,) rise."""
        before = np.cumsum([0, *pieces])
        lines = np.cumsum([0, *(int(rim.lines.max(initial=-1)) + 1 for rim in rims)])
        moved = [
            replace(rim, pieces=rim.pieces + before[n], lines=rim.lines.astype(np.int64) + lines[n])
            for n, rim in enumerate(rims)
        ]
        rim = Rim(*(np.concatenate([getattr(one, field.name) for one in moved]) for field in fields(Rim)))
        numbers, first, faces = np.unique(rim.faces, return_index=True, return_inverse=True)
        mesh = TriMesh(rim.corners.reshape(-1, 3)[first], faces.reshape(-1, 3))
        return cls(Links(mesh), np.isin(numbers, shared, assume_unique=True), rim)

    @cached_property
    def starts(self) -> Ints:
        """The first half edge of each edge, (e,)."""
        order, first = self.links.edges
        return np.asarray(order[first[:-1]], np.int32)

    @cached_property
    def theirs(self) -> Bools:
        """Which edges (e,) have a shared vertex, and so are counted here and nowhere else."""
        return at_marked(self.links, self.shared)

    @cached_property
    def borders(self) -> Ints:
        """Half edges of these that have no other beside them."""
        return np.asarray(self.starts[self.theirs & (self.links.uses == 1)], np.int32)

    @cached_property
    def misoriented(self) -> int:
        """Number of these edges that two faces run through in one direction."""
        order, first = self.links.edges
        corner = self.links.faces.reshape(-1)
        same = corner[self.starts] == corner[order[first[1:] - 1]]
        return int((same & self.theirs & (self.links.uses == 2)).sum())

    @cached_property
    def fans(self) -> Ints:
        """The lowest corner of the fan of each corner, (3 d,)."""
        roots = np.arange(self.links.faces.size, dtype=np.int32)
        join_corners(self.links.faces, *self.links.edges, roots)
        return roots

    @property
    def fan_count(self) -> int:
        """Number of fans around shared vertices."""
        at = np.flatnonzero(self.fans == np.arange(len(self.fans)))
        return int(self.shared[self.links.faces.reshape(-1)[at]].sum())

    def loops(self) -> NDArray[np.intp]:
        """Return a face of each closed line of borders that comes by here, (l,)."""
        corners = len(self.fans)
        _, names = np.unique(self.rim.lines, return_inverse=True)
        roots = np.concatenate([self.fans, np.arange(corners, corners + names.max(initial=-1) + 1, dtype=np.int32)])
        join_pairs(np.arange(corners), corners + names.reshape(-1).astype(np.int64), roots)
        join_borders(self.borders, roots)
        find_roots(roots)
        ends = np.concatenate([self.borders, np.flatnonzero(self.rim.bordered.reshape(-1))])
        _, one = np.unique(roots[ends], return_index=True)
        return ends[one] // 3

    def joined(self, pieces: int) -> NDArray[np.int64]:
        """Return the number of the connected piece of the whole that each of the patches' pieces is part of."""
        roots = np.arange(pieces + len(self.shared), dtype=np.int32)
        corner = self.links.faces.reshape(-1).astype(np.int64)
        at = self.shared[corner]
        join_pairs(np.repeat(self.rim.pieces, 3)[at].astype(np.int64), pieces + corner[at], roots)
        return np.unique(roots[:pieces], return_inverse=True)[1]


@dataclass(frozen=True)
class Gathered:
    """A mesh as its patches tell of it together.

    Attributes
    ----------
    topology : Topology
    table : Tally
        Of its connected pieces, in the order of their lowest vertex.
    seams : Seams
    numbers : (p,) int64 array
        The row of each connected piece of the patches.
    pieces : list of int
        How many of these each patch has.
    finite : bool
        Whether all vertices are.
    """

    topology: Topology
    table: Tally
    seams: Seams
    numbers: NDArray[np.int64]
    pieces: list[int]
    finite: bool


def whole_of(patches: Patches, *, cavities: int = 0) -> Gathered:
    """Count on a mesh in patches what `tomomesh.measure.topology.topology` counts on a whole one.

    Parameters
    ----------
    patches : Patches
    cavities : int
        Components that are known to line a cavity, and so must face inward.

    Returns
    -------
    Gathered
    """
    found: list[PatchCounts] = patches.told(counted, [patches.extent])
    pieces = [len(one.table.faces) for one in found]
    seams = Seams.between([one.rim for one in found], pieces, patches.shared)
    table, numbers = _joined([one.table for one in found], seams)
    finite = all(one.finite for one in found)
    return Gathered(_topology(found, table, seams, cavities), table, seams, numbers, pieces, finite)


def _joined(tables: list[Tally], seams: Seams) -> tuple[Tally, NDArray[np.int64]]:
    """Add up the rows of what hangs together, and what the seams add to them; return also where each row went."""
    rows = Tally(*(np.concatenate([getattr(one, field.name) for one in tables]) for field in fields(Tally)))
    rows = _with_seams(rows, seams)
    number = seams.joined(len(rows.faces))
    lowest = np.full(number.max(initial=-1) + 1, np.iinfo(np.int64).max)
    np.minimum.at(lowest, number, rows.lowest)
    number = np.argsort(np.argsort(lowest))[number]
    sums = {field.name: _added(getattr(rows, field.name), number, len(lowest)) for field in fields(Tally)}
    return replace(Tally(**sums), lowest=np.sort(lowest)), number


def _with_seams(rows: Tally, seams: Seams) -> Tally:
    """Give the vertices, edges and borders that are counted at the seams to pieces that they belong to."""
    count, piece = len(rows.faces), seams.rim.pieces
    corner = seams.links.faces.reshape(-1)
    _, at = np.unique(corner, return_index=True)
    at = at[seams.shared[corner[at]]]

    def number(faces: NDArray[np.integer[Any]]) -> NDArray[np.int64]:
        return np.bincount(piece[faces], minlength=count).astype(np.int64)

    return replace(
        rows, vertices=rows.vertices + number(at // 3), edges=rows.edges + number(seams.starts[seams.theirs] // 3),
        borders=rows.borders + number(seams.borders // 3), loops=rows.loops + number(seams.loops()),
    )  # fmt: skip


def _added(values: NDArray[Any], numbers: NDArray[np.int64], count: int) -> NDArray[Any]:
    sums = np.zeros((count, *values.shape[1:]), values.dtype)
    np.add.at(sums, numbers, values)
    return sums


def _topology(found: list[PatchCounts], table: Tally, seams: Seams, cavities: int) -> Topology:
    vertices, edges, loops = (int(values.sum()) for values in (table.vertices, table.edges, table.loops))
    euler, components = vertices - edges + int(table.faces.sum()), len(table.faces)
    overused = int((seams.theirs & (seams.links.uses > 2)).sum())
    return Topology(
        components=components,
        euler_number=euler,
        genus=components - (euler + loops) // 2,
        boundary_edges=int(table.borders.sum()),
        nonmanifold_edges=sum(one.overused for one in found) + overused,
        nonmanifold_vertices=sum(one.fans for one in found) + seams.fan_count - vertices,
        misoriented_edges=sum(one.misoriented for one in found) + seams.misoriented,
        inward_components=abs(int(((unfolded(table.volumes) < 0) & (table.borders == 0)).sum()) - cavities),
        boundary_loops=loops,
    )
