"""Which components of a window are the patient, and which the scanner's table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import ndimage

from .window import PRESETS_HU

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
    labels, sizes = _components(mask)
    return _kept(labels, np.arange(len(sizes)) == np.argmax(sizes), mask)


def components_of_body(mask: NDArray[np.bool_], volume: Volume) -> Components:
    """Keep the components of a window of a CT that lie in a body: those of which a tenth at least does.

    A body is what is denser than air (the window `skin`) once all that is thinner than twice `THICK` is taken away,
    by opening with a ball. So it holds the bones under the skin, and a table's shells or a head's holder are no part
    of it, even where they touch the skin. What of them is joined to the patient within the window itself stays.

    Parameters
    ----------
    mask : (K, J, I) bool array
    volume : Volume
        Hounsfield units.
    """
    body = _body(volume)
    labels, sizes = _components(mask)
    within = np.bincount(labels[body], minlength=len(sizes))
    return _kept(labels, within >= LEAST * sizes, mask)


def is_dense(mask: NDArray[np.bool_], volume: Volume) -> bool:
    """Tell whether over half of a window of a CT is as dense as a body; one of lungs or airways is not."""
    return bool(2 * np.count_nonzero(volume.voxels[mask] > PRESETS_HU["skin"][0]) > np.count_nonzero(mask))


def _components(mask: NDArray[np.bool_]) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Return the numbers of components that touch along faces, edges or at corners, and their sizes, 0 for the rest."""
    labels, _ = ndimage.label(mask, np.ones((3, 3, 3), np.bool_))
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    return labels, np.asarray(sizes)


def _kept(labels: NDArray[Any], kept: NDArray[np.bool_], mask: NDArray[np.bool_]) -> Components:
    kept[0], found = False, len(kept) - 1
    left = int(np.count_nonzero(kept))
    return Components(mask if left == found else kept[labels], found, found - left)


def _body(volume: Volume) -> NDArray[np.bool_]:
    """Return the voxels (K, J, I) of bodies; found in coarse voxels, so that it costs little."""
    spacing = np.array(volume.spacing_mm[::-1])
    cell = min(CELL, float((spacing * volume.shape).max()) / CELLS)
    every = [max(1, int(cell / edge)) for edge in spacing]
    levels = volume.voxels[tuple(slice(None, None, step) for step in every)]
    body = _opened(levels > PRESETS_HU["skin"][0], spacing * every)
    for axis, step in enumerate(every):
        body = np.repeat(body, step, axis=axis)
    return body[tuple(slice(size) for size in volume.shape)]


def _opened(mask: NDArray[np.bool_], spacing: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Take away what no ball fits into; what lies beyond the border counts as more of the same."""
    if mask.all():
        return mask
    depth = ndimage.distance_transform_edt(mask, spacing)
    radius = min(THICK, SHARE * float(depth.max()))
    return np.asarray(ndimage.distance_transform_edt(depth <= radius, spacing) <= radius)
