"""What a DICOM file holds, where it is no image."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ....errors import TomomeshError
from ...files.source import third_party
from .dataset import read_dataset

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

SEGMENTATIONS = ("1.2.840.10008.5.1.4.1.1.66.4", "1.2.840.10008.5.1.4.1.1.66.7")
"""Storage classes of segmentations: bits a segment, and one label a voxel (supplement 243)."""

STRUCTURES = "1.2.840.10008.5.1.4.1.1.481.3"
"""The storage class of RT Structure Sets."""

SEGMENTED, CONTOURS, WITHOUT_PIXELS = "segmentations", "RT Structure Sets", "DICOM without pixels"
"""What is passed over among slices."""


def storage_class(path: Path) -> str:
    """Return what a DICOM file says that it holds, as a UID; empty where it says nothing.

    Raises
    ------
    FormatError
        Where the file cannot be read.
    """
    with third_party("pydicom", path.name):
        return class_of(read_dataset(path, specific_tags=["SOPClassUID"], stop_before_pixels=True))


def class_of(header: Any) -> str:
    """Return the storage class of a header that was read."""
    return str(header.get("SOPClassUID") or header.file_meta.get("MediaStorageSOPClassUID") or "")


def lone_object(paths: Iterable[Path]) -> Path | None:
    """Return the only segmentation of some files without other images, or else the only RT Structure Set.

    Headers are read up to the first image.
    """
    found: dict[str, list[Path]] = {}
    for path in paths:
        try:
            with third_party("pydicom", path.name):
                header = read_dataset(path, specific_tags=["SOPClassUID", "Rows"], stop_before_pixels=True)
        except TomomeshError:
            return None
        reason = no_image(header)
        if reason is None:
            return None
        found.setdefault(reason, []).append(path)
    wanted = found.get(SEGMENTED) or found.get(CONTOURS) or []
    return wanted[0] if len(wanted) == 1 else None


def no_image(header: Any) -> str | None:
    """Say in the plural what a header is of, where it is no slice of a study; None where it is one."""
    kind = class_of(header)
    if kind in SEGMENTATIONS:
        return SEGMENTED
    if kind == STRUCTURES:
        return CONTOURS
    return None if "Rows" in header else WITHOUT_PIXELS


def is_segmentation(path: Path) -> bool:
    """Tell whether a DICOM file is a segmentation; one that cannot be read is none."""
    try:
        return storage_class(path) in SEGMENTATIONS
    except TomomeshError:
        return False
