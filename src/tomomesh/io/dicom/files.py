"""Which of some files hold images, and which are broken."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ...errors import FormatError, TomomeshError, UnreadableError
from ..files.source import first_bytes, third_party
from .headers.dataset import read_dataset
from .headers.header import ImageFrame, frames_of
from .headers.kinds import no_image

if TYPE_CHECKING:
    from pathlib import Path

FIELDS = (
    "BitsStored", "ImageType", "InstanceNumber", "Modality", "PhotometricInterpretation", "SeriesDescription",
    "SeriesInstanceUID", "SeriesNumber",
)  # fmt: skip
"""Fields that are looked at later on."""

NOT_DICOM = "not DICOM"


@dataclass
class Reading:
    """What some files hold.

    Attributes
    ----------
    frames : list of ImageFrame
        The slices of all images.
    others : Counter
        How many files are no images, by reason.
    bad : dict
        The files that are broken, with the error of each.
    """

    frames: list[ImageFrame] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)
    bad: dict[Path, TomomeshError] = field(default_factory=dict)


def is_dicom(path: Path) -> bool:
    """Tell from a file's first bytes whether it is DICOM, with or without its preamble.

    Raises
    ------
    UnreadableError
        Where the file may not be read.
    """
    start = first_bytes(path, 132)
    return start[128:] == b"DICM" or (
        start[:2] in (b"\x02\x00", b"\x08\x00") and start[3:4] == b"\0" and len(start) == 132
    )


def dicom_among(paths: list[Path]) -> list[Path]:
    """Return the files that are DICOM, and those of which nobody can tell: `read_frames` finds them broken."""
    return [path for path in paths if _may_be_dicom(path)]


def _may_be_dicom(path: Path) -> bool:
    try:
        return is_dicom(path)
    except UnreadableError:
        return True


def read_frames(paths: list[Path]) -> Reading:
    """Read the headers of the images among some files, each once; nothing is raised for a broken one."""
    reading = Reading()
    for path in paths:
        try:
            header = _read_header(path) if is_dicom(path) else None
            reason = NOT_DICOM if header is None else no_image(header)
            if reason is None:
                reading.frames += frames_of(path, header)
            else:
                reading.others[reason] += 1
        except (FormatError, UnreadableError) as fault:
            reading.bad[path] = fault
    return reading


def _read_header(path: Path) -> Any:
    with third_party("pydicom", path.name):
        header = read_dataset(path, stop_before_pixels=True)
        for keyword in FIELDS:  # values are converted when they are first asked for, and may fail then
            header.get(keyword)
        kind = header.get("SOPClassUID") or header.file_meta.get("MediaStorageSOPClassUID")
    if "Image Storage" in str(getattr(kind, "name", "")) and not _is_image(header):
        raise FormatError(
            "the DICOM file is cut off",
            file=path.name,
            found="Rows, Columns = missing",
            expected="a whole header",
            hint="the folder without this file, or a fresh copy",
        )
    return header


def _is_image(header: Any) -> bool:
    return "Rows" in header and "Columns" in header
