"""DICOM: a folder of slices, or one file, to a volume."""

from __future__ import annotations

from .directory import index_in, is_index, read_index
from .files import dicom_among, is_dicom
from .read import list_stacks, read_dicom

__all__ = ["dicom_among", "index_in", "is_dicom", "is_index", "list_stacks", "read_dicom", "read_index"]
