"""A mesh in the making: arrays with room for more, and the steps that change them."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernels.remeshing.collapses import collapse_edges
from ..kernels.remeshing.flips import flip_edges
from ..kernels.remeshing.ground import find_goals
from ..kernels.remeshing.lengths import TOO_LONG, TOO_SHORT, mark_lengths
from ..kernels.remeshing.links import KEPT
from ..kernels.remeshing.moves import lift_vertices, move_vertices
from ..kernels.remeshing.splits import split_edges
from ..kernels.remeshing.surface import normals_of
from ..kernels.threads import in_blocks
from ..measure.intersections import marked_in
from ..measure.topology import with_equal_corners
from ..measure.tree import Tree
from ..model.columns import any_of, mean_over
from ..model.mesh import TriMesh

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from .ground import Ground

BLOCK = 30_000
"""Half edges, or vertices, worked on in one call: some tens of milliseconds. No result depends on it."""
SPLITS = 12
"""Most passes over all edges in which they are split before vertices move. An edge waits for the longer sides of its
faces."""
RINGS = 2
"""Rings of faces around those that pass through others that change with them."""
LIFTS = 2
"""Rounds in which vertices leave the surface before, so that faces do not all lie inside of it where it bends."""
ROOM = 3
"""New vertices that room is made for, for each edge that is too long: the halves of one may be too long again."""


class Making:
    """A mesh in the making over the surface before. See `tomomesh.kernels.remeshing.links` for the arrays."""

    def __init__(
        self, ground: Ground, kept: NDArray[np.bool_], threads: int, some: NDArray[np.bool_] | None = None
    ) -> None:
        """Begin with the surface itself, of which some vertices (n,) are kept with the edges between them.

        Where only `some` of its faces (m,) are to be made even, whole pieces, the mesh consists of them alone.
        """
        self._ground, self._threads = ground, threads
        self.corners, self.twins = ground.faces.reshape(-1).copy(), ground.twins.copy()
        self.places, self.valence = ground.mesh.vertices.copy(), ground.valence.copy()
        self.kinds = np.where(kept, np.uint8(KEPT), ground.kinds)
        self.sharp, self.sizes = ground.creases.copy(), ground.sizes.copy()
        self.outs = np.full(len(self.places), -1, np.int32)
        self.outs[self.corners] = np.arange(len(self.corners))
        self.under = self.outs // 3
        if some is not None:
            gone = np.repeat(~some, 3)
            self.outs[self.corners[gone]], self.corners[gone] = -1, -1
        along = np.flatnonzero(ground.creases)
        self.under[ground.faces.reshape(-1)[along]] = along // 3
        self.ups = np.empty_like(self.places)
        in_blocks(
            lambda start, stop: normals_of(ground.mesh.vertices, ground.faces, self.under, self.ups, start, stop),
            len(self.ups), block=BLOCK, threads=threads,
        )  # fmt: skip
        self._begun = self.places
        self.counts = np.array([len(self.places), len(self.corners) // 3])

    @property
    def vertices(self) -> int:
        """Number of vertices."""
        return int((self.outs[: self.counts[0]] >= 0).sum())

    @property
    def faces(self) -> NDArray[np.int32]:
        """Corners of the faces, (m, 3)."""
        rows = self.corners.reshape(-1, 3)[: self.counts[1]]
        return rows[rows[:, 0] >= 0]

    def mesh(self) -> tuple[TriMesh, NDArray[np.int32]]:
        """Return the mesh, and the face of the surface before under each of its vertices."""
        used, faces = self._numbered()
        return TriMesh(self.places[used], faces.astype(np.int64)), self.under[used]

    def crossing(self) -> NDArray[np.bool_]:
        """Mark the faces (m,) that meet others; before there is a mesh, whose numbers have twice the bits."""
        used, faces = self._numbered()
        places = self.places[used]
        crosses = marked_in(Tree.over(places, faces, threads=self._threads), threads=self._threads)
        return crosses | with_equal_corners(places, faces)

    def _numbered(self) -> tuple[NDArray[np.bool_], NDArray[np.int32]]:
        """Tell which vertices (n,) are used, and return the faces (m, 3) by their numbers among these."""
        faces = self.faces
        used = np.zeros(len(self.outs), np.bool_)
        used[faces.reshape(-1)] = True
        number = np.cumsum(used, dtype=np.int32) - np.int32(1)
        return used, np.take(number, faces)

    def rescaled(self, ground: Ground) -> None:
        """Go on with other lengths of edges."""
        self._ground = ground
        self.sizes = mean_over(ground.sizes, ground.faces[np.maximum(self.under, 0)])

    @contextmanager
    def only_around(self, some: NDArray[np.bool_], share: float) -> Iterator[Callable[[], NDArray[np.bool_]]]:
        """Want other edges at some faces (m,), by a share, and let nothing change but there and a few rings around.

        What is yielded tells, after that, which faces have changed.
        """
        near = self._corners_of(some)
        near[self.faces[any_of(near[self.faces])]] = True
        self.sizes[near] *= share
        self._ground = self._ground.scaled_at(self.under[near], share)
        for _ in range(RINGS):
            near[self.faces[any_of(near[self.faces])]] = True
        kinds = self.kinds
        self.kinds = np.where(near, kinds, np.uint8(KEPT))
        yield lambda: any_of(np.concatenate([near, np.ones(len(self.outs) - len(near), np.bool_)])[self.faces])
        self.kinds[: len(kinds)][~near] = kinds[~near]

    def _corners_of(self, some: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Mark the corners (n,) of some faces (m,)."""
        corners = np.zeros(len(self.outs), np.bool_)
        corners[self.faces[some]] = True
        return corners

    def marks(self) -> NDArray[np.uint8]:
        """Mark edges that are too long or too short, at the first of their half edges, (3 m,)."""
        marks = np.zeros(len(self.corners), np.uint8)

        def work(start: int, stop: int) -> None:
            mark_lengths(self.places, self.corners, self.twins, self.kinds, self.sizes, marks, start, stop)

        in_blocks(work, 3 * int(self.counts[1]), block=BLOCK, threads=self._threads)
        return marks

    def split(self, marks: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Split edges that are too long; return the marks of all edges then."""
        for _ in range(SPLITS):
            long = np.flatnonzero(marks == TOO_LONG)
            if not len(long):
                break
            self._make_room(len(long))
            marks = _longer(marks, len(self.corners))
            self._split(marks, long)
        return marks

    def _split(self, marks: NDArray[np.uint8], long: NDArray[np.int64]) -> None:
        def work(start: int, stop: int) -> None:
            split_edges(
                self.places, self.corners, self.twins, self.outs, self.valence, self.kinds, self.sharp, self.sizes,
                self.under, self.ups, self.counts, marks, long, start, stop,
            )  # fmt: skip

        in_blocks(work, len(long), block=BLOCK, threads=1)

    def collapse(self, marks: NDArray[np.uint8]) -> int:
        """Collapse edges that are too short; return how many."""
        short, stamps, made = np.flatnonzero(marks == TOO_SHORT), np.full(len(self.outs), -1, np.int32), 0

        def work(start: int, stop: int) -> None:
            nonlocal made
            made += collapse_edges(
                self.places, self.corners, self.twins, self.outs, self.valence, self.kinds, self.sharp, self.sizes,
                self.ups, stamps, short, start, stop,
            )  # fmt: skip

        in_blocks(work, len(short), block=BLOCK, threads=1)
        return made

    def flip(self) -> None:
        """Flip edges where that makes angles larger."""

        def work(start: int, stop: int) -> None:
            flip_edges(
                self.places, self.corners, self.twins, self.outs, self.valence, self.kinds, self.sharp, self.sizes,
                self.ups, start, stop,
            )  # fmt: skip

        self._over_edges(work)

    def move(self) -> None:
        """Move vertices evenly among their neighbors, along the surface before."""
        ground = self._ground

        def work(start: int, stop: int) -> None:
            move_vertices(
                self.places, self.corners, self.twins, self.outs, self.kinds, self.sharp, self.sizes, self.under,
                self.ups, ground.mesh.vertices, ground.faces, ground.creases.reshape(-1, 3), ground.twins, ground.fans,
                ground.first, ground.sizes, start, stop,
            )  # fmt: skip

        self._over_vertices(work)

    def lift(self) -> None:
        """Move vertices off the surface before, so that each face lies on both its sides."""
        goals, ground = np.zeros((len(self.corners) // 3, 3)), self._ground

        def find(start: int, stop: int) -> None:
            find_goals(
                ground.mesh.vertices, ground.faces, ground.twins, ground.fans, ground.first, self.places,
                self.corners, self.under, goals, start, stop,
            )  # fmt: skip

        def work(start: int, stop: int) -> None:
            lift_vertices(self.places, self.corners, self.twins, self.outs, self.kinds, self.ups, goals, start, stop)

        self._begun = self.places.copy()
        in_blocks(find, int(self.counts[1]), block=BLOCK, threads=self._threads)
        for _ in range(LIFTS):
            self._over_vertices(work)

    def lower(self, some: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Put the corners of some faces (m,) back where they were lifted from; return which faces have changed."""
        near = self._corners_of(some)
        self.places[near] = self._begun[near]
        return any_of(near[self.faces])

    def _over_vertices(self, work: Callable[[int, int], None]) -> None:
        in_blocks(work, int(self.counts[0]), block=BLOCK, threads=1)

    def _over_edges(self, work: Callable[[int, int], None]) -> None:
        """Go over all half edges in their order: each change rests on those before."""
        in_blocks(work, 3 * int(self.counts[1]), block=BLOCK, threads=1)

    def _make_room(self, vertices: int) -> None:
        """Have room for so many vertices more, and two faces for each."""
        n, m = int(self.counts[0]) + vertices, 3 * (int(self.counts[1]) + 2 * vertices)
        if n <= len(self.outs) and m <= len(self.corners):
            return
        n, m = n + (ROOM - 1) * vertices, m + 6 * (ROOM - 1) * vertices
        for name in ("places", "outs", "valence", "kinds", "sizes", "under", "ups"):
            setattr(self, name, _longer(getattr(self, name), n))
        for name in ("corners", "twins", "sharp"):
            setattr(self, name, _longer(getattr(self, name), m))


def _longer(rows: NDArray[Any], count: int) -> NDArray[Any]:
    """Return an array with as many rows at least."""
    if len(rows) >= count:
        return rows
    longer = np.zeros((count, *rows.shape[1:]), rows.dtype)
    longer[: len(rows)] = rows
    return longer
