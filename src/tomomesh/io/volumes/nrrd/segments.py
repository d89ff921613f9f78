"""The segments that Slicer names in a NRRD file (``.seg.nrrd``): labels, or several layers of them that overlap."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ....errors import EmptyError, FormatError, GeometryError
from ....model.lazy import layer_of
from ...names import shown
from ..raster import at_once

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

FIELD = re.compile(r"Segment([0-9]{1,5})_(ID|Name|LabelValue|Layer)")
"""The keys that tell of a segment."""

NAMED = 24
"""Segments that are named at most, so that a note stays a line."""


@dataclass(frozen=True)
class Segment:
    """A segment: the voxels of a layer that have a value.

    Attributes
    ----------
    name : str
        Safe to show.
    layer, label : int
    """

    name: str
    layer: int
    label: int


def segments_in(pairs: Mapping[str, str], *, file: str) -> dict[int, Segment]:
    """Return the segments of a header by their numbers, none where it names none.

    A number is the label where no two segments share one, else the segment's place in the file, from 1. Before
    Slicer 4.11 layers and labels were not written: each segment had a layer, and the label 1.

    Parameters
    ----------
    pairs : mapping of str to str
        The keys and values of a header.

    Raises
    ------
    FormatError
        For a label or a layer that is no number.
    """
    told: dict[int, dict[str, str]] = {}
    for key, value in pairs.items():
        if found := FIELD.fullmatch(key):
            told.setdefault(int(found[1]), {})[found[2]] = value
    segments = [_segment(place, told[number], file) for place, number in enumerate(sorted(told))]
    labels = [segment.label for segment in segments]
    distinct = len(set(labels)) == len(labels)
    return dict(zip(labels if distinct else range(1, len(labels) + 1), segments, strict=True))


def _segment(place: int, told: Mapping[str, str], file: str) -> Segment:
    label, layer = (told.get(key, usual).strip() for key, usual in (("LabelValue", "1"), ("Layer", str(place))))
    if not (re.fullmatch("[0-9]{1,5}", label) and re.fullmatch("[0-9]{1,5}", layer)):
        found = f"LabelValue = {label[:20]}, Layer = {layer[:20]}"
        raise FormatError("a segment of the header has no number", file=file, found=found, expected="whole numbers")
    return Segment(shown(told.get("Name") or told.get("ID")), int(layer), int(label))


def label_map(
    layers: Any, segments: Mapping[int, Segment], select: Sequence[int] | None, *, file: str
) -> tuple[Any, tuple[str, ...]]:
    """Return the numbers of segments as voxels, (K, J, I).

    Parameters
    ----------
    layers : (K, J, I, layers) int array or LazyVoxels
    segments : mapping of int to Segment
    select : sequence of int or None
        Those that are wanted, which may overlap: the smaller wins. Others are not looked at.

    Raises
    ------
    FormatError
        Where a segment's layer is not there.
    GeometryError
        Where segments overlap, and none was chosen.
    EmptyError
        Where a segment that is wanted is not there.
    """
    notes = (f"segments: {_named(segments)}",)
    if layers.shape[3] == 1:
        return layer_of(layers, 0), notes
    beyond = [number for number, one in segments.items() if one.layer >= layers.shape[3]]
    if beyond:
        found = f"segment {beyond[0]} = layer {segments[beyond[0]].layer}, layers = {layers.shape[3]}"
        raise FormatError("a segment lies in a layer that is not there", file=file, found=found)
    missing = [number for number in select or () if number and number not in segments]
    if missing:
        found, expected = f"--select {missing[0]}", f"segments among {_named(segments)}"
        raise EmptyError("the segmentation has no such segment", file=file, found=found, expected=expected)
    layers = at_once(layers, file=file)
    wanted = [number for number in segments if select is None or number in select]
    voxels = np.zeros(layers.shape[:3], np.min_scalar_type(max(segments)))
    sizes = {number: int(np.count_nonzero(_mask(layers, segments[number]))) for number in wanted}
    for number in sorted(wanted, key=lambda number: -sizes[number]):
        mask = _mask(layers, segments[number])
        under = int(voxels.max(where=mask, initial=0))
        if under and select is None:
            raise _overlap(under, number, segments, file)
        voxels[mask] = number
    return voxels, notes


def _mask(layers: NDArray[Any], segment: Segment) -> NDArray[np.bool_]:
    return np.asarray(layers[..., segment.layer] == segment.label)


def _overlap(under: int, number: int, segments: Mapping[int, Segment], file: str) -> GeometryError:
    return GeometryError(
        "segments overlap, so that they are no one label map",
        file=file,
        found=f"{under} {segments[under].name} and {number} {segments[number].name}, of {_named(segments)}",
        expected="one segment a voxel",
        hint="--select with those that are wanted: only they are read, and may overlap",
        flags=["--select"],
    )


def _named(segments: Mapping[int, Segment]) -> str:
    words = [f"{number} {segment.name}" for number, segment in segments.items()]
    return ", ".join(words[:NAMED]) + (", ..." if len(words) > NAMED else "")
