"""What the labels of a label map are called, where its file says so."""

from __future__ import annotations

import re
from html import unescape
from typing import TYPE_CHECKING

from ..dicom import is_dicom, is_segmentation
from ..dicom.objects.segmentation import segments_of
from ..files.source import existing, first_bytes, suffix_of
from ..files.unpack import GZIP, unpacked
from ..volumes.nrrd.nrrd import nrrd_segments

if TYPE_CHECKING:
    from pathlib import Path

MOST = 1 << 20
"""Bytes of a NIfTI file that are looked at: names of thousands of labels."""
IN_NIFTI = re.compile(rb'<Label\s[^>]*?Key="(\d+)"[^>]*>(?:<!\[CDATA\[)?([^<\]]+)')
"""A row of the label table that TotalSegmentator and Connectome Workbench write into a NIfTI extension."""


def label_names(path: str | Path) -> dict[int, str]:
    """Return the names of a label map's labels by their numbers; none where its file names none.

    Names come from the label table in a NIfTI extension, the segments of a .seg.nrrd, and a DICOM segmentation.

    Raises
    ------
    UnreadableError, FormatError
        Where there is no such file, or its segments have no numbers.
    """
    file, suffix = existing(path), suffix_of(path)
    if file.is_dir():
        return {}
    if suffix in (".nii", ".nii.gz"):
        table = IN_NIFTI.findall(_start(file, suffix == ".nii.gz"))
        return {int(number): unescape(name.decode("utf-8", "replace")).strip() for number, name in table}
    if suffix in (".nrrd", ".nhdr"):
        return {number: segment.name for number, segment in nrrd_segments(file).items()}
    return segments_of(file) if is_dicom(file) and is_segmentation(file) else {}


def _start(file: Path, packed: bool) -> bytes:
    if not packed:
        return first_bytes(file, MOST)
    with unpacked(file, GZIP, file=str(file)) as stream:
        return bytes(stream.read(MOST))
