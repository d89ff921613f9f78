"""Voxels inside a closed mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("void(f8[:,::1], i8[:,::1], i2[:,:,::1])")
def add_winding_steps(vertices: NDArray[np.float64], faces: NDArray[np.int64], steps: NDArray[np.int16]) -> None:
    """Add to every voxel the faces that lie between it and the voxel below: 1 on the way in, -1 on the way out.

    The running sum along k is then the winding number at each center.

    Parameters
    ----------
    vertices : (n, 3) float array
        Positions in voxel indices (i, j, k).
    faces : (m, 3) int array
        Each side runs as often one way as the other.
    steps : (K, J, I) int16 array
        Result, added to.

    Notes
    -----
    A ray runs along k through every (i, j). A side of a face is crossed by the line of row j where one end lies at or
    before the row and the other one behind it, at a place that is always counted from the end of lower number: so the
    faces on its two sides agree on which rays pass on which side of it, whatever is rounded, and as many faces lead
    into the mesh as out of it. Centers on the mesh are inside where it begins, and outside where it ends.
    """
    last_k, last_j, last_i = steps.shape
    places = np.empty(2)
    heights = np.empty(2)
    for face in range(len(faces)):
        a, b, c = vertices[faces[face, 0], 1], vertices[faces[face, 1], 1], vertices[faces[face, 2], 1]
        first_row = int(min(max(np.ceil(min(a, b, c)), 0.0), float(last_j)))
        stop_row = int(min(max(np.ceil(max(a, b, c)), 0.0), float(last_j)))
        for j in range(first_row, stop_row):
            for n in range(3):
                start, end = faces[face, n], faces[face, (n + 1) % 3]
                if (vertices[start, 1] <= j) == (vertices[end, 1] <= j):
                    continue
                way = 1 if vertices[start, 1] <= j else 0
                low, high = min(start, end), max(start, end)
                share = (j - vertices[low, 1]) / (vertices[high, 1] - vertices[low, 1])
                places[way] = vertices[low, 0] + share * (vertices[high, 0] - vertices[low, 0])
                heights[way] = vertices[low, 2] + share * (vertices[high, 2] - vertices[low, 2])
            step = 1 if places[1] < places[0] else -1
            first = int(min(max(np.ceil(places.min()), 0.0), float(last_i)))
            stop = int(min(max(np.ceil(places.max()), 0.0), float(last_i)))
            for i in range(first, stop):
                share = (i - places[0]) / (places[1] - places[0])
                height = np.ceil(heights[0] + share * (heights[1] - heights[0]))
                if height < last_k:
                    steps[int(max(height, 0.0)), j, i] += step
