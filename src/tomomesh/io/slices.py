"""Which slices a folder holds."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .dicom import NOT_DICOM, dicom_among
from .images import FAMILIES
from .source import regular_files, suffix_of

if TYPE_CHECKING:
    from pathlib import Path


@dataclass(frozen=True)
class Slices:
    """What a folder holds: files of one of three kinds, sorted.

    Attributes
    ----------
    dicom, images, rest : list of Path
        DICOM; else PNG, TIFF or JPEG; else what is neither.
    others : Counter
        How many entries were passed over, by reason.
    """

    dicom: list[Path]
    images: list[Path]
    rest: list[Path]
    others: Counter[str]


def slices_in(folder: Path) -> Slices:
    """Find all DICOM below a folder, or its images; where it holds none, those of its sub-folders.

    Raises
    ------
    UnreadableError
        For a folder that may not be read.
    """
    for deep in (False, True):
        files, others = regular_files(folder, deep=deep)
        dicom = dicom_among(files)
        if dicom and not deep:
            continue  # further series may be in sub-folders
        if dicom:
            return Slices(dicom, [], [], others + Counter({NOT_DICOM: len(files) - len(dicom)}))
        images = [path for path in files if suffix_of(path) in FAMILIES]
        if images:
            return Slices([], images, [], others)
    return Slices([], [], files, others)
