"""Labels of a label map as a window."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import EmptyError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..model.volume import Volume

NAMED = 24
"""Labels that are named where one is missing, at most. So that an error stays a line."""
MOST = 4096
"""Labels over which a label map is doubted. A warning's threshold, chosen: maps at hand have 2 to 54."""
HIGHEST_LABEL = 2**16
"""A volume with higher levels is no label map. Label maps have 8 or 16 bits."""
EVEN = 0.8
"""Share of equal neighbors, among those that are both over 0, from which levels are labels. Measured: 0.86 to 1.00 in
label maps, 0.03 to 0.22 in images."""


def select(labels: Volume, wanted: Sequence[int]) -> NDArray[np.bool_]:
    """Keep the voxels of some labels.

    Parameters
    ----------
    labels : Volume
        Whole numbers, one layer.
    wanted : sequence of int

    Returns
    -------
    (K, J, I) bool array

    Raises
    ------
    UsageError
        Where the volume is no label map.
    EmptyError
        Where it lacks a label; names those that it has.
    """
    voxels = labels.voxels
    if voxels.ndim != 3 or (voxels.dtype.kind == "f" and not (voxels == np.rint(voxels)).all()):
        raise UsageError(
            "the labels are no whole numbers", found=f"{voxels.dtype}, {voxels.ndim - 2} layer(s)",
            expected="a label map of one layer",
        )  # fmt: skip
    present = np.unique(voxels).astype(np.int64)
    missing = np.setdiff1d(wanted, present)
    if len(missing):
        named = ", ".join(map(str, present[:NAMED])) + (", ..." if len(present) > NAMED else "")
        raise EmptyError(
            "the label map has no such label", found=f"--select = {', '.join(map(str, missing))}",
            expected=f"labels among {named}",
        )  # fmt: skip
    return np.ascontiguousarray(np.isin(voxels, wanted))


def doubted(labels: Volume) -> str:
    """Say why a volume may be no label map: a study's gray levels can be taken for labels."""
    voxels = labels.voxels
    if labels.unit == "HU":
        return "labels were chosen in a study in Hounsfield units: --lower and --upper choose gray levels"
    if voxels.dtype.kind == "f":
        return f"the label map holds {voxels.dtype} numbers: it may be a study of gray levels"
    count = len(np.unique(voxels))
    return f"the label map has {count} labels: it may be a study of gray levels" if count > MOST else ""


def labels_in(voxels: NDArray[Any]) -> dict[str, int]:
    """Count the voxels of each label over 0; nothing where the levels do not look like labels.

    Labels are whole numbers in flat regions: neighbors over 0 are mostly equal, which those of an image are not.

    Parameters
    ----------
    voxels : (K, J, I[, L]) array
    """
    whole = voxels.ndim == 3 and voxels.min() >= 0 and voxels.max() < HIGHEST_LABEL
    if not whole or (voxels.dtype.kind == "f" and not np.array_equal(voxels, np.rint(voxels))):
        return {}
    left, right = voxels[..., :-1], voxels[..., 1:]
    inside = (left > 0) & (right > 0)
    pairs = int(np.count_nonzero(inside))
    if np.count_nonzero((left == right) & inside) < EVEN * pairs:
        return {}
    counts = np.bincount(voxels.ravel().astype(np.int64))
    return {str(label): int(counts[label]) for label in np.flatnonzero(counts) if label > 0}
