"""Is a mesh closed, manifold, outward; how many pieces and handles has it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InternalCheckError
from ..kernels.measure.positions import first_equal
from ..model.columns import any_of
from ..model.mesh import TriMesh
from .links import Links
from .shape import MeshExtent, areas_and_volumes, unfolded

if TYPE_CHECKING:
    from numpy.typing import NDArray

FAULTS = ("boundary_edges", "nonmanifold_edges", "nonmanifold_vertices", "misoriented_edges", "inward_components")
"""The counts that are 0 on a closed, outward 2-manifold."""
STIR = np.uint64(0x9E3779B97F4A7C15)
"""2^64 over the golden ratio (Knuth 1973, vol. 3, 6.4)."""


@dataclass(frozen=True)
class Topology:
    """What can be counted on a mesh.

    Attributes
    ----------
    components : int
        Pieces that are connected over vertices.
    euler_number : int
        Vertices - edges + faces; vertices that no face uses do not count.
    genus : int
        Handles, all components together; meaningful where the mesh is manifold.
    boundary_edges : int
        Edges with one face.
    nonmanifold_edges : int
        Edges with three faces or more.
    nonmanifold_vertices : int
        Vertices at which several fans of faces meet.
    misoriented_edges : int
        Edges that two faces run through in the same direction.
    inward_components : int
        Components without a border, of negative volume, that line no cavity.
    boundary_loops : int
        Closed lines that the edges with one face form.
    """

    components: int
    euler_number: int
    genus: int
    boundary_edges: int
    nonmanifold_edges: int
    nonmanifold_vertices: int
    misoriented_edges: int
    inward_components: int
    boundary_loops: int

    @property
    def faults(self) -> dict[str, int]:
        """Return the counts that are 0 on a closed, outward 2-manifold."""
        return {name: getattr(self, name) for name in FAULTS}

    @property
    def sound(self) -> bool:
        """Whether the mesh is a closed, outward 2-manifold."""
        return not any(self.faults.values())


def topology(mesh: TriMesh, *, cavities: int = 0) -> Topology:
    """Count what makes a mesh closed, manifold and outward.

    Parameters
    ----------
    mesh : TriMesh
        Every face has three different vertices.
    cavities : int
        Components that are known to line a cavity, and so must face inward.

    Returns
    -------
    Topology
    """
    links = Links(mesh)
    return topology_of(links, areas_and_volumes(links)[1], cavities=cavities)


def topology_of(links: Links, volumes: NDArray[np.float64], *, cavities: int = 0) -> Topology:
    """Count what `topology` counts, from the adjacency of a mesh and the volumes (m,) under its faces."""
    vertices, (fans, loops) = int(links.used.sum()), links.fans_and_loops
    euler = vertices - len(links.uses) + len(links.faces)
    inward = unfolded(MeshExtent.of(links).volumes(volumes, links.face_pieces, links.pieces)) < 0
    inward[links.face_pieces[links.borders // 3]] = False
    return Topology(
        components=links.pieces,
        euler_number=euler,
        genus=links.pieces - (euler + len(loops)) // 2,
        boundary_edges=len(links.borders),
        nonmanifold_edges=int((links.uses > 2).sum()),
        nonmanifold_vertices=fans - vertices,
        misoriented_edges=links.misoriented,
        inward_components=abs(int(inward.sum()) - cavities),
        boundary_loops=len(loops),
    )


def face_components(mesh: TriMesh) -> NDArray[np.int64]:
    """Return the number of the connected piece of each face, (m,), in the order of their lowest vertex."""
    return Links(mesh).face_pieces.astype(np.int64)


def welded(mesh: TriMesh, dtype: type[np.floating[Any]] = np.float32) -> TriMesh:
    """Join vertices whose positions are equal at a precision, as a reader of STL files does.

    Faces that lose a corner are dropped.
    """
    rounded = np.array(mesh.vertices.astype(dtype, copy=False), np.float64, order="C")
    first = first_equals(rounded)
    kept = first == np.arange(len(first))
    faces = (np.cumsum(kept) - 1)[first][mesh.faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return TriMesh(rounded[kept], faces[whole])


def check_promise(mesh: TriMesh, *, cavities: int = 0, open_: bool = False) -> None:
    """Check what is promised of every mesh that is written.

    Closed, 2-manifold, outward but for the linings of cavities, finite, and no two vertices at one position: so
    no edge has zero length, and welding equal positions changes nothing.

    Parameters
    ----------
    mesh : TriMesh
    cavities : int
        Components that are known to line a cavity, and so must face inward.
    open_ : bool
        Let the mesh have borders: then it is a consistently oriented 2-manifold with boundary.

    Raises
    ------
    InternalCheckError
        Naming what was found.
    """
    require_finite(finite=bool(np.isfinite(mesh.vertices).all()))
    coincident = len(mesh.vertices) - distinct_positions(mesh, np.float64)
    require_promise(topology(mesh, cavities=cavities), coincident, open_=open_)


def require_finite(*, finite: bool) -> None:
    """Refuse a mesh whose vertices are not all finite."""
    if not finite:
        raise InternalCheckError("the mesh has vertices that are not finite", expected="finite coordinates")


def require_promise(counts: Topology, coincident: int, *, open_: bool = False) -> None:
    """Refuse what was counted on a mesh that does not hold its promise, see `check_promise`.

    Parameters
    ----------
    counts : Topology
    coincident : int
        Vertices at the position of another.
    open_ : bool
    """
    found = {name: count for name, count in counts.faults.items() if count}
    if open_:
        found.pop("boundary_edges", None)
    found |= {"vertices at the position of another": coincident} if coincident else {}
    if found:
        raise InternalCheckError(
            "the mesh failed its own check",
            found=", ".join(f"{name} = {count}" for name, count in found.items()),
            expected=f"{'' if open_ else 'closed, '}manifold and outward, also after welding",
        )


def distinct_positions(mesh: TriMesh, dtype: type[np.floating[Any]]) -> int:
    """Count the positions that stay apart at a precision."""
    return count_positions(np.array(mesh.vertices.astype(dtype, copy=False), np.float64, order="C"))


def count_positions(positions: NDArray[np.float64]) -> int:
    """Count positions (n, 3), equal ones once; each -0 becomes 0, in place."""
    first = first_equals(positions)
    return int((first == np.arange(len(first))).sum())


def with_equal_corners(vertices: NDArray[np.float64], faces: NDArray[np.integer[Any]]) -> NDArray[np.bool_]:
    """Mark the faces (m, 3) with a corner at the position of another vertex, (m,)."""
    first = first_equals(np.array(vertices, order="C"))
    many = np.bincount(first, minlength=len(first)) > 1
    return any_of(many[first][faces]) if many.any() else np.zeros(len(faces), np.bool_)


def first_equals(positions: NDArray[np.float64]) -> NDArray[np.int32]:
    """Return the number of the first position that equals each of them.

    Parameters
    ----------
    positions : (n, 3) float array
        Row after row in memory. Each -0 becomes 0, which is the same position, in place.

    Returns
    -------
    (n,) int32 array
    """
    positions += 0.0
    rows = positions.view(np.int64)
    bits = len(rows).bit_length() + 1
    first = np.empty(len(rows), np.int32)
    first_equal(rows, _stirred(rows.view(np.uint64), bits), np.full(1 << bits, -1, np.int32), first)
    return first


def _stirred(rows: NDArray[np.uint64], bits: int) -> NDArray[np.int64]:
    """Make one number of so many bits out of each row, (n,): products stir their high bits, shifts bring them down."""
    place = np.zeros(len(rows), np.uint64)
    for column in rows.T:
        place = (place ^ column) * STIR
        place ^= place >> np.uint64(32)
    return (place * STIR >> np.uint64(64 - bits)).astype(np.int64)
