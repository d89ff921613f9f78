"""An icosahedron whose faces are divided into smaller triangles and blown up to a sphere."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

GOLDEN = (1 + 5**0.5) / 2
"""The golden ratio: the corners of three rectangles of these sides are those of an icosahedron."""


def icosphere(frequency: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Divide each edge of an icosahedron into `frequency` pieces.

    Returns
    -------
    vertices : (10 f^2 + 2, 3) float array
        On the unit sphere.
    faces : (20 f^2, 3) int array
        Counterclockwise from outside.
    """
    corners, triangles = _icosahedron()
    steps = np.array([(i, j, frequency - i - j) for i in range(frequency + 1) for j in range(frequency + 1 - i)])
    weights = np.zeros((len(triangles), len(steps), len(corners)), np.int64)
    for triangle, weight in zip(triangles, weights, strict=True):
        weight[:, triangle] = steps
    # a vertex is its integer weights of the twelve corners, so that what two faces share is found exactly
    keys, numbers = np.unique(weights.reshape(-1, len(corners)), axis=0, return_inverse=True)
    places = keys @ corners
    # NumPy lays what it picks by columns as it likes: of one piece a triangle, column by column
    faces = np.ascontiguousarray(numbers.reshape(len(triangles), -1)[:, _pieces(frequency)].reshape(-1, 3))
    return places / np.sqrt((places**2).sum(axis=1, keepdims=True)), faces


def _icosahedron() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return 12 corners at distance 2 of each other and the 20 triangles between them, seen from outside."""
    flat = [np.roll((0.0, a, b * GOLDEN), turn) for turn in range(3) for a, b in product((-1, 1), (-1, 1))]
    corners = np.array(flat)
    near = np.abs(((corners[:, None] - corners) ** 2).sum(axis=2) - 4) < 1e-9
    found = [
        (a, b, c) for a in range(12) for b in range(a) for c in range(b) if near[a, b] and near[b, c] and near[a, c]
    ]
    turns = [np.linalg.det(corners[list(abc)]) > 0 for abc in found]
    return corners, np.array([abc if turn else abc[::-1] for abc, turn in zip(found, turns, strict=True)])


def _pieces(frequency: int) -> NDArray[np.int64]:
    """Return the small triangles of a divided triangle, as places in the order of its vertices, (f^2, 3)."""
    rows = [np.arange(frequency + 1 - i) for i in range(frequency + 1)]
    first = np.cumsum([0, *map(len, rows)])
    upright = [(first[i] + j, first[i + 1] + j, first[i] + j + 1) for i in range(frequency) for j in rows[i][:-1]]
    hanging = [
        (first[i] + j + 1, first[i + 1] + j, first[i + 1] + j + 1) for i in range(frequency) for j in rows[i][:-2]
    ]
    return np.array(upright + hanging)
