"""Labels of a label map as a window."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import EmptyError, UsageError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..model.volume import Volume

NAMED = 24
"""Labels that are named where one is missing, at most."""
MOST = 4096
"""Labels over which a label map is doubted."""


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
