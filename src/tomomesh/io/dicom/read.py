"""A DICOM study from its files to a volume."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FormatError, GeometryError
from ...model.volume import Volume
from ..gray import native, scaled, scaled_dtype, without_holes
from ..limits import require_memory
from ..source import counted
from .header import TELLING, frames_of, read_headers
from .pixels import Decoder
from .series import choose, stacks_among
from .stack import Stack, stacked

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...settings import ReadSettings
    from .header import Frame


def read_dicom(files: list[Path], settings: ReadSettings, *, study: str, others: Counter[str] | None = None) -> Volume:
    """Read one series of slices.

    Parameters
    ----------
    files : list of Path
        Files in any order; those that are no images are left out and counted.
    settings : ReadSettings
        `series`, `spacing`, `spacing_z` and `fill_gaps` decide what the files leave open.
    study : str
        The path as the user typed it.
    others : Counter, optional
        Entries of the folder that were passed over before, by reason.

    Returns
    -------
    Volume
        In patient millimeters, with the shear of a tilted gantry; HU where the study is CT.

    Raises
    ------
    FormatError
        For files without images, and files that are broken.
    GeometryError
        Where the slices do not make one regular stack.
    ResourceError
        Where the voxels do not fit into the memory.
    """
    headers, more = read_headers(files)
    passed = (others or Counter()) + more
    if not headers:
        count = len(files) + sum((others or Counter()).values())
        raise FormatError(
            f"0 of {count} files are images", file=study, found=counted(passed), expected="a DICOM series"
        )
    frames = [frame for path, header in headers for frame in frames_of(path, header)]
    choice = choose(frames, settings.series, folder=study)
    stack = stacked(choice.frames, settings, study=study)
    voxels, notes = _gray(stack, study)
    left = (f"left out: {counted(passed)}",) if passed else ()
    header = choice.frames[0].header
    inverted = header.get("PhotometricInterpretation") == "MONOCHROME1"
    unit = "HU" if header.get("Modality") == "CT" else "stored"
    turned = ("MONOCHROME1: gray levels were inverted" if unit != "HU" else "MONOCHROME1: HU were kept",)
    notes = left + choice.notes + stack.notes + notes + (turned if inverted else ())
    return Volume.from_stored(voxels, stack.affine, unit=unit, notes=notes)


def list_stacks(files: list[Path]) -> list[int]:
    """Return the numbers of the series among some files that could be a study each, for ``ReadSettings.series``.

    Raises
    ------
    FormatError
        For a DICOM file that is broken.
    """
    headers, _ = read_headers(files)
    return stacks_among([frame for path, header in headers for frame in frames_of(path, header)])


def _gray(stack: Stack, study: str) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Return gray levels (K, J, I[, 3]), slices between the levels interpolated."""
    decode, repeats = Decoder(), 0
    first = native(decode(stack.places[0][0]), file=study)
    frames = [frame for place in stack.places for frame in place]
    dtype = scaled_dtype(first.dtype, [frame.scale for frame in frames], _bits(frames[0]))
    count = int(stack.levels[-1]) + 1
    require_memory(count * first.size * dtype.itemsize, file=study)
    voxels = np.empty((count, *first.shape), dtype)
    below: NDArray[Any] | None = None
    for n, place in enumerate(stack.places):
        here = _slice(decode, place, first, dtype)
        repeats += len(place) - 1
        if below is not None:
            _fill(voxels, below, here, stack.levels[n - 1], stack.levels[n])
        if stack.levels[n].is_integer():
            voxels[int(stack.levels[n])] = here
        below = here
    note = (f"slices that repeat another, left out: {repeats}",) if repeats else ()
    voxels, holes = without_holes(voxels, file=study)
    return voxels, note + holes


def _bits(frame: Frame) -> int:
    return int(frame.header.get("BitsStored") or 64)


def _slice(decode: Decoder, place: list[Frame], first: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return the gray levels of the slice at a position.

    Raises
    ------
    GeometryError
        Where several slices are there, and differ.
    """
    slices = []
    for frame in place:
        stored = native(decode(frame), file=frame.path.name)
        if stored.shape != first.shape or stored.dtype != first.dtype:
            raise FormatError(
                "the slice is of another kind than the others",
                file=frame.path.name,
                found=f"pixels = {stored.dtype}{stored.shape}",
                expected=f"{first.dtype}{first.shape}",
            )
        slices.append(scaled(stored, *frame.scale, dtype))
    for frame, other in zip(place[1:], slices[1:], strict=True):
        if not np.array_equal(slices[0], other):
            raise GeometryError(
                "different slices are at the same position",
                file=frame.path.name,
                found=_difference(place[0], frame),
                expected="one slice a position",
                hint="a folder with one of them",
            )
    return slices[0]


def _difference(a: Frame, b: Frame) -> str:
    """Name the field in which two headers differ."""
    for keyword in TELLING:
        one, other = a.header.get(keyword), b.header.get(keyword)
        if one != other:
            return f"{keyword} = {one} and {other}"
    return "PixelData"


def _fill(voxels: NDArray[Any], below: NDArray[Any], above: NDArray[Any], low: float, high: float) -> None:
    """Interpolate the slices strictly between two levels."""
    for k in range(int(np.floor(low)) + 1, int(np.ceil(high))):
        share = (k - low) / (high - low)
        between = (1 - share) * below.astype(np.float64) + share * above.astype(np.float64)
        voxels[k] = np.rint(between) if voxels.dtype.kind in "iu" else between
