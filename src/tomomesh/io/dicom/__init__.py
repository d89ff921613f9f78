"""DICOM: a folder of slices, or one file, to a volume."""

from __future__ import annotations

from .header import is_dicom
from .read import read_dicom

__all__ = ["is_dicom", "read_dicom"]
