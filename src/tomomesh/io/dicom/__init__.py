"""DICOM: a folder of slices, or one file, to a volume."""

from __future__ import annotations

from .directory import GONE, index_in, indexed, is_index, read_index
from .files import NOT_DICOM, dicom_among, is_dicom
from .headers.kinds import is_segmentation, lone_object
from .read import list_stacks, read_dicom
from .series.listing import Listing, Series, list_dicom

__all__ = [
    "GONE",
    "NOT_DICOM",
    "Listing",
    "Series",
    "dicom_among",
    "index_in",
    "indexed",
    "is_dicom",
    "is_index",
    "is_segmentation",
    "list_dicom",
    "list_stacks",
    "lone_object",
    "read_dicom",
    "read_index",
]
