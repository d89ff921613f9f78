"""Carry contours from slice to slice: which goes on as which, and what begins, ends, branches and merges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...measure.matching import SHARED, matched, similar
from ...model.contours import BIRTH, BRANCH, DEATH, MERGE, Event

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .loops import Patch


@dataclass(frozen=True)
class Tracks:
    """The track of every contour.

    Attributes
    ----------
    numbers : list of lists of int
        For each slice and each of its contours; tracks are numbered as they begin.
    events : list of Event
    """

    numbers: list[list[int]]
    events: list[Event]

    @property
    def members(self) -> list[list[tuple[int, int]]]:
        """Return the slice and the ring of every contour of each track, in order."""
        found: list[list[tuple[int, int]]] = [
            [] for _ in range(1 + max((n for row in self.numbers for n in row), default=-1))
        ]
        for k, row in enumerate(self.numbers):
            for ring, number in enumerate(row):
                found[number].append((k, ring))
        return found


def track(insides: Sequence[Sequence[Patch]], sides: Sequence[Sequence[int]]) -> Tracks:
    """Link contours of neighboring slices by what their insides have in common.

    Each contour has one successor at most, of a like area: those pairs that share most pixels over the whole slice
    (Kuhn 1955). What is left over branches off, or merges into, the contour that it shares most with; else it is born,
    or dies.

    Parameters
    ----------
    insides : sequence of sequences of Patch
        The pixels inside each contour of every slice.
    sides : sequence of sequences of int
        What each contour is; only contours of one side go on as each other.

    Returns
    -------
    Tracks
    """
    numbers: list[list[int]] = []
    events: list[Event] = []
    count = 0
    for k, here in enumerate(insides):
        before = insides[k - 1] if k else []
        shared = _shared(before, here, sides[k - 1] if k else [], sides[k])
        pairs = _successors(shared, [patch.area for patch in before], [patch.area for patch in here])
        row = []
        for b in range(len(here)):
            if b in pairs:
                row.append(numbers[k - 1][pairs[b]])
                continue
            row.append(count)
            source = _most(shared[:, b])
            events.append(Event(BIRTH, k, count) if source < 0 else Event(BRANCH, k, count, numbers[k - 1][source]))
            count += 1
        for a in sorted(set(range(len(before))) - set(pairs.values())):
            target = _most(shared[a])
            ended = numbers[k - 1][a]
            events.append(Event(DEATH, k - 1, ended) if target < 0 else Event(MERGE, k - 1, ended, row[target]))
        numbers.append(row)
    events += [Event(DEATH, len(numbers) - 1, number) for number in (numbers[-1] if numbers else [])]
    return Tracks(numbers, events)


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
