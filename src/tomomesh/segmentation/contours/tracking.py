"""Carry contours from slice to slice: which goes on as which, and what begins, ends, branches and merges."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...measure.matching import SHARED, matched, similar
from ...model.contours import BIRTH, BRANCH, DEATH, MERGE, Event

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .loops import Patch


class Tracker:
    """Links contours slice by slice, by what their insides have in common with those of the slice before.

    Each contour has one successor at most, of a like area: those pairs that share most pixels over the whole slice
    (Kuhn 1955). What is left over branches off, or merges into, the contour that it shares most with; else it is born,
    or dies.

    Attributes
    ----------
    events : list of Event
        As far as it has come.
    """

    def __init__(self) -> None:
        self.events: list[Event] = []
        self._slices = self._tracks = 0
        self._insides: Sequence[Patch] = ()
        self._sides: Sequence[int] = ()
        self._numbers: list[int] = []

    def follow(self, here: Sequence[Patch], sides: Sequence[int]) -> list[int]:
        """Return the tracks of the contours of the next slice; tracks are numbered as they begin.

        Parameters
        ----------
        here : sequence of Patch
            The pixels inside each contour.
        sides : sequence of int
            What each contour is; only contours of one side go on as each other.
        """
        before, k = self._insides, self._slices
        shared = _shared(before, here, self._sides, sides)
        pairs = _successors(shared, [patch.area for patch in before], [patch.area for patch in here])
        row = []
        for b in range(len(here)):
            if b in pairs:
                row.append(self._numbers[pairs[b]])
                continue
            source = _most(shared[:, b])
            row.append(self._tracks)
            self._happens((BIRTH, BRANCH), k, self._tracks, source, self._numbers)
            self._tracks += 1
        for a in sorted(set(range(len(before))) - set(pairs.values())):
            self._happens((DEATH, MERGE), k - 1, self._numbers[a], _most(shared[a]), row)
        self._slices, self._insides, self._sides, self._numbers = k + 1, here, sides, row
        return row

    def _happens(self, kinds: tuple[str, str], k: int, track: int, other: int, numbers: Sequence[int]) -> None:
        """Note what happens to a track: the one by itself, the other with one of the contours beside it."""
        self.events.append(Event(kinds[0], k, track) if other < 0 else Event(kinds[1], k, track, numbers[other]))

    def end(self) -> tuple[Event, ...]:
        """Return all events: what is on the last slice ends there."""
        return (*self.events, *(Event(DEATH, self._slices - 1, number) for number in self._numbers))


def _successors(shared: NDArray[np.int64], before: Sequence[int], here: Sequence[int]) -> dict[int, int]:
    """Return which contour of the slice before goes on as which, by the number of the later one."""
    pairs = matched(-shared.astype(np.float64), similar(before, here) & (shared > 0), alone=0.0)
    return {b: a for a, b in pairs}


def _shared(
    before: Sequence[Patch], here: Sequence[Patch], sides: Sequence[int], others: Sequence[int]
) -> NDArray[np.int64]:
    """Count the pixels that contours of two slices share; 0 where they are few of the smaller, or the sides differ."""
    shared = np.zeros((len(before), len(here)), np.int64)
    for a, one in enumerate(before):
        for b, other in enumerate(here):
            if sides[a] == others[b]:
                common = one.shared(other)
                shared[a, b] = common if common > SHARED * min(one.area, other.area) else 0
    return shared


def _most(shared: NDArray[np.int64]) -> int:
    """Return where most is shared; -1 where nothing is."""
    return int(shared.argmax()) if shared.any() else -1
