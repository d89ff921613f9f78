"""One slice of one of three planes: its gray levels as they are, and where it lies in the patient."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.volume import AXES
from ..segmentation.slabwise.cut import HERE
from ..segmentation.survey import LETTERS
from .routes import get, levels
from .studies import opened_volume

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from starlette.responses import Response

    from ..model.volume import Volume
    from .session import Session

ALONG = 0.25
"""Cosine from which on a direction bears a patient axis's letter: some 75 degrees. Only letters depend on it."""
TYPES = {"b": np.uint8, "f2": np.float32, "u8": np.float64, "i8": np.float64, "f16": np.float64}
"""What kinds of numbers become that JavaScript has no arrays of."""


def axis_of(plane: str) -> int:
    """Return the axis of (K, J, I) across a plane.

    Raises
    ------
    ValueError
        For what is none.
    """
    return 2 - AXES.index(plane)


def _planes(session: Session) -> dict[str, Any]:
    """Tell what has to be known to draw slices, none of which waits for all voxels where they are short integers."""
    volume = opened_volume(session)
    low, high = _ends(volume)
    return {
        "planes": {name: _plane(volume, name) for name in AXES},
        "shape": list(volume.shape),
        "affine": volume.affine.tolist(),
        "layers": volume.layers,
        "labelled": session.opened.laid is not None,
        "unit": volume.unit,
        "lowest": low,
        "highest": high,
        "whole": volume.voxels.dtype.kind in "bui",
    }


def _ends(volume: Volume) -> tuple[float, float]:
    kind = volume.voxels.dtype
    if kind.kind in "ui" and kind.itemsize <= 2:
        return float(np.iinfo(kind).min), float(np.iinfo(kind).max)
    return HERE.of(volume.voxels).ends


def _plane(volume: Volume, name: str) -> dict[str, Any]:
    """Tell of a plane how many slices it has, and of its rows and columns how long a step is and where it leads."""
    across = axis_of(name)
    rows, columns = (axis for axis in range(3) if axis != across)
    spacing = volume.spacing_mm[::-1]
    return {
        "axis": across,
        "rows": rows,
        "columns": columns,
        "count": volume.shape[across],
        "size": [volume.shape[rows], volume.shape[columns]],
        "step_mm": spacing[across],
        "pixel_mm": [spacing[rows], spacing[columns]],
        "letters": {
            "rows": _ends_of(volume.affine[:3, 2 - rows]), "columns": _ends_of(volume.affine[:3, 2 - columns]),
        },
    }  # fmt: skip


def _ends_of(direction: NDArray[np.float64]) -> tuple[str, str]:
    """Return the letters of the patient's sides where a direction comes from and where it leads, the main one first."""
    cosines = direction / np.linalg.norm(direction)
    main = [axis for axis in np.argsort(-np.abs(cosines)) if abs(cosines[axis]) > ALONG]
    ends = [LETTERS[axis] if cosines[axis] > 0 else LETTERS[axis][::-1] for axis in main]
    return "".join(start for start, _ in ends), "".join(end for _, end in ends)


def _slice(session: Session, plane: str, k: str) -> Response:
    """Return the gray levels of a slice (rows, columns[, layers])."""
    return _cut(opened_volume(session), plane, k)


def _labels(session: Session, plane: str, k: str) -> Response:
    """Return the labels of a slice (rows, columns) of the map that lies over the study."""
    if session.opened.laid is None:
        raise LookupError(plane)
    return _cut(session.opened.laid, plane, k)


def _cut(volume: Volume, plane: str, k: str) -> Response:
    """Return the numbers of a slice, none but these copied."""
    voxels = volume.voxels
    across = np.moveaxis(voxels, axis_of(plane), 0)  # a view; `take` would copy all voxels where an axis is flipped
    found = across[_number(k, len(across))]
    kind = found.dtype
    return levels(found.astype(TYPES.get(kind.kind, TYPES.get(f"{kind.kind}{kind.itemsize}", kind)), copy=False))


def _number(k: str, count: int) -> int:
    number = int(k)
    if not 0 <= number < count:
        raise LookupError(number)
    return number


ROUTES = [get("/api/planes", _planes), get("/slice/{plane}/{k}", _slice), get("/labels/{plane}/{k}", _labels)]
