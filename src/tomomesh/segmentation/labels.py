"""Labels of a label map as a window."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.volume import Volume

MOST = 4096
"""Labels over which a label map is doubted. A warning's threshold, chosen: maps at hand have 2 to 54."""
HIGHEST_LABEL = 2**16
"""A volume with higher levels is no label map. Label maps have 8 or 16 bits."""
EVEN = 0.8
"""Share of equal neighbors, among those that are both over 0, from which levels are labels. Measured: 0.86 to 1.00 in
label maps, 0.03 to 0.22 in images."""


NEARLY = 1e-3
"""How far from a whole number a label may be: what 32-bit floats lose of 3 by interpolation is 1e-5 and less, and half
a label would be a mixture of two."""


def whole(labels: Volume) -> Volume:
    """Round labels that are nearly whole, as other programs' resampling leaves them (3.0000458), with a note.

    Parameters
    ----------
    labels : Volume

    Raises
    ------
    UsageError
        Where the volume is no label map; it shows the number that is furthest from a whole one.
    """
    voxels = labels.voxels
    if voxels.ndim != 3:
        raise _no_labels(f"{voxels.dtype}, {voxels.ndim - 2} layer(s)")
    if voxels.dtype.kind != "f":
        return labels
    rounded = np.rint(voxels)
    with np.errstate(invalid="ignore"):  # what is infinite is NaN off
        off = np.abs(voxels - rounded)
    worst = np.unravel_index(int(off.argmax()), off.shape)
    if not off[worst] < NEARLY:
        raise _no_labels(f"{voxels[worst]:.9g} among {voxels.dtype} numbers")
    if not off[worst]:
        return labels
    told = f"labels that are nearly whole, rounded: {int(np.count_nonzero(off))} voxels, as {voxels[worst]:.9g}"
    return replace(labels, voxels=rounded, notes=(*labels.notes, told))


def _no_labels(found: str) -> UsageError:
    return UsageError("the labels are no whole numbers", found=found, expected="a label map of one layer")


def doubted(labels: Volume, count: int) -> str:
    """Say why a volume of so many labels may be no label map: a study's gray levels can be taken for labels."""
    if labels.unit == "HU":
        return "labels were chosen in a study in Hounsfield units: --lower and --upper choose gray levels"
    if labels.voxels.dtype.kind == "f":
        return f"the label map holds {labels.voxels.dtype} numbers: it may be a study of gray levels"
    return f"the label map has {count} labels: it may be a study of gray levels" if count > MOST else ""


def labels_in(voxels: NDArray[Any]) -> dict[str, int]:
    """Count the voxels of each label over 0; nothing where the levels do not look like labels.

    Labels are whole numbers in flat regions: neighbors over 0 are mostly equal, which those of an image are not.

    Parameters
    ----------
    voxels : (K, J, I[, L]) array
    """
    if not (voxels.ndim == 3 and voxels.min() > -NEARLY and voxels.max() < HIGHEST_LABEL):
        return {}
    if voxels.dtype.kind == "f":
        rounded = np.rint(voxels)
        if not np.abs(voxels - rounded).max() < NEARLY:
            return {}
        voxels = rounded
    left, right = voxels[..., :-1], voxels[..., 1:]
    inside = (left > 0) & (right > 0)
    pairs = int(np.count_nonzero(inside))
    if np.count_nonzero((left == right) & inside) < EVEN * pairs:
        return {}
    counts = np.bincount(voxels.ravel().astype(np.int64))
    return {str(label): int(counts[label]) for label in np.flatnonzero(counts) if label > 0}
