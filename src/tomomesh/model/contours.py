"""Several networks a slice: which contour each is, and what becomes of it from slice to slice."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

OUTER, HOLE, WALL_OUTER, WALL_INNER = 0, 1, 2, 3
SIDES = ("outer", "hole", "wall_outer", "wall_inner")
"""What a contour is to the window: its border to the outside or to a hole, or one side of a wall. Odd ones have the
inside of the structure around them."""

BIRTH, DEATH, BRANCH, MERGE = "birth", "death", "branch", "merge"


@dataclass(frozen=True)
class Contour:
    """One ring of neurons on one slice.

    Attributes
    ----------
    slice, ring : int
        Slice number K, and the number of the ring within it.
    side : int
        ``OUTER``, ``HOLE``, ``WALL_OUTER`` or ``WALL_INNER``.
    track : int
        Contours that continue one another from slice to slice have one number.
    codebook : (u, 2) float array
        Positions of the neurons as voxel indices (column i, row j) within the slice.
    bridged : (u,) bool array
        Whether the edge from each neuron to the next crosses a gap in the pixels.
    outlined : bool
        Whether the network saw an outline, not the window's pixels.
    pixels, strays : int
        Inputs presented, and those of them that the trimmed re-fit dropped.
    """

    slice: int
    ring: int
    side: int
    track: int
    codebook: NDArray[np.float64]
    bridged: NDArray[np.bool_]
    outlined: bool
    pixels: int
    strays: int

    def __len__(self) -> int:
        return len(self.codebook)


@dataclass(frozen=True)
class Event:
    """What happens to a track other than going on.

    Attributes
    ----------
    kind : str
        ``"birth"``, ``"death"``, ``"branch"`` or ``"merge"``.
    slice : int
        The first slice of what is born or branches off; the last of what ends or merges.
    track : int
        The track that begins or ends.
    other : int
        The track that it leaves or joins; -1 for births and deaths.
    """

    kind: str
    slice: int
    track: int
    other: int = -1


@dataclass(frozen=True)
class Contours:
    """All contours of a study.

    Attributes
    ----------
    kind : str
        ``"components"``, ``"walls"`` or ``"loops"``.
    contours : tuple of Contour
        By rising slice, then ring.
    events : tuple of Event
    dropped : int
        Contours too small for a network.
    """

    kind: str
    contours: tuple[Contour, ...]
    events: tuple[Event, ...] = ()
    dropped: int = 0

    def __len__(self) -> int:
        return len(self.contours)

    @cached_property
    def slices(self) -> NDArray[np.int32]:
        """Slice numbers K that have contours, rising."""
        return np.unique(np.array([contour.slice for contour in self.contours], np.int32))

    @property
    def tracks(self) -> int:
        """How many tracks there are."""
        return len({contour.track for contour in self.contours})

    @cached_property
    def by_slice(self) -> dict[int, list[Contour]]:
        """The contours of each slice that has any."""
        found: dict[int, list[Contour]] = {}
        for contour in self.contours:
            found.setdefault(contour.slice, []).append(contour)
        return found

    def on(self, number: int) -> list[Contour]:
        """Return the contours of a slice."""
        return self.by_slice.get(number, [])

    def codebook_on(self, number: int) -> NDArray[np.float64]:
        """Return the neurons (u, 2) of all rings of a slice, one ring after the other."""
        return np.concatenate([contour.codebook for contour in self.on(number)])

    def count(self, kind: str) -> int:
        """Count events of a kind."""
        return sum(event.kind == kind for event in self.events)
