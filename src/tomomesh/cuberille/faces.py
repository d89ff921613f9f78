"""The cuberille of a closed shell: its square faces, and which surface each belongs to (the paper's Fig. 8a)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..kernels.cuberille.faces import label_quads, list_faces, scan_faces
from ..kernels.cuberille.tracker import track_faces
from ..model.cubes import cells_of, keys_of
from ..model.mesh import QuadMesh
from .bitmasks import EDGE, before
from .neighbors import DIRECTIONS, once_each

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.cubes import CubeGrid
    from .closing import Shell


def _squares() -> NDArray[np.int64]:
    """Return the corners (x, y, z) of the unit cube's faces, counter-clockwise from outside, (6, 4, 3)."""
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    faces = np.zeros((6, 4, 3), np.int64)
    for n, direction in enumerate(DIRECTIONS):
        axis = int(np.flatnonzero(direction)[0])
        faces[n, :, axis] = direction[axis] > 0
        faces[n, :, [(axis + 1) % 3, (axis + 2) % 3]] = (square if direction[axis] > 0 else square[::-1]).T
    return faces


SQUARES = _squares()
TRACKERS = {"scan": scan_faces, "faces": track_faces}
"""How faces are found."""


TIGHT = 0.45
"""Share of a surface's occupied cubes that must tell of an inside for the surface to be tight. Measured on 260 spheres,
tori and ellipsoids with holes and missing cubes, closed by 0 to 3: the share of what leaks is under .1, that of the
others over .8, or 0 where the dilation leaves no inside; between them are wholes with thin parts, which may be half."""
CRUMB = 0.05
"""Share of all faces under which a surface without an inside is debris: left out, and without a say in whether the
shell leaks. Chosen, not measured: specks come to less, a second object of a study to more."""


@dataclass(frozen=True)
class Faces:
    """The surfaces between solid cubes and the outside, made of square faces.

    Attributes
    ----------
    corners : (n, 3) int64 array
        Lattice positions (x, y, z) of the vertices.
    quads : (q, 4) int32 array
        Vertex numbers, counter-clockwise seen from outside.
    cells : (q, 3) int64 array
        Position of the cube behind each face.
    occupied, witness : (q,) bool arrays
        Whether that cube holds points, and whether it tells of an inside (see `Shell`).
    labels : (n,) int32 array
        The connected surface of each vertex.
    count : int
        Surfaces.
    inward : (count,) bool array
        Linings of cavities.
    """

    corners: NDArray[np.int64]
    quads: NDArray[np.int32]
    cells: NDArray[np.int64]
    occupied: NDArray[np.bool_]
    witness: NDArray[np.bool_]
    labels: NDArray[np.int32]
    count: int
    inward: NDArray[np.bool_]

    @cached_property
    def face_labels(self) -> NDArray[np.int32]:
        """The surface of each face, (q,)."""
        return self.labels[self.quads[:, 0]]

    @cached_property
    def sizes(self) -> NDArray[np.int64]:
        """Faces of each surface, (count,)."""
        return np.bincount(self.face_labels, minlength=self.count)

    @cached_property
    def volumes(self) -> NDArray[np.int64]:
        """Cubes inside each surface, exactly: the sum of x over its faces across x; negative for cavities."""
        x, y, z = (self.corners[:, axis][self.quads] for axis in range(3))
        area = (y[:, 2] - y[:, 0]) * (z[:, 3] - z[:, 1]) - (z[:, 2] - z[:, 0]) * (y[:, 3] - y[:, 1])
        return np.bincount(self.face_labels, x[:, 0] * (area // 2), self.count).round().astype(np.int64)

    @cached_property
    def two_sided(self) -> NDArray[np.float64]:
        """Share of each surface's occupied cubes that tell of an inside: near 1 where it is tight, 0 where not."""
        occupied = np.bincount(self.face_labels, self.occupied, self.count)
        return np.asarray(np.bincount(self.face_labels, self.witness, self.count) / np.maximum(occupied, 1))

    @property
    def handles(self) -> int:
        """Handles of all surfaces together: every edge has two faces of four sides, so V - E + F is V - F."""
        return self.count - (len(self.corners) - len(self.quads)) // 2

    @property
    def debris(self) -> NDArray[np.bool_]:
        """Which surfaces are crumbs: small, and around nothing, (count,)."""
        crumbs = (self.sizes < CRUMB * self.sizes.sum()) & (self.two_sided == 0)
        return crumbs if not crumbs.all() else np.zeros(self.count, bool)

    @property
    def least_two_sided(self) -> float:
        """The least share of occupied cubes that tell of an inside, over the surfaces that are no debris."""
        return float(self.two_sided[~self.debris].min())

    def worth_keeping(self, *, largest: bool = False) -> NDArray[np.bool_]:
        """Tell which surfaces to keep: all but debris, or the largest alone, (count,)."""
        return np.arange(self.count) == np.abs(self.volumes).argmax() if largest else ~self.debris

    def only(self, taken: NDArray[np.bool_]) -> Faces:
        """Keep some of the surfaces, (count,)."""
        if taken.all():
            return self
        faces, vertices = taken[self.face_labels], taken[self.labels]
        number = np.cumsum(vertices, dtype=np.int32) - np.int32(1)
        return Faces(
            self.corners[vertices], number[self.quads[faces]], self.cells[faces], self.occupied[faces],
            self.witness[faces], (np.cumsum(taken, dtype=np.int32) - np.int32(1))[self.labels[vertices]],
            int(taken.sum()), self.inward[taken],
        )  # fmt: skip

    def over(self, grid: CubeGrid) -> tuple[CubeGrid, QuadMesh, NDArray[np.int64]]:
        """Lay the faces over a partition of space.

        Returns
        -------
        CubeGrid
            The partition with the cubes behind the faces.
        QuadMesh
            The faces in its place and size.
        (n,) int64 array
            The cube of that partition that each vertex came from: the first of its faces' cubes.
        """
        behind = keys_of(self.cells)
        cubes = grid.with_cubes(once_each(np.concatenate([grid.keys, behind])))
        _, first = np.unique(self.quads, return_index=True)
        mesh = QuadMesh(grid.origin + self.corners * grid.cell_mm, self.quads.astype(np.int64))
        return cubes, mesh, np.searchsorted(cubes.keys, behind[first // 4])

    def turned(self) -> Faces:
        """Turn every surface inside out."""
        return replace(self, quads=np.ascontiguousarray(self.quads[:, ::-1]), inward=~self.inward)

    def joined(self, other: Faces) -> Faces:
        """Append the surfaces of another set."""
        quads = np.concatenate([self.quads, other.quads + np.int32(len(self.corners))])
        labels = np.concatenate([self.labels, other.labels + np.int32(self.count)])
        rows = [
            np.concatenate([getattr(self, name), getattr(other, name)])
            for name in ("corners", "cells", "occupied", "witness", "inward")
        ]
        return Faces(rows[0], quads, rows[1], rows[2], rows[3], labels, self.count + other.count, rows[4])


def exposed_faces(shell: Shell, *, tracking: str = "scan") -> Faces:
    """List the faces of the solid that the outside sees (the paper's Fig. 8a).

    Parameters
    ----------
    shell : Shell
    tracking : str
        ``"scan"`` looks at all cubes; ``"faces"`` follows each surface from one face to the next (Gordon and Udupa
        1989; `tomomesh.kernels.cuberille.tracker`). Both find the same faces.

    Returns
    -------
    Faces
        Closed and outward: a 2-manifold, as the solid is well composed. Vertices and faces stand in the order of
        their blocks.
    """
    blocks = shell.blocks
    exposed, corners = np.zeros((6, *blocks.empty().shape), np.uint64), blocks.empty()
    TRACKERS[tracking](shell.solid, blocks.table, exposed, corners)
    quads = np.empty((int(np.bitwise_count(exposed).sum()), 4), np.int32)
    places = np.empty((len(quads), 2), np.int32)
    list_faces(exposed, blocks.table, corners, before(blocks.count(corners)), SQUARES, quads, places)
    block, word, bit = places[:, 0], places[:, 1] // 64, (places[:, 1] % 64).astype(np.uint64)
    cells = EDGE * cells_of(blocks.keys)[block]
    cells += np.stack([places[:, 1] % EDGE, places[:, 1] // EDGE % EDGE, word], axis=1)
    occupied, witness = (
        (bitmask[block, word] >> bit & np.uint64(1)) > 0 for bitmask in (shell.occupied, shell.witnesses)
    )
    lattice = blocks.cells(corners)
    labels = np.empty(len(lattice), np.int32)
    count = label_quads(quads, labels)
    return Faces(lattice, quads, cells, occupied, witness, labels, count, np.zeros(count, bool))
