"""What is in a study: the answer to ``tomomesh inspect``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.volume import AXES
from .window import PRESETS_HU, histogram, otsu_thresholds

if TYPE_CHECKING:
    from ..model.volume import Volume

BARS = 32
"""Bars of the printed histogram."""
LETTERS = (("R", "L"), ("A", "P"), ("I", "S"))
"""Ends of the patient axes, the negative first."""


def survey(volume: Volume) -> dict[str, Any]:
    """Describe a study without any patient data.

    Parameters
    ----------
    volume : Volume

    Returns
    -------
    dict
        Size, spacing, frame, the range and histogram of the gray levels, suggested windows, the reader's notes.
    """
    voxels = volume.voxels
    low, high = float(voxels.min()), float(voxels.max())
    otsu = np.asarray(otsu_thresholds(volume)).tolist()
    windows = {"otsu": [otsu if volume.layers == 1 else [_finite(one) for one in otsu], None]}
    if low < 0:
        windows |= {name: [lower, None] for name, (lower, _) in PRESETS_HU.items()}
    return {
        "slices_rows_columns": list(volume.shape),
        "layers": volume.layers,
        "spacing_mm": list(volume.spacing_mm),
        "stored_plane": AXES[volume.stored_axis],
        "default_plane": AXES[volume.thickest_axis()],
        "stored_axes": _stored_axes(volume),
        "corner_mm": volume.affine[:3, 3].tolist(),
        "size_mm": (np.array(volume.spacing_mm) * volume.shape[::-1]).tolist(),
        "type": str(voxels.dtype),
        "gray_unit": volume.unit,
        "lowest": low,
        "highest": high,
        "histogram": histogram(voxels, low, high, BARS).tolist() if high > low else [voxels.size],
        "windows": windows,
        "notes": list(volume.notes),
    }


def _finite(limit: float) -> float | None:
    return limit if np.isfinite(limit) else None


def _stored_axes(volume: Volume) -> str:
    """Return the directions in which the stored columns, rows and slices run, as ``LPS``."""
    letters = {}
    for n in range(3):
        letters[volume.grid.axes[n]] = LETTERS[2 - n][0 if volume.grid.flipped[n] else 1]
    return "".join(letters[axis] for axis in (2, 1, 0))
