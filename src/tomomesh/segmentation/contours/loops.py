"""Every closed outline of a window in a slice, holes included, as a chain of pixel sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

STEPS = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])
"""Directions of a side (column, row): along the top, right, bottom and left of its pixel."""
CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
"""Where each of these sides starts, from the pixel's upper left corner."""
BESIDE = np.array([(0, -1), (1, 0), (0, 1), (-1, 0)])
"""The pixel across each of these sides (column, row)."""


@dataclass(frozen=True)
class Loop:
    """A closed chain of sides between pixels inside and outside of a window.

    Attributes
    ----------
    corners : (p, 2) int64 array
        Where each side starts (column, row), counted from the upper left corner of pixel (0, 0), the window on the
        left of the way (column, row).
    """

    corners: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.corners)

    @property
    def area(self) -> int:
        """Pixels enclosed, exactly; negative for a hole."""
        (x, y), (u, v) = self.corners.T, np.roll(self.corners, -1, axis=0).T
        return int((x * v - u * y).sum()) // 2

    @property
    def middles(self) -> NDArray[np.float64]:
        """Middles of the sides, which are those of the pixels inside and outside, (p, 2) pixel columns and rows."""
        return (self.corners + np.roll(self.corners, -1, axis=0)) / 2 - 0.5

    @property
    def pixels(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Pixels (column, row) inside and outside of each side, (p, 2) twice."""
        step = np.roll(self.corners, -1, axis=0) - self.corners
        way = (step[:, None] == STEPS).all(axis=2).argmax(axis=1)
        inner = self.corners - CORNERS[way]
        return inner, inner + BESIDE[way]

    def filled(self) -> Patch:
        """Return the pixels that the loop encloses."""
        low, high = self.corners.min(axis=0), self.corners.max(axis=0)
        (x, y), (_, v) = (self.corners - low).T, (np.roll(self.corners, -1, axis=0) - low).T
        columns, rows = (high - low).tolist()
        upright = y != v
        at = np.minimum(y, v)[upright] * (columns + 1) + x[upright]
        toggles = np.bincount(at, minlength=rows * (columns + 1)).reshape(rows, columns + 1)
        return Patch(low, np.cumsum(toggles, axis=1)[:, :-1] % 2 == 1)


@dataclass(frozen=True)
class Patch:
    """Pixels of a slice: a mask whose first pixel (column, row) is `low`."""

    low: NDArray[np.int64]
    pixels: NDArray[np.bool_]

    @property
    def area(self) -> int:
        """Number of pixels."""
        return int(np.count_nonzero(self.pixels))

    def shared(self, other: Patch) -> int:
        """Count the pixels that are in both."""
        low = np.maximum(self.low, other.low)
        high = np.minimum(self.low + self.pixels.shape[::-1], other.low + other.pixels.shape[::-1])
        if (low >= high).any():
            return 0
        one, two = (
            patch.pixels[low[1] - patch.low[1] : high[1] - patch.low[1], low[0] - patch.low[0] : high[0] - patch.low[0]]
            for patch in (self, other)
        )
        return int(np.count_nonzero(one & two))


def trace(plane: NDArray[np.bool_]) -> list[Loop]:
    """Follow all borders of a window.

    Pixels that touch at a corner are joined, so that a thin slanted wall is one; the outside passes no such corner.

    Parameters
    ----------
    plane : (J, I) bool array

    Returns
    -------
    list of Loop
        Outer borders and those of holes; their areas add up to the number of pixels.
    """
    padded = np.pad(plane, 1)
    row, column = np.nonzero(padded)
    sides = [(column, row, way) for way in range(4)]
    bare = [~padded[y + BESIDE[way, 1], x + BESIDE[way, 0]] for x, y, way in sides]
    start = np.concatenate(
        [np.stack([x, y], axis=1)[b] + CORNERS[way] for (x, y, way), b in zip(sides, bare, strict=True)]
    )
    ways = np.repeat(np.arange(4), [np.count_nonzero(b) for b in bare])
    onward = _following(start, ways, padded.shape[1] + 1).tolist()
    unseen, loops = [True] * len(onward), []
    for first in np.lexsort((start[:, 0], start[:, 1])).tolist():
        chain, side = [], first
        while unseen[side]:
            unseen[side] = False
            chain.append(side)
            side = onward[side]
        if chain:
            loops.append(Loop(start[chain] - 1))
    return loops


def _following(start: NDArray[np.int64], ways: NDArray[np.int64], width: int) -> NDArray[np.int64]:
    """Return the side that follows each: where two begin, the one that turns away from the pixel."""
    corner = start @ np.array([1, width])
    stop = (start + STEPS[ways]) @ np.array([1, width])
    leaving = np.full((int(corner.max(initial=0)) + 1, 4), -1)
    leaving[corner, ways] = np.arange(len(corner))
    choices = np.stack([leaving[stop, (ways + turn) % 4] for turn in (-1, 0, 1)])
    first = (choices >= 0).argmax(axis=0)
    return np.asarray(choices[first, np.arange(len(corner))])
