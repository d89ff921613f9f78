"""Which components of a window are the patient, which the scanner's table and which specks; what a body encloses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..isosurface.run_mask import RunMask
from ..isosurface.runs import Runs
from ..model.boxes import box_of
from .window import PRESETS_HU

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.boxes import Box
    from ..model.volume import Volume

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
    mask : (K, J, I) bool array
        Whole components.
    found, dropped : int
        Components of the window, and those that were left out.
    """

    mask: NDArray[np.bool_]
    found: int
    dropped: int


def largest_component(mask: NDArray[np.bool_]) -> Components:
    """Keep the component of a window with the most voxels; of equals the first."""
    runs = Runs.of(mask, corners=True)
    return _kept(runs, np.arange(len(runs.sizes)) == np.argmax(runs.sizes), mask)


def components_of_body(mask: NDArray[np.bool_], volume: Volume) -> Components:
    """Keep the components of a window of a CT that lie in a body: those of which a tenth at least does.

    A body is what is denser than air (the window `skin`) once all that is thinner than twice `THICK` is taken away,
    by opening with a ball. So it holds the bones under the skin, and a table's shells or a head's holder are no part
    of it. Where a window joins them to the patient, they are cut away: what is as dense as bone and lies in no body,
    with the `RIM` that it fills in part.

    Parameters
    ----------
    mask : (K, J, I) bool array
    volume : Volume
        Hounsfield units.
    """
    body = _body(volume)
    kept = _in_body(mask, body)
    beside = _holders(volume, body)
    if not np.any(beside & kept.mask):
        return kept
    return Components(_in_body(kept.mask & ~beside, body).mask, kept.found, kept.dropped)


def _holders(volume: Volume, body: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return what is denser than the least bone, lies in no body and is larger than its ball, with its rim.

    It is found in voxels as wide as the rim. What is smaller may be a bit of bone in a thin part of the patient.
    """
    every, spacing = _coarse(volume, RIM)
    steps = tuple(slice(None, None, step) for step in every)
    dense = volume.voxels[steps] > PRESETS_HU["spongy-bone"][0]
    foreign = dense & ~_in_body(dense, body[steps]).mask
    runs = Runs.of(foreign, corners=True)
    runs.fill(foreign, runs.sizes * np.prod(spacing) <= 4 / 3 * np.pi * THICK**3, False)
    if foreign.any():
        reach = max(float(spacing.min()), min(RIM, RIM_VOXELS * min(volume.spacing_mm)))
        foreign = scipy.ndimage.distance_transform_edt(~foreign, spacing) <= reach
    return _fine(foreign, every, volume.shape)


def thick_components(mask: NDArray[np.bool_], volume: Volume) -> Components:
    """Keep the components that are thicker than twice `THICK` somewhere, as bodies are: a tenth of them at least."""
    every, spacing = _coarse(volume)
    coarse = mask[tuple(slice(None, None, step) for step in every)]
    return _in_body(mask, _fine(_opened(coarse, spacing), every, volume.shape))


def _in_body(mask: NDArray[np.bool_], body: NDArray[np.bool_]) -> Components:
    """Keep the components that lie in bodies by a tenth at least."""
    runs = Runs.of(mask, corners=True)
    return _kept(runs, runs.within([body]) >= LEAST * runs.sizes, mask)


@dataclass(frozen=True)
class Cleaned:
    """A window without specks and pores.

    Attributes
    ----------
    mask : (K, J, I) bool array
    specks, speck_voxels, largest_speck : int
        Components that were left out, their voxels, and those of the largest.
    pores, pore_voxels : int
        Enclosed holes that were filled.
    """

    mask: NDArray[np.bool_]
    specks: int = 0
    speck_voxels: int = 0
    largest_speck: int = 0
    pores: int = 0
    pore_voxels: int = 0


def without_specks(mask: NDArray[np.bool_], around: Box | None = None) -> Cleaned:
    """Leave out components that are specks, and fill enclosed holes as small as that (`SPECK`, `SMALL`).

    Components touch along faces, edges or at corners, and holes along faces: no voxel of a hole that is filled has a
    neighbor outside of the window but in the hole.

    Parameters
    ----------
    mask : (K, J, I) bool array
        One voxel at least.
    around : box, optional
        Outside of which nothing is true.
    """
    box = box_of(mask, around)
    pieces, holes = Runs.of(mask[box], corners=True), Runs.of(~RunMask.of([mask[box]]))
    sizes, room = pieces.sizes, holes.sizes
    limit = min(float(SPECK), SMALL * float(sizes.max()))
    small, pores = sizes < limit, ~holes.bordering & (room < limit)
    if not (small.any() or pores.any()):
        return Cleaned(mask)
    cleaned = np.zeros(mask.shape, np.bool_)
    cleaned[box] = mask[box]
    pieces.fill(cleaned[box], small, False)
    holes.fill(cleaned[box], pores, True)
    counts = (small.sum(), sizes[small].sum(), sizes[small].max(initial=0), pores.sum(), room[pores].sum())
    return Cleaned(cleaned, *map(int, counts))


def solid(body: NDArray[np.bool_], volume: Volume) -> NDArray[np.bool_]:
    """Fill what the air of the room does not reach in a body: lungs, airways, sinuses, bowels.

    The air of the room comes from the sides of the study, not from its ends along the patient, which may cut through
    lungs. It goes where a ball as thick as `THICK` can, and `DEEP` radii further.

    Parameters
    ----------
    body : (K, J, I) bool array
        What is denser than air, without the table.
    volume : Volume
        Its affine tells which of its axes is the patient's.
    """
    every, spacing = _coarse(volume)
    coarse = body[tuple(slice(None, None, step) for step in every)]
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
    open_, count = scipy.ndimage.label(_fine(apart <= (1 + DEEP) * radius, every, volume.shape) & ~body)
    reached = np.zeros(count + 1, np.bool_)
    reached[open_[_fine(apart <= radius, every, volume.shape)]] = True
    reached[0] = False
    return ~reached[open_]


def is_dense(mask: NDArray[np.bool_], volume: Volume) -> bool:
    """Tell whether over half of a window of a CT is as dense as a body; one of lungs or airways is not."""
    return bool(2 * np.count_nonzero(volume.voxels[mask] > PRESETS_HU["skin"][0]) > np.count_nonzero(mask))


def _kept(runs: Runs, kept: NDArray[np.bool_], mask: NDArray[np.bool_]) -> Components:
    found, left = len(kept), int(np.count_nonzero(kept))
    if left == found:
        return Components(mask, found, 0)
    some = mask.copy()
    runs.fill(some, ~kept, False)
    return Components(some, found, found - left)


def _body(volume: Volume) -> NDArray[np.bool_]:
    """Return the voxels (K, J, I) of bodies; found in coarse voxels, so that it costs little."""
    every, spacing = _coarse(volume)
    levels = volume.voxels[tuple(slice(None, None, step) for step in every)]
    return _fine(_opened(levels > PRESETS_HU["skin"][0], spacing), every, volume.shape)


def _coarse(volume: Volume, cell: float = CELL) -> tuple[list[int], NDArray[np.float64]]:
    """Return how many voxels (K, J, I) a coarse one is long, and its edges in mm."""
    spacing = np.array(volume.spacing_mm[::-1])
    cell = min(cell, float((spacing * volume.shape).max()) / CELLS)
    every = [max(1, int(cell / edge)) for edge in spacing]
    return every, spacing * every


def _fine(mask: NDArray[np.bool_], every: list[int], shape: tuple[int, int, int]) -> NDArray[np.bool_]:
    """Return a mask of coarse voxels in a study's own."""
    for axis, step in enumerate(every):
        mask = np.repeat(mask, step, axis=axis)
    return mask[tuple(slice(size) for size in shape)]


def _opened(mask: NDArray[np.bool_], spacing: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Take away what no ball fits into; what lies beyond the border counts as more of the same."""
    if mask.all():
        return mask
    depth = scipy.ndimage.distance_transform_edt(mask, spacing)
    radius = _radius(depth)
    return np.asarray(scipy.ndimage.distance_transform_edt(depth <= radius, spacing) <= radius)


def _radius(depth: NDArray[np.float64]) -> float:
    """Return the radius of the ball that tells thick from thin, by the depth of the thickest body."""
    return min(THICK, SHARE * float(depth.max()))
