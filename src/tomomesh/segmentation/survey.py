"""What is in a study, and what to do with it: the answer to ``tomomesh inspect``."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.volume import AXES
from .labels import labels_counted
from .otsu import REACH, otsu_levels
from .padding import padding_in
from .slabwise.cut import HERE
from .window import PRESETS_HU, beside, may_be_ct, otsu_in

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from ..model.boxes import Box
    from ..model.volume import Volume
    from .padding import Padding
    from .slabwise.cut import Cut
    from .slabwise.levels import Levels

BARS = 32
"""Bars of the printed histogram. A line of the terminal."""
LETTERS = (("R", "L"), ("A", "P"), ("I", "S"))
"""Ends of the patient axes, the negative first."""

CUT_OFF = 0.01
"""A window that takes more than this share of the study's first or last plane goes on beyond it. Only a remark depends
on it."""
OBLONG = 0.01
"""Part by which the sides of a pixel may differ without a remark. Only a remark depends on it."""
FAR = 4.0
"""How many times as wide as the bulk of the levels (`segmentation.slabwise.levels.TAILS`) their whole range is from
which on the histogram is that of the bulk. Only a picture depends on it: a quarter of the bars at least is its."""
AIR = PRESETS_HU["skin"][0]
"""Where 2 % of the levels are below this, those without a unit may be Hounsfield units. Only suggestions need it."""
THICK = 5
"""Pixels that slices may be apart without a remark. Only a remark depends on it: steps are then seen in a mesh."""


def survey(volume: Volume, bars: int | None = None) -> dict[str, Any]:
    """Describe a study without any patient data.

    Parameters
    ----------
    volume : Volume
        In memory; it is looked at slab by slab, and nothing of its size is made.
    bars : int, optional
        The most that the histogram may have, each as many levels wide where these are whole; 32 where not given.

    Returns
    -------
    dict
        Size, spacing, frame, tilt, the range and histogram of the gray levels, suggested windows and the share of the
        voxels in each, the labels of a label map, the reader's notes, and remarks on what a mesh of it will show.
    """
    cut = HERE.of(volume.voxels)
    padded = padding_in(cut, volume.padding, guessed=True)
    measured = cut.levels if padded is None else beside(cut, padded)
    low, high = _drawn_from(measured)
    lowest, highest = cut.ends
    return {
        "slices_rows_columns": list(volume.shape),
        "layers": volume.layers,
        "spacing_mm": list(volume.spacing_mm),
        "slice_distance_mm": volume.slice_distance_mm,
        "tilt_deg": _tilt(volume),
        "stored_plane": AXES[volume.stored_axis],
        "default_plane": AXES[volume.thickest_axis()],
        "stored_axes": _stored_axes(volume),
        "corner_mm": volume.affine[:3, 3].tolist(),
        "affine": volume.affine.tolist(),
        "size_mm": (np.array(volume.spacing_mm) * volume.shape[::-1]).tolist(),
        "type": str(volume.voxels.dtype),
        "gray_unit": volume.unit,
        "lowest": lowest,
        "highest": highest,
        "histogram": measured.histogram(low, high, _bars(volume, high - low, bars)).tolist()
        if high > low
        else [measured.size],
        "histogram_from": low,
        "histogram_to": high,
        "windows": _windows(volume, cut, measured, padded),
        "labels": labels_counted(cut),
        "notes": list(volume.notes),
        "remarks": list(_remarks(volume, cut, padded)),
    }


def _tilt(volume: Volume) -> float:
    """Return the angle between the way from slice to slice, as they are stored, and their normal."""
    columns, rows, step = volume.grid.affine[:3, :3].T
    normal = np.cross(columns, rows)
    cosine = abs(step @ normal) / np.linalg.norm(step) / np.linalg.norm(normal)
    return float(np.degrees(np.arccos(min(1.0, cosine))))


def _drawn_from(measured: Levels) -> tuple[float, float]:
    """Return the range of the histogram: all levels, unless a few far ones would leave the others too few bars."""
    (low, high), (first, last) = measured.ends, measured.bulk()
    reach = REACH * (last - first)
    first, last = max(low, first - reach), min(high, last + reach)
    return (first, last) if 0 < FAR * (last - first) < high - low else (low, high)


def _bars(volume: Volume, reach: float, most: int | None) -> int:
    """Return how many bars a histogram has."""
    whole = volume.voxels.dtype.kind in "bui" and reach > 1
    return BARS if most is None else int(reach // math.ceil(reach / most)) if whole else most


def _windows(volume: Volume, cut: Cut, measured: Levels, padded: Padding | None) -> dict[str, dict[str, Any]]:
    """Suggest windows: Otsu's, those above three and four classes, and for what may be a CT the presets."""
    limits: dict[str, Any] = {"otsu": otsu_in(cut, padded)}
    if volume.layers == 1:
        for classes in (3, 4):
            limit = otsu_levels(measured, classes)[-1]
            limits |= {} if limit in limits.values() else {f"otsu of {classes}": limit}
    windows = {name: (limit, np.inf) for name, limit in limits.items()}
    ct = may_be_ct(volume, cut.ends[0]) and (volume.unit == "HU" or measured.bulk()[0] < AIR)
    windows |= PRESETS_HU if ct else {}
    taken = _taken(volume, cut, [*windows.values()])
    planes = {LETTERS[axis][end]: np.moveaxis(volume.voxels, 2 - axis, 0)[end] for axis in (2, 1, 0) for end in (0, -1)}
    pairs = zip(windows.items(), taken, strict=True)
    return {name: _window(planes, *bounds, share) for (name, bounds), share in pairs}


def _taken(volume: Volume, cut: Cut, windows: Sequence[tuple[Any, float]]) -> list[float]:
    """Return the shares of the levels in some windows, whose lower bounds are one a layer in a study in color."""
    if volume.layers == 1:
        found = np.array(cut.levels.within(windows))
    else:
        layers = range(volume.layers)
        found = np.sum([cut.layer(n).within([(low[n], high) for low, high in windows]) for n in layers], axis=0)
    return list((found / math.prod(volume.voxels.shape)).tolist())


def _window(planes: dict[str, NDArray[Any]], lower: Any, upper: float, share: float) -> dict[str, Any]:
    """Tell of a window, and at which ends of the study, whose planes these are, it is cut off."""
    inside = {end: (plane > lower) & (plane <= upper) for end, plane in planes.items()}
    cut = [end for end, held in inside.items() if held.mean() > CUT_OFF]
    return {"lower": _finite(lower), "upper": _finite(upper), "share": share, "cut_off_at": cut}


def _finite(limit: Any) -> Any:
    """Return a limit, or one a layer, with None where there is none."""
    found = [value if np.isfinite(value) else None for value in np.ravel(limit).tolist()]
    return found if np.ndim(limit) else found[0]


def _remarks(volume: Volume, cut: Cut, padded: Padding | None) -> Iterator[str]:
    """Say what a mesh of the study will show that nobody may expect."""
    if padded is not None:
        lows, highs, counts = zip(*cut.each(partial(_padding_of, padded=padded)), strict=True)
        low, high = min(lows), max(highs)
        levels = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        share = sum(counts) / math.prod(volume.voxels.shape)
        yield f"{share:.1%} of the voxels are padding, {levels}: it counts as background"
    columns, rows, step = np.sqrt((volume.grid.affine[:3, :3] ** 2).sum(axis=0))
    if abs(columns - rows) > OBLONG * min(columns, rows):
        yield f"pixels are not square, {columns:.4g} x {rows:.4g} mm: the mesh keeps the distances"
    apart = step / max(columns, rows)
    if apart > THICK:
        yield f"slices are {apart:.1f} pixels apart: what lies between them is interpolated"
    if 1 in volume.shape:
        yield "one slice: the mesh will be a slab of its thickness"


def _padding_of(levels: NDArray[Any], box: Box, *, padded: Padding) -> tuple[float, float, int]:
    """Return the lowest and the highest level of the padding of a slab, and how many voxels it takes."""
    held = levels[padded.within(levels, box)]
    return (float(held.min()), float(held.max()), held.size) if held.size else (np.inf, -np.inf, 0)


def _stored_axes(volume: Volume) -> str:
    """Return the directions in which the stored columns, rows and slices run, as ``LPS``."""
    letters = {}
    for n in range(3):
        letters[volume.grid.axes[n]] = LETTERS[2 - n][0 if volume.grid.flipped[n] else 1]
    return "".join(letters[axis] for axis in (2, 1, 0))
