"""DICOM segmentations: one label map from the frames of all segments."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import EmptyError, FormatError, GeometryError
from ....model.volume import Volume
from ...files.limits import require_memory
from ...files.source import third_party
from ...names import shown
from ..headers.dataset import read_dataset
from ..headers.header import frames_of
from ..headers.identity import identity_of
from ..headers.values import numbers
from ..pixels.decoder import Decoder
from ..pixels.tables import PALETTE
from .lattice import lattice_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ....settings import ReadSettings
    from ..headers.header import ImageFrame

NAMED = 24
"""Segments that are named in a note or an error, at most, so that it stays one that is read."""
PAIRS = 4
"""Overlaps that are named, at most, for the same reason."""
LABELMAP = "LABELMAP"


@dataclass(frozen=True)
class Segmentation:
    """What the header of a segmentation says.

    Attributes
    ----------
    frames : list of ImageFrame
    segments : (f,) int64 array
        The segment of each frame; 0 where the pixels themselves are segment numbers.
    labels : dict of int to str
        What each segment is called.
    kind : str
        ``"BINARY"``, ``"FRACTIONAL"`` or ``"LABELMAP"``.
    full : int
        The pixel value that stands for 1 where the kind is ``"FRACTIONAL"``.
    background : int
        The pixel value of no segment.
    """

    frames: list[ImageFrame]
    segments: NDArray[np.int64]
    labels: dict[int, str]
    kind: str
    full: int
    background: int


def read_segmentation(path: Path, settings: ReadSettings, *, study: str, select: Sequence[int] | None = None) -> Volume:
    """Read a segmentation as a label map: the value of a voxel is the number of its segment.

    Parameters
    ----------
    path : Path
    settings : ReadSettings
    study : str
        The path as the user typed it.
    select : sequence of int, optional
        The segments that are wanted: only they are read, and they may overlap. A voxel of several of them gets the
        number of the smallest.

    Returns
    -------
    Volume
        From the first to the last slice that has a frame; slices without one are background.

    Raises
    ------
    FormatError
        For a broken file.
    GeometryError
        Where segments overlap and none was chosen, or the frames make no regular stack.
    EmptyError
        Where a segment that is wanted is not there, or empty.
    ResourceError
        Where the voxels do not fit into the memory.
    """
    found = _header(path)
    affine, levels = lattice_of(found.frames, settings, study=study)
    count = int(levels.max()) + 1
    top = max([*found.labels, int(found.segments.max())])
    dtype = np.dtype(np.uint8 if top <= np.iinfo(np.uint8).max and found.kind != LABELMAP else np.uint16)
    rows, columns = found.frames[0].size
    require_memory(count * rows * columns * dtype.itemsize, file=study)
    voxels = np.zeros((count, rows, columns), dtype)
    with Decoder() as decode:
        if found.kind == LABELMAP:
            notes = _copy(found, decode, levels, voxels, select)
        else:
            notes = _paint(found, decode, levels, voxels, select, study)
    _require(found, voxels, select, study)
    empty = count - len(np.unique(levels))
    notes += (f"slices that the file leaves out, taken as background: {empty}",) if empty else ()
    read = Volume.from_stored(voxels, affine, notes=(f"segments: {_named(found.labels)}", *notes))
    return replace(read, dicom=identity_of(found.frames[:1]))


def segments_of(path: Path) -> dict[int, str]:
    """Return what each segment of a segmentation is called, by its number.

    Raises
    ------
    FormatError
        For a broken file.
    """
    labels = _header(path).labels
    return {number: labels[number] for number in sorted(labels)}


def _header(path: Path) -> Segmentation:
    name = path.name
    with third_party("pydicom", name):
        header = read_dataset(path, stop_before_pixels=True)
        frames = frames_of(path, header)
        kind = str(header.get("SegmentationType", "")) or "missing"
        if kind not in ("BINARY", "FRACTIONAL", LABELMAP):
            raise FormatError("the segmentation is of an unknown type", file=name, found=f"SegmentationType = {kind}")
        if header.get("PhotometricInterpretation") == PALETTE:  # its colors are for the eye: the numbers are segments
            header.PhotometricInterpretation = "MONOCHROME2"
        described = [item for item in header.get("SegmentSequence") or [] if item.get("SegmentNumber") != 0]
        labels = {_number(item, "SegmentNumber", name): shown(item.get("SegmentLabel")) for item in described}
        segments = [0 if kind == LABELMAP else _segment_of(header, n, name) for n in range(len(frames))]
        full = _number(header, "MaximumFractionalValue", name) if kind == "FRACTIONAL" else 1
        background = int(header.get("PixelPaddingValue") or 0)
    return Segmentation(frames, np.array(segments), labels, kind, full, background)


def _segment_of(header: Any, number: int, name: str) -> int:
    """Return the segment that a frame is of."""
    for groups, place in (("PerFrameFunctionalGroupsSequence", number), ("SharedFunctionalGroupsSequence", 0)):
        items = header.get(groups)
        found = items[place].get("SegmentIdentificationSequence") if items else None
        if found:
            return _number(found[0], "ReferencedSegmentNumber", name)
    raise FormatError("a frame belongs to no segment", file=name, found=f"frame {number + 1}")


def _number(item: Any, keyword: str, name: str) -> int:
    value = numbers(item.get(keyword), 1, keyword, name)
    if value is None or not (1 <= value[0] <= np.iinfo(np.uint16).max and float(value[0]).is_integer()):
        found = "missing" if value is None else f"{value[0]:g}"
        raise FormatError("a number is invalid", file=name, found=f"{keyword} = {found}", expected="1 to 65535")
    return int(value[0])


def _copy(
    found: Segmentation, decode: Decoder, levels: NDArray[np.int64], voxels: NDArray[Any], select: Sequence[int] | None
) -> tuple[str, ...]:
    """Take pixels that are segment numbers; nothing is to be decided."""
    for frame, level in zip(found.frames, levels.tolist(), strict=True):
        labels = decode(frame)
        kept = labels != found.background if select is None else np.isin(labels, select)
        np.copyto(voxels[level], labels, where=kept, casting="unsafe")
    return ()


def _paint(
    found: Segmentation, decode: Decoder, levels: NDArray[np.int64], voxels: NDArray[Any],
    select: Sequence[int] | None, study: str,
) -> tuple[str, ...]:  # fmt: skip
    """Lay segment over segment, the largest first; return notes on what was decided."""
    wanted = np.flatnonzero(np.isin(found.segments, found.segments if select is None else select))
    size: Counter[int] = Counter()
    for n, mask in _masks(found, wanted.tolist(), decode):
        size[int(found.segments[n])] += int(np.count_nonzero(mask))
    order = sorted(wanted.tolist(), key=lambda n: (-size[int(found.segments[n])], int(found.segments[n])))
    overlaps: Counter[tuple[int, int]] = Counter()
    for n, mask in _masks(found, order, decode):
        plane, number = voxels[levels[n]], int(found.segments[n])
        under, counts = np.unique(plane[mask], return_counts=True)
        overlaps.update({(u, number): c for u, c in zip(under.tolist(), counts.tolist(), strict=True)})
        plane[mask] = number
    shared = {pair: count for pair, count in overlaps.items() if pair[0] not in (0, pair[1])}
    if shared and select is None:
        raise GeometryError(
            "segments overlap, so that they are no one label map",
            file=study,
            found=_overlapping(shared, found.labels),
            expected="one segment a voxel",
            hint="--select with those that are wanted: only they are read, and may overlap",
            flags=["--select"],
        )
    if found.kind == "FRACTIONAL":
        half = "FRACTIONAL: voxels of 0.5 and more belong to a segment"
        return half, *_told(shared, found.labels)
    return _told(shared, found.labels)


def _masks(found: Segmentation, order: list[int], decode: Decoder) -> Iterator[tuple[int, NDArray[np.bool_]]]:
    """Yield frames by their numbers, with the pixels that belong to their segments."""
    for n in order:
        yield n, decode(found.frames[n]) >= (found.full + 1) // 2


def _told(shared: dict[tuple[int, int], int], labels: dict[int, str]) -> tuple[str, ...]:
    return (f"segments overlap, the smallest wins: {_overlapping(shared, labels)}",) if shared else ()


def _overlapping(shared: dict[tuple[int, int], int], labels: dict[int, str]) -> str:
    ranked = sorted(shared.items(), key=lambda item: (-item[1], item[0]))
    words = [f"{_name(a, labels)} and {_name(b, labels)} in {count} voxels" for (a, b), count in ranked[:PAIRS]]
    return "; ".join(words) + ("; ..." if len(ranked) > PAIRS else "")


def _require(found: Segmentation, voxels: NDArray[Any], select: Sequence[int] | None, study: str) -> None:
    """Refuse to go on without a segment that is wanted."""
    missing = np.setdiff1d([number for number in select or () if number], np.unique(voxels)).tolist()
    if not missing:
        return
    hidden = [number for number in missing if number in found.segments]
    named = ", ".join(_name(number, found.labels) for number in hidden or missing)
    raise EmptyError(
        "a segment is empty, or wholly within smaller ones" if hidden else "the segmentation has no such segment",
        file=study,
        found=f"--select {named}",
        expected=f"segments among {_named(found.labels)}",
        hint="--select without it" if hidden else "",
    )


def _name(number: int, labels: dict[int, str]) -> str:
    return f"{number} {labels[number]}" if number in labels else str(number)


def _named(labels: dict[int, str]) -> str:
    words = [_name(number, labels) for number in sorted(labels)]
    return ", ".join(words[:NAMED]) + (", ..." if len(words) > NAMED else "")
