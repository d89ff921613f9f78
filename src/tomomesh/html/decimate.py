"""Fewer faces, for show alone: vertices in one cell of a grid become one (Rossignac & Borrel 1993)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..model.mesh import TriMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

FINER = 1.08
"""By how much more than the count of faces asks for cells grow at each trial. Chosen: half of the step takes one trial
more, twice of it leaves a sixth fewer faces than were allowed."""
PER_CELL = 2.5
"""Faces that a cell of a grid leaves of a surface, over its area in sides of the cell; trials mend it."""
TRIALS = 24
"""Most trials: cells are then more than 2^20 as large, and one holds any mesh."""


def decimated(mesh: TriMesh, most: int) -> tuple[TriMesh, NDArray[np.int64]]:
    """Return a mesh of at most so many faces, for show: it need not be closed or manifold.

    Parameters
    ----------
    mesh : TriMesh
    most : int
        Faces.

    Returns
    -------
    TriMesh
        Its vertices are the means of those that they stand for; the same mesh where it has few faces enough.
    (n,) int64 array
        The new vertex that each vertex of `mesh` became, or -1 where it is on no face that is left.
    """
    if len(mesh.faces) <= most:
        return mesh, np.arange(len(mesh.vertices))
    size = float(np.sqrt(PER_CELL * mesh.face_areas.sum() / max(most, 1)))
    size = size or float(np.ptp(mesh.vertices, axis=0).max()) or 1.0
    for _ in range(TRIALS):
        fewer, became = _clustered(mesh, size)
        if len(fewer.faces) <= most:
            break
        size *= max(FINER, FINER * float(np.sqrt(len(fewer.faces) / max(most, 1))))
    return fewer, became


def _clustered(mesh: TriMesh, size: float) -> tuple[TriMesh, NDArray[np.int64]]:
    """Join the vertices in each cell; drop the faces that lose a corner, and those that are there already."""
    cells = np.floor((mesh.vertices - mesh.vertices.min(axis=0)) / size).astype(np.int64)
    _, became = np.unique(_keys(cells), return_inverse=True)
    faces = became[mesh.faces]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    faces = _once(faces[whole])
    used = np.zeros(int(became.max()) + 1, np.bool_)
    used[faces] = True
    number = np.where(used, np.cumsum(used) - 1, -1)
    became = number[became]
    return TriMesh(means(mesh.vertices, became), number[faces]), became


def _keys(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a number for each cell (n, 3) of a grid."""
    _, rows, columns = (int(count) + 1 for count in cells.max(axis=0))
    return np.asarray((cells[:, 0] * rows + cells[:, 1]) * columns + cells[:, 2])


def _once(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Keep the first of the faces that have the same corners, however they are turned."""
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return faces[np.sort(first)]


def means(values: NDArray[np.float64], became: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the means of values (n,) or (n, c) over what became one; those of -1 are left out."""
    kept = became >= 0
    count = np.bincount(became[kept])
    columns = values.reshape(len(values), -1).T
    total = np.stack([np.bincount(became[kept], column[kept], len(count)) for column in columns], axis=1)
    return (total / np.maximum(count, 1)[:, None]).reshape(len(count), *values.shape[1:])
