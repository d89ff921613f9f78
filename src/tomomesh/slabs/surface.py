"""The boundary of a window as a surface, slab by slab: the bytes of the run in memory, which is the case of one slab.

====================  ======================================  =================================================
Step                  What a slab looks at                    What is known of the whole, and how
====================  ======================================  =================================================
contacts              as many layers as there are rounds, 3   rounds: the greatest
cells                 the next slice                          numbers of vertices and squares: sums
what the levels are   two voxels along a border               whether they are those of a mask: a sample
net, rings            8 layers of cells
beginning             7 layers of vertices for each series,   whether anything is thin: any
                      and for each time what was lost is
                      given back
steps                 2 layers a step against bends, else 1   whether all is at rest: the greatest move
triangles             3 layers of vertices                    numbers of centers: sums
====================  ======================================  =================================================
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..isosurface.crossings import EVENED, Levels, sampled
from ..isosurface.settle import Springs
from ..isosurface.thin import GIVEN_BACK
from ..model.boxes import box_of
from ..model.trace import Motion, Trace
from ..progress import Progress, silent
from .contacts import AROUND, ROUNDS, filled
from .cuts import Cuts
from .frame import Frame
from .ground import bits_of, cells_from, ground, runs_of, sample, squares_from, told
from .mesh import SlabMesh
from .parts import exchanged, told_by
from .place import HALO, Place
from .region import LAST, begun, goals_of, put, region, returned, rings_of, stepped
from .triangles import chosen, piece

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..model.boxes import Box
    from ..settings import FitSettings
    from .keep import Kept, Slabs

    Longs = NDArray[np.int64]


BEGINNING = 4
"""Steps before it is told how fast a net comes to rest. Chosen: levels take 6 and masks 10 to 14."""


@dataclass(frozen=True)
class Asked:
    """What a surface is to be of.

    Attributes
    ----------
    mask : (K, J, I) bool array, or RunMask
        The voxels that are kept, one at least.
    voxels : (K, J, I[, L]) array, LazyVoxels or None
        What a volume holds; None where the mask is all there is: then the window is ``0 < k``.
    affine : (4, 4) float array
    lower, upper, layers, surface
        As of `tomomesh.isosurface.voxels.boundary`.
    around : box, optional
        Outside of which no voxel is kept.
    """

    mask: Any
    voxels: Any
    affine: NDArray[np.float64]
    lower: float | NDArray[np.float64] = -np.inf
    upper: float | NDArray[np.float64] = np.inf
    layers: str = "all"
    surface: str = "all"
    around: Box | None = None

    @property
    def frame(self) -> Frame:
        """The box of the mask."""
        box = self.mask.box if hasattr(self.mask, "box") else box_of(self.mask, self.around)
        sizes = (box[0].stop - box[0].start, box[1].stop - box[1].start, box[2].stop - box[2].start)
        low = (box[0].start - 1, box[1].start - 1, box[2].start - 1)
        return Frame(low, (sizes[0] + 2, sizes[1] + 2, sizes[2] + 2), tuple(self.mask.shape))

    @property
    def levels(self) -> Levels:
        """The window, without its voxels."""
        lower = 0.0 if self.voxels is None else self.lower
        return Levels(np.zeros((0, 0, 0)), lower, self.upper, self.layers)

    def part(self, start: int, stop: int) -> Any:
        """Return some slices of the mask, as they are sent."""
        return self.mask.part(start, stop) if hasattr(self.mask, "part") else self.mask[start:stop]


@dataclass(frozen=True)
class SlabSurface:
    """A surface as pieces.

    Attributes
    ----------
    mesh : SlabMesh
    added : int
        Voxels added so that no two touch along an edge or at a corner alone.
    stepped : bool
        Whether the levels are those of a mask.
    trace : Trace
        In voxels; the energies, `distance_mm`, `clamped` and `unattracted` are not measured.
    """

    mesh: SlabMesh
    added: int
    stepped: bool
    trace: Trace


def surface_in_slabs(
    asked: Asked, cuts: Cuts, settings: FitSettings, slabs: Slabs, *, threads: int = 1, progress: Progress = silent
) -> SlabSurface:
    """Let a net around the voxels of a window come to rest where the levels cross its bounds, slab by slab.

    Parameters
    ----------
    asked : Asked
    cuts : Cuts
        Of the slices of the volume; no byte depends on them.
    settings : FitSettings
        Stiffness, tolerance and most steps.
    slabs : Slabs
        Who works on them.
    threads : int
        For each slab that is worked on.
    progress : callable

    Returns
    -------
    SlabSurface
        With the vertices and faces of `tomomesh.isosurface.voxels.voxel_surface` for voxels that are not divided.
    """
    frame = asked.frame
    layers = _layers(cuts, frame)
    found, rounds = _grounded(asked, frame, layers, slabs, threads)
    net = _Numbered.of(layers, found, rounds, slabs)
    even = net.stepped(asked.levels)
    springs = Springs.of(EVENED if even else 0.0, even, settings.stiffness)
    work = partial(squares_from, levels=asked.levels, even=even, threads=threads)
    squares = net.squares_exchanged(slabs.each(work, net.first[1], found))
    cells = net.exchanged(slabs.each(cells_from, net.first[0], found))
    regions = slabs.each(partial(region, frame=frame, threads=threads), net.places, cells)
    del found, cells
    state, rest, trace = _Rest(net, regions, squares, springs, settings, slabs, progress).reached()
    mesh = _meshed(net, regions, squares, state, rest, asked.affine, slabs)
    return SlabSurface(mesh, sum(one[1] for one in rounds), even, trace)


def _layers(cuts: Cuts, frame: Frame) -> Cuts:
    """Return where the layers of cells of a frame are cut: those between a slab's slices and their next ones are its.

    The layer below its first slice is the first slab's; slabs that have none are left out.
    """
    last = frame.shape[0] - 1
    places = [min(max(place - frame.low[0], 0), last) for place in cuts.places[1:-1]]
    return Cuts(tuple(sorted({0, *places, last})))


def _grounded(
    asked: Asked, frame: Frame, layers: Cuts, slabs: Slabs, threads: int
) -> tuple[list[Kept], list[tuple[bool, int, bool, Longs]]]:
    """Look at the mask, as often as its contacts take rounds of joining, and again if it is to be filled."""
    around = [layers.around(slab, AROUND) for slab in range(len(layers))]
    masks = [asked.part(*frame.held(start, stop + 1)) for start, stop in around]
    columns = masks, [_slices(asked, frame, *one) for one in around], layers.own, around
    work = partial(ground, frame=frame, levels=asked.levels, threads=threads)
    rounds, numbers = (ROUNDS if len(layers) > 1 else np.inf), np.arange(layers.places[-1] + 1)
    nothing = [None] * len(layers)
    found = slabs.each(partial(work, rounds=rounds), *columns, [()] * len(layers), nothing)
    while any(one[0] for one in slabs.fetch(slabs.each(told, found))):
        bits = exchanged(slabs, slabs.each(bits_of, found), layers, numbers, AROUND + 1)
        found = slabs.each(partial(work, rounds=rounds), *columns, bits, nothing)
    if asked.surface == "outer":
        whole = filled(slabs.fetch(slabs.each(partial(runs_of, shape=frame.shape[1:]), found)))
        bits = exchanged(slabs, slabs.each(bits_of, found), layers, numbers, AROUND + 1)
        solid = [whole.part(start, stop + 1) for start, stop in around]
        found = slabs.each(partial(work, rounds=0), *columns, bits, solid)
    return found, slabs.fetch(slabs.each(told, found))


def _slices(asked: Asked, frame: Frame, start: int, stop: int) -> Any:
    """Return the slices of the volume around layers of a frame."""
    if asked.voxels is None:
        return None
    low, high = frame.looked_at(start, stop)
    return asked.voxels[low:high]


@dataclass(frozen=True)
class _Numbered:
    """Slabs whose vertices and squares have their numbers in the whole."""

    layers: Cuts
    found: list[Kept]
    vertices: Longs
    squares: Longs
    thin: bool
    slabs: Slabs

    @classmethod
    def of(
        cls, layers: Cuts, found: list[Kept], rounds: Sequence[tuple[bool, int, bool, Longs]], slabs: Slabs
    ) -> _Numbered:
        counts = np.concatenate([one[3] for one in rounds], axis=1)
        vertices, squares = np.concatenate([np.zeros((2, 1), np.int64), np.cumsum(counts, axis=1)], axis=1)
        return cls(layers, found, vertices, squares, any(one[2] for one in rounds), slabs)

    @property
    def places(self) -> list[Place]:
        """Where the slabs lie."""
        return [Place.of(self.layers, slab, self.vertices, self.squares) for slab in range(len(self.layers))]

    @property
    def first(self) -> tuple[list[int], list[int]]:
        """Numbers of each slab's first vertex and square."""
        starts = list(self.layers.places[:-1])
        return self.vertices[starts].tolist(), self.squares[starts].tolist()

    def exchanged(self, parts: Sequence[Kept]) -> list[tuple[Kept, ...]]:
        """Hand the slabs the vertices of their halos too."""
        return exchanged(self.slabs, parts, self.layers, self.vertices, HALO)

    def squares_exchanged(self, parts: Sequence[Kept]) -> list[tuple[Kept, ...]]:
        """Hand the slabs the squares of their halos too."""
        return exchanged(self.slabs, parts, self.layers, self.squares, HALO)

    def stepped(self, levels: Levels) -> bool:
        """Tell whether the levels are those of a mask, by every so manieth square of the whole."""
        every = sampled(int(self.squares[-1]))
        lines = self.slabs.each(sample, self.first[1], [every] * len(self.found), self.found)
        four = np.concatenate(self.slabs.fetch(lines))
        return levels.are_stepped([four[:, n] for n in range(four.shape[1])])


@dataclass(frozen=True)
class _Rest:
    """A net on its way to rest."""

    net: _Numbered
    regions: list[Kept]
    squares: list[tuple[Kept, ...]]
    springs: Springs
    settings: FitSettings
    slabs: Slabs
    progress: Progress

    def reached(self) -> tuple[list[Kept], slice, Trace]:
        """Return a part a slab, which of its arrays says where the vertices come to rest, and how they did."""
        goals, state = self._begun()
        rings, where = self.slabs.each(rings_of, self.regions), LAST
        history, rested, most = list[Motion](), False, self.settings.max_steps
        while len(history) < most and not rested:
            begin, steps = self.net.exchanged(state), min(self._likely(history), most - len(history))
            state, motions = self._stepped(rings, goals, begin, steps, not history)
            done = next((n for n, one in enumerate(motions, 1) if one.rests(self.settings.tolerance)), 0)
            if 0 < done < steps - 1:  # the others are not to be taken
                state, motions = self._stepped(rings, goals, begin, done, not history)
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
        places, give = self.net.places, GIVEN_BACK if springs.evens and self.net.thin else 0
        goals = start = self.slabs.each(partial(begun, springs=springs), places, self.regions, self.squares)
        near = self.net.exchanged(goals)
        for _ in range(give):
            work = partial(returned, springs=springs)
            goals = self.slabs.each(work, places, self.regions, self.squares, goals, self.net.exchanged(start))
            near = self.net.exchanged(goals)
            start = self.slabs.each(partial(put, springs=springs), places, self.regions, near)
        return self.slabs.each(goals_of, places, near), start

    def _stepped(
        self, rings: list[Kept], goals: list[Kept], begin: list[tuple[Kept, ...]], steps: int, begins: bool
    ) -> tuple[list[Kept], list[Motion]]:
        """Take steps, and tell how the whole moves in each."""
        work = partial(stepped, springs=self.springs, steps=steps, begins=begins)
        state = self.slabs.each(work, self.net.places, rings, goals, begin)
        longest = np.max(told_by(self.slabs, state), axis=0)
        return state, [Motion(speed, change, 0.0) for speed, change in longest.tolist()]


def _meshed(
    net: _Numbered,
    regions: list[Kept],
    squares: list[tuple[Kept, ...]],
    state: list[Kept],
    rest: slice,
    affine: NDArray[np.float64],
    slabs: Slabs,
) -> SlabMesh:
    """Split the squares into triangles, and give the centers their numbers."""
    work = partial(chosen, rest=rest, affine=affine)
    choice = slabs.each(work, net.places, regions, squares, net.exchanged(state))
    fours = np.array(told_by(slabs, choice), np.int64)
    first = (int(net.vertices[-1]) + np.cumsum(fours) - fours).tolist()
    last = partial(piece, rest=rest, affine=affine)
    return SlabMesh.of(slabs.each(last, net.places, regions, squares, state, choice, first), slabs)
