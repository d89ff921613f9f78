"""Sharp edges of a surface that are long and straight enough to be kept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernels.measure.edges import join_pairs
from ..kernels.remeshing.links import CREASE, FIXED, FREE, KEPT
from ..kernels.remeshing.surface import find_sharp
from ..measure.distance import pairs_within

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

    Ints = NDArray[np.int32]
    Marks = NDArray[np.bool_]

SHARP = np.cos(np.radians(50.0))
"""Cosine of the turn between two faces from which their edge is sharp."""
STRAIGHT = np.cos(np.radians(45.0))
"""Cosine of the turn from one sharp edge to the next up to which they are one crease."""
LONG = 4.0
"""Least length of a crease, in edges: what is shorter is roughness, and even triangles matter more."""
BESIDE, PARALLEL = 0.5, 0.9
"""How near two sharp edges run beside each other, in edges, and the cosine of the angle between them, that are none:
between them, as on a corner that is cut off, no even triangle has room. Derived: half an edge is less than the height
of an even triangle, .87; the cosine is that of 26 degrees."""
ROUNDS = 2
"""Rounds in which short creases are left out: where one ends, two others may become one."""


def find_creases(
    mesh: TriMesh, twins: Ints, normals: NDArray[np.float64], edge: float
) -> tuple[Marks, NDArray[np.uint8]]:
    """Find the half edges along creases, (3 m,), and the kinds of vertices, (n,).

    Parameters
    ----------
    mesh : TriMesh
    twins : (3 m,) int32 array
        The half edge that runs the other way; -1 at a border.
    normals : (m, 3) float array
        Unit normals.
    edge : float
        What the length of a crease is compared with.
    """
    found, kinds = np.empty_like(twins), np.full(len(mesh.vertices), FREE, np.uint8)
    found = found[: find_sharp(twins, normals, SHARP, found)]
    found = found[~_doubled(mesh, *_ends(mesh, found), BESIDE * edge)]
    for _ in range(ROUNDS):
        found = found[_lengths(mesh, *_ends(mesh, found)) >= LONG * edge]
    starts, ends = _ends(mesh, found)
    creases = np.zeros(len(twins), np.bool_)
    creases[found], creases[twins[found]] = True, True
    kinds[starts] = kinds[ends] = FIXED
    kinds[_passed(mesh, starts, ends)[2]] = CREASE
    for border in _ends(mesh, np.flatnonzero(twins < 0)):
        kinds[border] = KEPT
    return creases, kinds


def _ends(mesh: TriMesh, halves: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the vertices that half edges (e,) start from and run to."""
    return mesh.faces[halves // 3, halves % 3], mesh.faces[halves // 3, (halves + 1) % 3]


def _doubled(mesh: TriMesh, starts: NDArray[np.int64], ends: NDArray[np.int64], near: float) -> Marks:
    """Tell which sharp edges (e,) have another beside them, that is nearer than `near` and runs alike."""
    ways = mesh.vertices[ends] - mesh.vertices[starts]
    ways /= np.maximum(np.sqrt((ways**2).sum(axis=1)), 1e-300)[:, None]
    middles = 0.5 * (mesh.vertices[ends] + mesh.vertices[starts])
    one, other = pairs_within(middles, near).T
    apart = middles[other] - middles[one]
    along = np.abs(np.einsum("ij,ij->i", apart, ways[one]))
    beside = along < 0.5 * np.sqrt((apart**2).sum(axis=1))
    beside &= np.abs(np.einsum("ij,ij->i", ways[one], ways[other])) > PARALLEL
    doubled = np.zeros(len(starts), np.bool_)
    doubled[one[beside]] = doubled[other[beside]] = True
    return doubled


def _lengths(mesh: TriMesh, starts: NDArray[np.int64], ends: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the length of the crease that each sharp edge (e,) belongs to."""
    one, other, _ = _passed(mesh, starts, ends)
    crease = np.arange(len(starts), dtype=np.int32)
    join_pairs(one, other, crease)
    steps = mesh.vertices[ends] - mesh.vertices[starts]
    lengths = np.sqrt((steps**2).sum(axis=1))
    return np.asarray(np.bincount(crease, lengths)[crease])


def _passed(
    mesh: TriMesh, starts: NDArray[np.int64], ends: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Find where two sharp edges, and no third, meet in a nearly straight line: both, and their vertex."""
    at, far = np.concatenate([starts, ends]), np.concatenate([ends, starts])
    order = np.argsort(at, kind="stable")
    at, far, edge = at[order], far[order], order % max(len(starts), 1)
    two = np.flatnonzero((np.bincount(at, minlength=1)[at] == 2) & (np.diff(at, append=-1) == 0))
    there, back = (mesh.vertices[far[n]] - mesh.vertices[at[n]] for n in (two, two + 1))
    size = np.sqrt((there**2).sum(axis=1) * (back**2).sum(axis=1))
    straight = two[(there * back).sum(axis=1) <= -STRAIGHT * size]
    return edge[straight], edge[straight + 1], at[straight]
