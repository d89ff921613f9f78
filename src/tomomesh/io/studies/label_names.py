"""What the labels of a label map are called, where its file says so."""

from __future__ import annotations

import re
from html import unescape
from typing import TYPE_CHECKING

from ..dicom import is_dicom, is_segmentation
from ..dicom.objects.segmentation import segments_of
from ..files.source import existing, first_bytes, suffix_of
from ..files.unpack import GZIP, unpacked

if TYPE_CHECKING:
    from pathlib import Path

MOST = 1 << 20
"""Bytes of a header that are looked at: names of thousands of labels."""
IN_NIFTI = re.compile(rb'<Label\s[^>]*?Key="(\d+)"[^>]*>(?:<!\[CDATA\[)?([^<\]]+)')
"""A row of the label table that TotalSegmentator and Connectome Workbench write into a NIfTI extension."""
IN_NRRD = re.compile(rb"^(Segment\d+)_(Name|LabelValue):=(.*?)\r?$", re.MULTILINE)
"""What 3D Slicer writes into the header of a segmentation."""


def label_names(path: str | Path) -> dict[str, int]:
    """Return the names of a label map's labels with their numbers; none where its file names none.

    Names come from the label table in a NIfTI extension, the segments of a .seg.nrrd, and a DICOM segmentation.
    """
    file, suffix = existing(path), suffix_of(path)
    if file.is_dir():
        return {}
    if suffix in (".nii", ".nii.gz"):
        table = IN_NIFTI.findall(_start(file, suffix == ".nii.gz"))
        return {unescape(name.decode("utf-8", "replace")).strip(): int(number) for number, name in table}
    if suffix in (".nrrd", ".nhdr"):
        return _segments(_start(file, packed=False).partition(b"\n\n")[0])
    if is_dicom(file) and is_segmentation(file):
        return {name: number for number, name in segments_of(file).items()}
    return {}


def _start(file: Path, packed: bool) -> bytes:
    if not packed:
        return first_bytes(file, MOST)
    with unpacked(file, GZIP, file=str(file)) as stream:
        return bytes(stream.read(MOST))


def _segments(header: bytes) -> dict[str, int]:
    found: dict[bytes, dict[bytes, bytes]] = {}
    for segment, field, value in IN_NRRD.findall(header):
        found.setdefault(segment, {})[field] = value.strip()
    whole = [each for each in found.values() if {b"Name", b"LabelValue"} <= set(each) and each[b"LabelValue"].isdigit()]
    return {each[b"Name"].decode("utf-8", "replace"): int(each[b"LabelValue"]) for each in whole}
