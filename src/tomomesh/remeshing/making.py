"""A mesh in the making: arrays with room for more, and the steps that change them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernels.remeshing.collapses import collapse_edges
from ..kernels.remeshing.flips import flip_edges
from ..kernels.remeshing.ground import find_sags, project
from ..kernels.remeshing.links import KEPT
from ..kernels.remeshing.moves import accept, lift, relax
from ..kernels.remeshing.splits import mark_long, split_edges
from ..kernels.threads import in_blocks
from ..model.mesh import TriMesh

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from .ground import Ground

BLOCK = 30_000
"""Half edges, or vertices, worked on in one call: some tens of milliseconds. No result depends on it."""
SPLITS, COLLAPSES = 12, 3
"""Most passes over all edges in which they are split, or collapsed, before vertices move. An edge waits for the longer
sides of its faces."""
FEW = 0.01
"""Share of the vertices: a pass that collapses fewer edges is the last for now."""
LIFTS = 3
"""Rounds in which vertices leave the surface before, so that faces do not all lie inside of it where it bends."""
ROOM = 3
"""New vertices that room is made for, for each edge that is too long: the halves of one may be too long again."""


class Making:
    """A mesh in the making over the surface before. See `tomomesh.kernels.remeshing.links` for the arrays."""

    def __init__(self, ground: Ground, kept: NDArray[np.bool_], threads: int) -> None:
        """Begin with the surface itself, of which some vertices (n,) are kept with the edges between them."""
        self._ground, self._threads = ground, threads
        self.corners, self.twins = ground.faces.reshape(-1).copy(), ground.twins.copy()
        self.places, self.valence = ground.mesh.vertices.copy(), ground.valence.copy()
        self.kinds = np.where(kept, np.uint8(KEPT), ground.kinds)
        self.sharp, self.sizes = ground.creases.copy(), ground.sizes.copy()
        self.outs = np.full(len(self.places), -1, np.int32)
        self.outs[self.corners] = np.arange(len(self.corners))
        self.under = self.outs // 3
        along = np.flatnonzero(ground.creases)
        self.under[self.corners[along]] = along // 3
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
        faces = self.faces
        used = np.zeros(len(self.outs), np.bool_)
        used[faces.reshape(-1)] = True
        number = np.cumsum(used) - 1
        return TriMesh(self.places[used], number[faces]), self.under[used]

    def rescaled(self, ground: Ground) -> None:
        """Go on with other lengths of edges."""
        self._ground = ground
        under = np.maximum(self.under, 0)
        self.sizes = ground.sizes[ground.faces[under]].mean(axis=1)

    def split(self) -> int:
        """Split edges that are too long; return how many."""
        begun = int(self.counts[0])
        marks: NDArray[np.bool_] = np.zeros(len(self.corners), np.bool_)

        def mark(start: int, stop: int) -> None:
            mark_long(self.places, self.corners, self.twins, self.kinds, self.sizes, marks, start, stop)

        in_blocks(mark, 3 * int(self.counts[1]), block=BLOCK, threads=self._threads)
        for _ in range(SPLITS):
            long = np.flatnonzero(marks)
            if not len(long):
                break
            self._make_room(len(long))
            marks = _longer(marks, len(self.corners))
            self._split(marks, long)
        return int(self.counts[0]) - begun

    def _split(self, marks: NDArray[np.bool_], long: NDArray[np.int64]) -> None:
        def work(start: int, stop: int) -> None:
            split_edges(
                self.places, self.corners, self.twins, self.outs, self.valence, self.kinds, self.sharp, self.sizes,
                self.under, self.counts, marks, long, start, stop,
            )  # fmt: skip

        in_blocks(work, len(long), block=BLOCK, threads=1)

    def collapse(self) -> int:
        """Collapse edges that are too short; return how many."""
        stamps, total = np.full(len(self.outs), -1, np.int32), 0
        for _ in range(COLLAPSES):
            made = 0

            def work(start: int, stop: int) -> None:
                nonlocal made
                made += collapse_edges(
                    self.places, self.corners, self.twins, self.outs, self.valence, self.kinds, self.sharp,
                    self.sizes, self.under, self._ground.normals, stamps, start, stop,
                )  # fmt: skip

            self._over_edges(work)
            total += made
            if made < FEW * self.counts[0]:
                break
        return total

    def flip(self) -> None:
        """Flip edges where that makes angles larger."""

        def work(start: int, stop: int) -> None:
            flip_edges(
                self.places, self.corners, self.twins, self.outs, self.valence, self.kinds, self.sharp, self.sizes,
                self.under, self._ground.normals, start, stop,
            )  # fmt: skip

        self._over_edges(work)

    def move(self) -> None:
        """Move vertices evenly among their neighbors, along the surface before."""
        moved, ground = np.empty_like(self.places), self._ground

        def work(start: int, stop: int) -> None:
            relax(
                self.places, self.corners, self.twins, self.outs, self.kinds, self.sharp, self.sizes, moved, start, stop
            )

        def lay(start: int, stop: int) -> None:
            project(
                ground.mesh.vertices, ground.faces, ground.creases.reshape(-1, 3), ground.twins, ground.fans,
                ground.first, ground.sizes, self.outs, self.kinds, moved, self.under, self.sizes, start, stop,
            )  # fmt: skip

        self._over_vertices(work)
        self._over_vertices(lay)
        self._take(moved)

    def lift(self) -> None:
        """Move vertices off the surface before, so that each face lies on both its sides."""
        begun, below = self.places.copy(), self.under[self.corners[::3]]
        for _ in range(LIFTS):
            self._lift(begun, below)

    def _lift(self, begun: NDArray[np.float64], below: NDArray[np.int32]) -> None:
        moved, ground, sags = np.empty_like(self.places), self._ground, np.zeros(len(self.corners) // 3)

        def find(start: int, stop: int) -> None:
            find_sags(
                ground.mesh.vertices, ground.faces, ground.twins, ground.fans, ground.first, begun, self.places,
                self.corners, self.kinds, below, sags, start, stop,
            )  # fmt: skip

        def work(start: int, stop: int) -> None:
            lift(self.places, self.corners, self.twins, self.outs, self.kinds, sags, moved, start, stop)

        in_blocks(find, int(self.counts[1]), block=BLOCK, threads=self._threads)
        self._over_vertices(work)
        self._take(moved)

    def _take(self, moved: NDArray[np.float64]) -> None:
        """Move vertices where no face turns over, one after the other."""

        def take(start: int, stop: int) -> None:
            accept(
                self.places, self.corners, self.twins, self.outs, self.kinds, self._ground.normals, self.under, moved,
                start, stop,
            )  # fmt: skip

        in_blocks(take, int(self.counts[0]), block=BLOCK, threads=1)

    def _over_vertices(self, work: Callable[[int, int], None]) -> None:
        in_blocks(work, int(self.counts[0]), block=BLOCK, threads=self._threads)

    def _over_edges(self, work: Callable[[int, int], None]) -> None:
        """Go over all half edges in their order: each change rests on those before."""
        in_blocks(work, 3 * int(self.counts[1]), block=BLOCK, threads=1)

    def _make_room(self, vertices: int) -> None:
        """Have room for so many vertices more, and two faces for each."""
        n, m = int(self.counts[0]) + vertices, 3 * (int(self.counts[1]) + 2 * vertices)
        if n <= len(self.outs) and m <= len(self.corners):
            return
        n, m = n + (ROOM - 1) * vertices, m + 6 * (ROOM - 1) * vertices
        for name in ("places", "outs", "valence", "kinds", "sizes", "under"):
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
