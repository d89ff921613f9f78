"""DICOM: a folder of slices, or one file, to a volume."""

from __future__ import annotations

from .header import is_dicom
from .read import list_stacks, read_dicom

__all__ = ["is_dicom", "list_stacks", "read_dicom"]
