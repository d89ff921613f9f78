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
from ..isosurface.run_mask import RunMask
from ..isosurface.settle import Springs
from ..model.boxes import box_of
from ..progress import Progress, silent
from .contacts import AROUND, ROUNDS, cavities_in, filled, whole_of
from .crossed import SlabCrossings, crossed
from .cuts import Cuts
from .frame import MaskFrame
from .ground import bits_of, cells_from, ground, runs_of, sample, squares_from, told_of
from .mesh import SlabMesh
from .numbered import Numbered
from .parts import exchanged, told_by
from .region import region
from .rest import Settling
from .triangles import chosen, piece

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.boxes import Box
    from ..model.trace import Trace
    from ..settings import FitSettings
    from .keep import Kept, Slabs


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
    def frame(self) -> MaskFrame:
        """The box of the mask."""
        box = self.mask.box if hasattr(self.mask, "box") else box_of(self.mask, self.around)
        sizes = (box[0].stop - box[0].start, box[1].stop - box[1].start, box[2].stop - box[2].start)
        low = (box[0].start - 1, box[1].start - 1, box[2].start - 1)
        return MaskFrame(low, (sizes[0] + 2, sizes[1] + 2, sizes[2] + 2), tuple(self.mask.shape))

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
    enclosed, cavities : int
        Voxels that lie inside, and components of the others that the outside does not reach.
    stepped : bool
        Whether the levels are those of a mask.
    crossings : SlabCrossings
    trace : Trace
        In voxels; the energies, `distance_mm`, `clamped` and `unattracted` are not measured.
    """

    mesh: SlabMesh
    added: int
    enclosed: int
    cavities: int
    stepped: bool
    crossings: SlabCrossings
    trace: Trace

    @property
    def squares(self) -> int:
        """Faces between voxels, each of two halves."""
        return int(self.mesh.squares[-1])


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
    found, solid = _grounded(asked, frame, layers, slabs, threads)
    told = slabs.fetch(slabs.each(told_of, found))
    net = Numbered.of(layers, [one.layers for one in told], slabs)
    even = _stepped(net, found, asked.levels, slabs)
    springs = Springs.of(EVENED if even else 0.0, even, settings.stiffness)
    work = partial(squares_from, levels=asked.levels, even=even, threads=threads)
    squares = net.squares_exchanged(slabs.each(work, net.first[1], found))
    cells = net.exchanged(slabs.each(cells_from, net.first[0], found))
    regions = slabs.each(partial(region, frame=frame, threads=threads), net.places, cells)
    del found, cells  # they would take the disk
    thin = any(one.thin for one in told)
    state, rest, trace = Settling(net, regions, squares, thin, springs, settings, slabs, progress).reached()
    mesh = _meshed(net, regions, squares, state, rest, asked, slabs)
    added = sum(one.added for one in told)
    crossings = SlabCrossings(slabs, slabs.each(crossed, net.places, regions, squares), mesh.squares)
    return SlabSurface(mesh, added, solid.count, cavities_in(solid), even, crossings, trace)


def _layers(cuts: Cuts, frame: MaskFrame) -> Cuts:
    """Return where the layers of cells of a frame are cut: those between a slab's slices and their next ones are its.

    The layer below its first slice is the first slab's; slabs that have none are left out.
    """
    last = frame.shape[0] - 1
    places = [min(max(place - frame.low[0], 0), last) for place in cuts.places[1:-1]]
    return Cuts(tuple(sorted({0, *places, last})))


def _grounded(asked: Asked, frame: MaskFrame, layers: Cuts, slabs: Slabs, threads: int) -> tuple[list[Kept], RunMask]:
    """Look at the mask, as often as its contacts take rounds of joining, and again if it is to be filled.

    Returns
    -------
    found : list
        What is kept of a `SlabMask` a slab.
    solid : RunMask
        The mask whose boundary it is, in the frame.
    """
    around = [layers.around(slab, AROUND) for slab in range(len(layers))]
    masks = [asked.part(*frame.mask_slices(start, stop + 1)) for start, stop in around]
    columns = masks, [_slices(asked, frame, *one) for one in around], layers.own, around
    work = partial(ground, frame=frame, levels=asked.levels, threads=threads)
    joins, numbers = partial(work, rounds=ROUNDS if len(layers) > 1 else np.inf), np.arange(layers.places[-1] + 1)
    nothing = [None] * len(layers)

    def bits() -> list[tuple[Kept, ...]]:
        return exchanged(slabs, slabs.each(bits_of, found), layers, numbers, AROUND + 1)

    found = slabs.each(joins, *columns, [()] * len(layers), nothing)
    while any(one.unfinished for one in slabs.fetch(slabs.each(told_of, found))):
        found = slabs.each(joins, *columns, bits(), nothing)
    joined = _mask_of(found, asked, frame, slabs)
    if asked.surface != "outer":
        return found, joined
    whole = filled(joined)
    solid = [whole.part(start, stop + 1) for start, stop in around]
    return slabs.each(partial(work, rounds=0), *columns, bits(), solid), whole


def _mask_of(found: list[Kept], asked: Asked, frame: MaskFrame, slabs: Slabs) -> RunMask:
    """Return the whole mask as it is now, in the frame: where no voxel was added, the one that was asked for."""
    if isinstance(asked.mask, RunMask) and not any(one.added for one in slabs.fetch(slabs.each(told_of, found))):
        return frame.framed(asked.mask)
    return whole_of(slabs.fetch(slabs.each(partial(runs_of, shape=frame.shape[1:]), found)))


def _slices(asked: Asked, frame: MaskFrame, start: int, stop: int) -> Any:
    """Return the slices of the volume around layers of a frame."""
    if asked.voxels is None:
        return None
    low, high = frame.level_slices(start, stop)
    return asked.voxels[low:high]


def _stepped(net: Numbered, found: list[Kept], levels: Levels, slabs: Slabs) -> bool:
    """Tell whether the levels are those of a mask, by one of so many squares of the whole."""
    every = sampled(int(net.squares[-1]))
    four = np.concatenate(slabs.fetch(slabs.each(sample, net.first[1], [every] * len(found), found)))
    return levels.are_stepped([four[:, n] for n in range(four.shape[1])])


def _meshed(
    net: Numbered,
    regions: list[Kept],
    squares: list[tuple[Kept, ...]],
    state: list[Kept],
    rest: slice,
    asked: Asked,
    slabs: Slabs,
) -> SlabMesh:
    """Split the squares into triangles, and give the centers their numbers."""
    work = partial(chosen, rest=rest, affine=asked.affine)
    choice = slabs.each(work, net.places, regions, squares, net.exchanged(state))
    fours = np.array(told_by(slabs, choice), np.int64)
    first = (int(net.vertices[-1]) + np.cumsum(fours) - fours).tolist()
    last = partial(piece, rest=rest, affine=asked.affine, shape=tuple(asked.mask.shape))
    return SlabMesh.of(slabs.each(last, net.places, regions, squares, state, choice, first), slabs)
