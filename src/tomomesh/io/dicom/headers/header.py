"""What the headers of DICOM files say of each slice."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ....errors import FormatError
from ...files.limits import require_rows
from ...files.source import third_party
from ...volumes.gray import check_scale
from .kinds import class_of
from .multiframe import DOSE, PER_FRAME, SHARED, dose_scale, frame_places, has_places
from .values import numbers

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

GROUPS = {
    "ImagePositionPatient": "PlanePositionSequence",
    "ImageOrientationPatient": "PlaneOrientationSequence",
    "PixelSpacing": "PixelMeasuresSequence",
    "RescaleSlope": "PixelValueTransformationSequence",
    "RescaleIntercept": "PixelValueTransformationSequence",
    "RescaleType": "PixelValueTransformationSequence",
    "StackID": "FrameContentSequence",
}
"""The functional group of an enhanced file that holds each field of a plain one."""

VOLUME_GROUPS = {
    "ImagePositionPatient": ("PlanePositionVolumeSequence", "ImagePositionVolume"),
    "ImageOrientationPatient": ("PlaneOrientationVolumeSequence", "ImageOrientationVolume"),
}
"""Where a volume of ultrasound keeps the same: in its transducer's own frame."""


@dataclass(frozen=True)
class ImageFrame:
    """One slice: where it is, and how its stored numbers become gray levels.

    Attributes
    ----------
    path : Path
        Its file.
    number : int
        Its place within the file, from 0.
    header : pydicom Dataset
        The file's header, without pixels.
    size : (rows, columns)
        In pixels.
    position : (3,) float array or None
        Center of the first pixel, millimeters, LPS.
    axes : (2, 3) float array or None
        Directions in which the column and the row number rise.
    spacing : (2,) float array or None
        Distance of the columns and of the rows, mm.
    scale : (slope, intercept)
        Of the gray levels.
    stack : str
        Which of the stacks of an enhanced file it belongs to.
    rescale_type : str
        What its scale gives; empty where it does not say.
    """

    path: Path
    number: int
    header: Any
    size: tuple[int, int]
    position: NDArray[np.float64] | None
    axes: NDArray[np.float64] | None
    spacing: NDArray[np.float64] | None
    scale: tuple[float, float]
    stack: str = ""
    rescale_type: str = ""

    @property
    def padding(self) -> tuple[float, float] | None:
        """First and last decoded number that stand for nothing measured; None where the header names none."""
        header, inverted = self.header, self.header.get("PhotometricInterpretation") == "MONOCHROME1"
        kind = next((kind for kind in ("Float", "DoubleFloat", "") if f"{kind}PixelPaddingValue" in header), "")
        first = header.get(f"{kind}PixelPaddingValue")
        last = header.get(f"{kind}PixelPaddingRangeLimit", first)
        gray = inverted or header.get("PhotometricInterpretation") == "MONOCHROME2"
        if (
            not gray
            or "ModalityLUTSequence" in header
            or not all(isinstance(end, (int, float)) for end in (first, last))
        ):
            return None
        signed, turned = header.get("PixelRepresentation"), inverted and header.get("Modality") != "CT"
        if kind:
            return (-first, -last) if turned else (first, last)
        whole = 2 ** int(header.get("BitsAllocated") or 16)
        lowest = -whole // 2 if signed else 0
        # some write the bits of a negative number as a positive one
        ends = [(int(end) - lowest) % whole + lowest for end in (first, last)]
        if turned:
            ends = [(-1 if signed else 2 ** int(header.get("BitsStored") or 16) - 1) - end for end in ends]
        return ends[0], ends[1]

    @property
    def instance(self) -> int | None:
        """The number of the slice within its series, for files without positions."""
        value = numbers(self.header.get("InstanceNumber"), 1, "InstanceNumber", self.path.name)
        if value is None:
            return self.number if "NumberOfFrames" in self.header else None
        return int(value[0]) + self.number


def frames_of(path: Path, header: Any) -> list[ImageFrame]:
    """Return one frame for a plain file, and all of an enhanced or multi-frame file.

    Raises
    ------
    FormatError
        For fields that are no numbers, too short or too long, or of no meaning.
    """
    with third_party("pydicom", path.name):
        count = _count(header, "NumberOfFrames", path.name, missing=1)
        require_rows(count, path.stat().st_size, "frames of a byte", file=path.name)
        per_frame, shared = header.get(PER_FRAME) or [], header.get(SHARED) or []
        if len(per_frame) not in (0, count):
            raise FormatError(
                "the frames do not match their descriptions",
                file=path.name,
                found=f"NumberOfFrames = {count}, descriptions = {len(per_frame)}",
            )
        groups = [[*per_frame[number : number + 1], *shared[:1]] for number in range(count)]
        frames = [_frame(path, header, number, groups[number]) for number in range(count)]
        if has_places(header) or not frames:
            return frames
        places = frame_places(header, count, frames[0].position, frames[0].axes, path.name)
        return [replace(frame, position=place) for frame, place in zip(frames, places, strict=True)]


def _frame(path: Path, header: Any, number: int, groups: list[Any]) -> ImageFrame:
    name = path.name

    def field(keyword: str, count: int) -> NDArray[np.float64] | None:
        return numbers(_find(header, groups, keyword), count, keyword, name)

    axes, spacing = field("ImageOrientationPatient", 6), field("PixelSpacing", 2)
    slope, intercept = field("RescaleSlope", 1), field("RescaleIntercept", 1)
    scale = (1.0 if slope is None else float(slope[0]), 0.0 if intercept is None else float(intercept[0]))
    scale = dose_scale(header, name) if class_of(header) == DOSE else scale
    check_scale(*scale, file=name)
    return ImageFrame(
        path,
        number,
        header,
        (_count(header, "Rows", name), _count(header, "Columns", name)),
        field("ImagePositionPatient", 3),
        None if axes is None else axes.reshape(2, 3),
        None if spacing is None else spacing[::-1],  # stored: rows first
        scale,
        str(_find(header, groups, "StackID") or ""),
        str(_find(header, groups, "RescaleType") or ""),
    )


def _find(header: Any, groups: list[Any], keyword: str) -> Any:
    """Return a field of a frame: from its own functional groups, those of all frames, the header, or its detector."""
    for group in groups:
        for sequence, inner in ((GROUPS[keyword], keyword), VOLUME_GROUPS.get(keyword, ("", ""))):
            items = group.get(sequence) if sequence else None
            if items and inner in items[0]:
                return items[0].get(inner)
    detector = header.get("DetectorInformationSequence") or []
    return header.get(keyword, detector[0].get(keyword) if detector else None)


def _count(header: Any, keyword: str, name: str, missing: int = 0) -> int:
    value = numbers(header.get(keyword), 1, keyword, name)
    count = missing if value is None else value[0]
    if not (count >= 1 and float(count).is_integer()):
        raise FormatError("a size is invalid", file=name, found=f"{keyword} = {count:g}", expected="at least 1")
    return int(count)
