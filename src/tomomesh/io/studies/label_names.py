"""What the labels of a label map are called, where its file says so."""

from __future__ import annotations

import re
from html import unescape
from typing import TYPE_CHECKING

from ..dicom import is_dicom, is_segmentation
from ..dicom.objects.segmentation import segments_of
from ..files.source import existing, first_bytes, suffix_of
from ..files.unpack import GZIP, unpacked
from ..volumes.nrrd.nrrd import segment_names

if TYPE_CHECKING:
    from pathlib import Path

MOST = 1 << 20
"""Bytes of a header that are looked at: names of thousands of labels."""
IN_NIFTI = re.compile(rb'<Label\s[^>]*?Key="(\d+)"[^>]*>(?:<!\[CDATA\[)?([^<\]]+)')
"""A row of the label table that TotalSegmentator and Connectome Workbench write into a NIfTI extension."""


def label_names(path: str | Path) -> dict[int, str]:
    """Return what a label map's labels are called, by their numbers; none where its file names none.

    Names come from the label table in a NIfTI extension, the segments of a .seg.nrrd, and a DICOM segmentation. The
    numbers are those that a study of the file is read with.

    Raises
    ------
    FormatError
        For a broken header.
    """
    file, suffix = existing(path), suffix_of(path)
    if file.is_dir():
        return {}
    if suffix in (".nii", ".nii.gz"):
        table = IN_NIFTI.findall(_start(file, suffix == ".nii.gz"))
        return {int(number): unescape(name.decode("utf-8", "replace")).strip() for number, name in table}
    if suffix in (".nrrd", ".nhdr"):
        return segment_names(file)
    if is_dicom(file) and is_segmentation(file):
        return segments_of(file)
    return {}


def _start(file: Path, packed: bool) -> bytes:
    if not packed:
        return first_bytes(file, MOST)
    with unpacked(file, GZIP, file=str(file)) as stream:
        return bytes(stream.read(MOST))
