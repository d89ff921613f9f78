"""What a DICOM file holds, where it is no image."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...errors import TomomeshError
from ..source import third_party
from .dataset import read_dataset

if TYPE_CHECKING:
    from pathlib import Path

SEGMENTATIONS = ("1.2.840.10008.5.1.4.1.1.66.4", "1.2.840.10008.5.1.4.1.1.66.7")
"""Storage classes of segmentations: bits a segment, and one label a voxel (supplement 243)."""

STRUCTURES = "1.2.840.10008.5.1.4.1.1.481.3"
"""The storage class of RT Structure Sets."""


def storage_class(path: Path) -> str:
    """Return what a DICOM file says that it holds, as a UID; empty where it says nothing.

    Raises
    ------
    FormatError
        Where the file cannot be read.
    """
    with third_party("pydicom", path.name):
        header = read_dataset(path, specific_tags=["SOPClassUID"], stop_before_pixels=True)
        return str(header.get("SOPClassUID") or header.file_meta.get("MediaStorageSOPClassUID") or "")


def is_segmentation(path: Path) -> bool:
    """Tell whether a DICOM file is a segmentation; one that cannot be read is none."""
    try:
        return storage_class(path) in SEGMENTATIONS
    except TomomeshError:
        return False
