"""Is a mesh closed, manifold, outward; how many pieces and handles has it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ..errors import InternalCheckError
from ..model.mesh import TriMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

FAULTS = ("boundary_edges", "nonmanifold_edges", "nonmanifold_vertices", "misoriented_edges", "inward_components")
"""The counts that are 0 on a closed, outward 2-manifold."""


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
        Handles, all components together; meaningful where the mesh is closed and manifold.
    boundary_edges : int
        Edges with one face.
    nonmanifold_edges : int
        Edges with three faces or more.
    nonmanifold_vertices : int
        Vertices at which several fans of faces meet.
    misoriented_edges : int
        Edges that two faces run through in the same direction.
    inward_components : int
        Components of negative volume that line no cavity.
    """

    components: int
    euler_number: int
    genus: int
    boundary_edges: int
    nonmanifold_edges: int
    nonmanifold_vertices: int
    misoriented_edges: int
    inward_components: int

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
    used = np.unique(mesh.faces)
    n = len(mesh.vertices)
    half = mesh.half_edges
    low, high = half.min(axis=1), half.max(axis=1)
    _, edge, uses = np.unique(low * n + high, return_inverse=True, return_counts=True)
    forward = np.bincount(edge, weights=half[:, 0] < half[:, 1], minlength=len(uses))
    label = face_components(mesh)
    components = int(label.max(initial=-1)) + 1
    euler = len(used) - len(uses) + len(mesh.faces)
    volumes = np.bincount(label, mesh.face_volumes, components)
    return Topology(
        components=components,
        euler_number=int(euler),
        genus=int(components - euler // 2),
        boundary_edges=int((uses == 1).sum()),
        nonmanifold_edges=int((uses > 2).sum()),
        nonmanifold_vertices=_fans(mesh, edge) - len(used),
        misoriented_edges=int(((uses == 2) & (forward != 1)).sum()),
        inward_components=abs(int((volumes < 0).sum()) - cavities),
    )


def face_components(mesh: TriMesh) -> NDArray[np.int64]:
    """Return the number of the connected piece of each face, (m,), in the order of their lowest vertex."""
    n = len(mesh.vertices)
    links = sparse.coo_array((np.ones(len(mesh.half_edges), bool), tuple(mesh.half_edges.T)), shape=(n, n))
    _, label = connected_components(links, directed=False)
    if len(mesh.faces) == 0:
        return np.empty(0, np.int64)
    return np.unique(label[mesh.faces[:, 0]], return_inverse=True)[1].astype(np.int64)


def _fans(mesh: TriMesh, edge: NDArray[np.int64]) -> int:
    """Count the fans of faces around all vertices: corners that are joined across an edge at the same vertex.

    `edge` is the number of the undirected edge under each half edge (3m,).
    """
    corner = np.arange(len(edge))
    after = corner - corner % 3 + (corner + 1) % 3
    vertex = mesh.faces.ravel()
    ends = np.stack([corner, after], axis=1)
    forward = (vertex[corner] < vertex[after])[:, None]
    ends = np.where(forward, ends, ends[:, ::-1])
    order = np.argsort(edge, kind="stable")
    same = edge[order][1:] == edge[order][:-1]
    first, second = ends[order[:-1][same]].ravel(), ends[order[1:][same]].ravel()
    links = sparse.coo_array((np.ones(len(first), bool), (first, second)), shape=(len(edge), len(edge)))
    return int(connected_components(links, directed=False)[0])


def welded(mesh: TriMesh, dtype: type[np.floating[Any]] = np.float32) -> TriMesh:
    """Join vertices whose positions are equal at a precision, as a reader of STL files does.

    Faces that lose a corner are dropped.
    """
    kept = mesh.vertices.astype(dtype)
    unique, number = np.unique(kept, axis=0, return_inverse=True)
    faces = number.reshape(-1)[mesh.faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return TriMesh(unique.astype(np.float64), faces[whole].astype(np.int64))


def check_promise(mesh: TriMesh, *, cavities: int = 0) -> None:
    """Check what is promised of every mesh that is written.

    Closed, 2-manifold, outward but for the linings of cavities, finite, and no two vertices at one position: so
    no edge has zero length, and welding equal positions changes nothing.

    Raises
    ------
    InternalCheckError
        Naming what was found.
    """
    if not np.isfinite(mesh.vertices).all():
        raise InternalCheckError("the mesh has vertices that are not finite", expected="finite coordinates")
    found = {name: count for name, count in topology(mesh, cavities=cavities).faults.items() if count}
    coincident = len(mesh.vertices) - distinct_positions(mesh, np.float64)
    found |= {"vertices at the position of another": coincident} if coincident else {}
    if found:
        raise InternalCheckError(
            "the mesh failed its own check",
            found=", ".join(f"{name} = {count}" for name, count in found.items()),
            expected="closed, manifold and outward, also after welding",
        )


def distinct_positions(mesh: TriMesh, dtype: type[np.floating[Any]]) -> int:
    """Count the positions that stay apart at a precision."""
    rounded = np.ascontiguousarray(mesh.vertices.astype(dtype) + dtype(0))
    return len(np.unique(rounded.view(np.dtype((np.void, 3 * rounded.itemsize)))))
