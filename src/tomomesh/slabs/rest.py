"""A net comes to rest in slabs, which hand each other what lies in their halos every few steps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..isosurface.settle import Springs
from ..isosurface.thin import GIVEN_BACK
from ..model.trace import Motion, Trace
from .parts import told_by
from .place import HALO
from .region import LAST, begun, goals_of, put, returned, stepped

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..progress import Progress
    from ..settings import FitSettings
    from .keep import Kept, Slabs
    from .numbered import Numbered

BEGINNING = 4
"""Steps before it is told how fast a net comes to rest. Chosen: levels take 6 and masks 10 to 14."""


@dataclass(frozen=True)
class Settling:
    """A net on its way to rest.

    Attributes
    ----------
    net : Numbered
    regions : list
        What is kept of a `Region` a slab.
    squares : list of tuples
        Of its squares and its neighbors', see `squares_from`.
    thin : bool
        Whether the mask is thin anywhere.
    springs : Springs
    settings : FitSettings
    slabs : Slabs
    progress : callable
    """

    net: Numbered
    regions: list[Kept]
    squares: list[tuple[Kept, ...]]
    thin: bool
    springs: Springs
    settings: FitSettings
    slabs: Slabs
    progress: Progress

    def reached(self) -> tuple[list[Kept], slice, Trace]:
        """Return a part a slab, which of its arrays says where the vertices come to rest, and how they did."""
        goals, state = self._begun()
        where, history, rested, most = LAST, list[Motion](), False, self.settings.max_steps
        while len(history) < most and not rested:
            begin, steps = self.net.exchanged(state), min(self._likely(history), most - len(history))
            state, motions = self._stepped(goals, begin, steps, not history)
            done = next((n for n, one in enumerate(motions, 1) if one.rests(self.settings.tolerance)), 0)
            if 0 < done < steps - 1:  # the others are not to be taken
                state, motions = self._stepped(goals, begin, done, not history)
            where = slice(1) if 0 < done == len(motions) - 1 else LAST
            history, rested = [*history, *motions[: done or None]], done > 0
            self.progress("fit", len(history), most)
        self.progress("fit", max(len(history), 1), max(len(history), 1))
        return state, where, Trace.of(history, converged=rested)

    def _likely(self, history: Sequence[Motion]) -> int:
        """Return how many steps to take until the next exchange: as many as can be, or as the net is likely to need.

        Moves fall in about equal shares, and steps that go beyond rest have to be taken once more.
        """
        if len(history) < 2:
            return BEGINNING
        late, last = (max(one.speed, one.acceleration) for one in (history[-min(len(history), 4)], history[-1]))
        share = (last / late) ** (1 / (min(len(history), 4) - 1)) if 0 < last < late else 1.0
        left = np.log(self.settings.tolerance / last) / np.log(share) if 0 < share < 1 else np.inf
        return int(min(max(left, 0.0) + 1, HALO // self.springs.reach))

    def _begun(self) -> tuple[list[Kept], list[Kept]]:
        """Return what the vertices are drawn to, those of halos too, and where they begin."""
        springs = self.springs if self.settings.max_steps else Springs.of(0.0, False, 1.0)
        places, give = self.net.places, GIVEN_BACK if springs.evens and self.thin else 0
        goals = start = self.slabs.each(partial(begun, springs=springs), places, self.regions, self.squares)
        near = self.net.exchanged(goals)
        for _ in range(give):
            work = partial(returned, springs=springs)
            goals = self.slabs.each(work, places, self.regions, self.squares, goals, self.net.exchanged(start))
            near = self.net.exchanged(goals)
            start = self.slabs.each(partial(put, springs=springs), places, self.regions, near)
        return self.slabs.each(goals_of, places, near), start

    def _stepped(
        self, goals: list[Kept], begin: list[tuple[Kept, ...]], steps: int, begins: bool
    ) -> tuple[list[Kept], list[Motion]]:
        """Take steps, and tell how the whole moves in each."""
        work = partial(stepped, springs=self.springs, steps=steps, begins=begins)
        state = self.slabs.each(work, self.net.places, self.regions, goals, begin)
        longest = np.max(told_by(self.slabs, state), axis=0)
        return state, [Motion(speed, change, 0.0) for speed, change in longest.tolist()]
