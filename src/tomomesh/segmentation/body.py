"""Which components of a window are the patient, which the scanner's table and which specks; what a body encloses."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..isosurface.run_mask import RunMask
from ..isosurface.runs import Runs
from ..model.boxes import box_of
from .window import PRESETS_HU

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from ..model.volume import Volume
    from .slabwise.cut import Cut

    Mask = NDArray[np.bool_]

THICK = 6.0
"""Half the thickness in mm that a body has somewhere, and a table's shells and a head's holder nowhere. Measured: half
of it leaves half of the table of a CT in, and a shell of 6 mm; twice changes nothing."""
SHARE = 0.2
"""The same over half the thickness of the thickest body in the study: a small one has thin limbs. Chosen: half and
twice of it change nothing on that CT and the heads of tests/test_body.py."""
LEAST = 0.1
"""Share of a component that must lie in a body. Measured: tables and holders under 0.02, bones and arms over 0.95."""
CELL, CELLS = 3.0, 160
"""Edge in mm of the coarse voxels in which thickness is measured, half of `THICK`, and the fewest of them along the
longest side. Chosen: half and twice of both change nothing on that CT and those heads."""
RIM, RIM_VOXELS = 2.0, 3
"""Millimeters, and voxels, the fewer of both, around a holder that it fills in part, and that are cut away with it
where it touches the patient: edges are blurred over so much. Measured on a head's CT: half of it leaves 0.07 % more in
the skin, shreds of the holder, twice takes 0.14 % more, of the ears too."""
SPECK, SMALL = 8, 0.001
"""Voxels, and share of the largest component, under both of which a component is a speck, and an enclosed hole a pore.
Fewer than 2 x 2 x 2 voxels have no extent in some direction: no shape can be told. Measured on a head's CT: half of 8
leaves 2 specks more in its bone, twice takes 6 more, the largest of 90 mm3, which may be chalk; labels of skulls have
63 to 182 under 8 voxels and 5 to 12 small pieces over it. The share keeps every piece of small windows."""
DEEP = 2
"""How far, in balls' radii, the air of the room goes on into what no ball enters: creases beside a nose or behind an
ear are open, airways end there. Chosen: half of it adds 0.10 % to the skin of a head's CT, twice takes 0.04 %."""


@dataclass(frozen=True)
class Components:
    """What is kept of a window.

    Attributes
    ----------
    mask : RunMask
        Whole components.
    found, dropped : int
        Components of the window, and those that were left out.
    """

    mask: RunMask
    found: int
    dropped: int


@dataclass(frozen=True)
class Coarse:
    """A mask in coarse voxels, which are drawn in a study's own slab by slab.

    Attributes
    ----------
    mask : (k, j, i) bool array
    every : sequence of int
        How many voxels (K, J, I) a coarse one is long.
    cut : Cut
        The study.
    """

    mask: Mask
    every: Sequence[int]
    cut: Cut

    def __iter__(self) -> Iterator[Mask]:
        """Draw one slab after the other."""
        return map(self.drawn, pairwise(self.cut.cuts))

    def drawn(self, slices: tuple[int, int]) -> Mask:
        """Draw the slices from a first to before another."""
        fine = self.mask[np.arange(*slices) // self.every[0]]
        for axis in (1, 2):
            fine = np.repeat(fine, self.every[axis], axis=axis)
        return fine[:, : self.cut.shape[1], : self.cut.shape[2]]

    def sampled(self, every: Sequence[int]) -> Mask:
        """Return it at every n-th voxel of the study along each axis."""
        sides = zip(self.cut.shape, every, self.every, strict=True)
        return self.mask[np.ix_(*(np.arange(0, size, step) // own for size, step, own in sides))]


def largest_component(mask: RunMask) -> Components:
    """Keep the component of a window with the most voxels; of equals the first."""
    runs = Runs.of(mask, corners=True)
    return _kept(runs, np.arange(len(runs.sizes)) == np.argmax(runs.sizes))


@dataclass(frozen=True)
class Body:
    """The patient in a CT, whatever window is chosen.

    A body is what is denser than air (the window `skin`) once all that is thinner than twice `THICK` is taken away,
    by opening with a ball. So it holds the bones under the skin, and a table's shells or a head's holder are no part
    of it.

    Attributes
    ----------
    inside : Coarse
    holders : Coarse
        What is as dense as bone and lies in no body, with the `RIM` that it fills in part.
    """

    inside: Coarse
    holders: Coarse

    @classmethod
    def of(cls, volume: Volume, cut: Cut) -> Body:
        """Find it in a volume, in Hounsfield units, whose voxels are `cut`."""
        (every, spacing), (finer, _) = _coarse(volume), _coarse(volume, RIM)
        levels, dense = cut.sampled(every, finer)
        inside = Coarse(_opened(levels > PRESETS_HU["skin"][0], spacing), every, cut)
        return cls(inside, _holders(volume, inside, dense > PRESETS_HU["spongy-bone"][0]))


def components_of_body(mask: RunMask, body: Body) -> Components:
    """Keep the components of a window of a CT that lie in a body: those of which a tenth at least does.

    Where a window joins holders to the patient, they are cut away.
    """
    kept = _in_body(mask, body.inside)
    parts = zip(body.holders.cut.over(kept.mask), body.holders, strict=True)
    without = RunMask.of(part[:] & ~holder for part, holder in parts)
    if without.count == kept.mask.count:
        return kept
    return Components(_in_body(without, body.inside).mask, kept.found, kept.dropped)


def _holders(volume: Volume, body: Coarse, dense: Mask) -> Coarse:
    """Return what is as dense as the least bone, lies in no body and is larger than its ball, with its rim.

    It is found in voxels as wide as the rim, which tell how dense they are. What is smaller may be a bit of bone in a
    thin part of the patient.
    """
    every, spacing = _coarse(volume, RIM)
    runs = Runs.of(dense, corners=True)
    inside = runs.only(_lie_in(runs, [body.sampled(every)]))
    runs = Runs.of(dense & ~inside[:], corners=True)
    foreign = runs.only(runs.sizes * np.prod(spacing) > 4 / 3 * np.pi * THICK**3)[:]
    if foreign.any():
        reach = max(float(spacing.min()), min(RIM, RIM_VOXELS * min(volume.spacing_mm)))
        foreign = scipy.ndimage.binary_dilation(foreign, _ball(reach, spacing))
    return Coarse(foreign, every, body.cut)


def _ball(radius: float, spacing: NDArray[np.float64]) -> Mask:
    """Return the voxels whose centers lie within a distance of that of the middle one."""
    reach = [int(radius / edge) + 1 for edge in spacing]
    sides = [np.arange(-far, far + 1) * edge for far, edge in zip(reach, spacing, strict=True)]
    return np.asarray(np.sqrt(sum(side**2 for side in np.meshgrid(*sides, indexing="ij"))) <= radius)


def thick_components(mask: RunMask, volume: Volume, cut: Cut) -> Components:
    """Keep the components that are thicker than twice `THICK` somewhere, as bodies are: a tenth of them at least."""
    every, spacing = _coarse(volume)
    return _in_body(mask, Coarse(_opened(mask.sampled(every), spacing), every, cut))


def _in_body(mask: RunMask, body: Coarse) -> Components:
    """Keep the components that lie in bodies."""
    runs = Runs.of(mask, corners=True)
    return _kept(runs, _lie_in(runs, body))


def _lie_in(runs: Runs, body: Iterable[Mask]) -> Mask:
    """Tell of which components (c,) a tenth at least lies in bodies, given as slabs."""
    return np.asarray(runs.within(body) >= LEAST * runs.sizes)


@dataclass(frozen=True)
class Cleaned:
    """A window without specks and pores.

    Attributes
    ----------
    mask : RunMask
    specks, speck_voxels, largest_speck : int
        Components that were left out, their voxels, and those of the largest.
    pores, pore_voxels : int
        Enclosed holes that were filled.
    """

    mask: RunMask
    specks: int = 0
    speck_voxels: int = 0
    largest_speck: int = 0
    pores: int = 0
    pore_voxels: int = 0


def without_specks(mask: RunMask) -> Cleaned:
    """Leave out components that are specks, and fill enclosed holes as small as that (`SPECK`, `SMALL`).

    Components touch along faces, edges or at corners, and holes along faces: no voxel of a hole that is filled has a
    neighbor outside of the window but in the hole.

    Parameters
    ----------
    mask : RunMask
        One voxel at least.
    """
    box = mask.box
    held = mask.cropped(box)
    pieces, holes = Runs.of(held, corners=True), Runs.of(~held)
    sizes, room = pieces.sizes, holes.sizes
    limit = min(float(SPECK), SMALL * float(sizes.max()))
    small, pores = sizes < limit, ~holes.bordering & (room < limit)
    if not (small.any() or pores.any()):
        return Cleaned(mask)
    cleaned = (pieces.only(~small) | holes.only(pores)).placed(box, mask.shape)
    counts = (small.sum(), sizes[small].sum(), sizes[small].max(initial=0), pores.sum(), room[pores].sum())
    return Cleaned(cleaned, *map(int, counts))


def solid(body: RunMask, volume: Volume, cut: Cut) -> RunMask:
    """Fill what the air of the room does not reach in a body: lungs, airways, sinuses, bowels.

    The air of the room comes from the sides of the study, not from its ends along the patient, which may cut through
    lungs. It goes where a ball as thick as `THICK` can, and `DEEP` radii further.

    Parameters
    ----------
    body : RunMask
        What is denser than air, without the table.
    volume : Volume
        Its affine tells which of its axes is the patient's.
    cut : Cut
        Its voxels; they are not looked at.
    """
    every, spacing = _coarse(volume)
    coarse = body.sampled(every)
    if not coarse.any():
        return body
    radius = _radius(scipy.ndimage.distance_transform_edt(coarse, spacing))
    pads = [(int(2 * radius / edge) + 2,) * 2 for edge in spacing]
    along = int(np.argmax(np.abs(volume.affine[2, 2::-1])))
    pads[along] = (0, 0)
    air = np.pad(~coarse, pads, constant_values=True)
    wide, _ = scipy.ndimage.label(scipy.ndimage.distance_transform_edt(air, spacing) > radius)
    apart = scipy.ndimage.distance_transform_edt(wide != wide[0, 0, 0], spacing)
    apart = apart[tuple(slice(low, size - high) for (low, high), size in zip(pads, apart.shape, strict=True))]
    deep = Coarse(apart <= (1 + DEEP) * radius, every, cut)
    open_ = Runs.of(RunMask.of(near & ~part[:] for near, part in zip(deep, cut.over(body), strict=True)))
    return ~open_.only(open_.within(Coarse(apart <= radius, every, cut)) > 0)


def _kept(runs: Runs, kept: Mask) -> Components:
    found, left = len(kept), int(np.count_nonzero(kept))
    return Components(runs.mask if left == found else runs.only(kept), found, found - left)


def _coarse(volume: Volume, cell: float = CELL) -> tuple[list[int], NDArray[np.float64]]:
    """Return how many voxels (K, J, I) a coarse one is long, and its edges in mm."""
    spacing = np.array(volume.spacing_mm[::-1])
    cell = min(cell, float((spacing * volume.shape).max()) / CELLS)
    every = [max(1, int(cell / edge)) for edge in spacing]
    return every, spacing * every


def _opened(mask: NDArray[np.bool_], spacing: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Take away what no ball fits into; what lies beyond the border counts as more of the same.

    Nothing farther than a voxel from the mask is looked at: what lies there is never the nearest.
    """
    if mask.all() or not mask.any():
        return mask
    box = tuple(slice(max(side.start - 1, 0), side.stop + 1) for side in box_of(mask))
    depth = scipy.ndimage.distance_transform_edt(mask[box], spacing)
    radius = _radius(depth)
    opened = np.zeros_like(mask)
    opened[box] = scipy.ndimage.distance_transform_edt(depth <= radius, spacing) <= radius
    return opened


def _radius(depth: NDArray[np.float64]) -> float:
    """Return the radius of the ball that tells thick from thin, by the depth of the thickest body."""
    return min(THICK, SHARE * float(depth.max()))
