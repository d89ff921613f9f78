"""Which slices a study is read from."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..dicom import GONE, NOT_DICOM, dicom_among, index_in, indexed, is_dicom, is_index
from ..files.source import existing, regular_files, suffix_of
from ..volumes.images import FAMILIES

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

ARCHIVES = (".zip", ".ozx")
"""Suffixes of archives: zip files, and those of OME-Zarr's RFC 9, which are zip files of one image."""


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


def slices_behind(path: Path, study: str) -> Slices:
    """Find what a study is read from: the files that a DICOMDIR names, the slices of a folder, or a single file.

    Parameters
    ----------
    path : Path
        A file or a folder.
    study : str
        The path as the user typed it.

    Raises
    ------
    UnreadableError
        For a file or a folder that may not be read.
    FormatError
        For a DICOMDIR that is broken, or names files outside of its folder.
    """
    index = index_in(path) if path.is_dir() else path if is_index(path) else None
    if index is not None:
        files, gone = indexed(index, study=study)
        return Slices(files, [], [], Counter({GONE: len(gone)}))
    if path.is_dir():
        return slices_in(path)
    return Slices([path], [], [], Counter()) if is_dicom(path) else Slices([], [], [path], Counter())


def slices_among(paths: Sequence[Path]) -> Slices:
    """Sort files that were named one by one, as a shell does that expands ``ct/*.dcm``; of folders all files below.

    Raises
    ------
    UnreadableError, FormatError
        For a path that is missing, may not be read, or leads to no file and no folder.
    """
    files: dict[Path, None] = {}  # each once, in their order
    for path in map(existing, paths):
        files |= dict.fromkeys(regular_files(path, deep=True)[0] if path.is_dir() else [path])
    named = [path for path in files if not is_index(path)]
    dicom = dicom_among(named)
    if dicom:
        return Slices(dicom, [], [], Counter({NOT_DICOM: len(named) - len(dicom)}))
    images = [path for path in named if suffix_of(path) in FAMILIES]
    return Slices([], images, [] if images else named, Counter())


def in_words(paths: Sequence[Path]) -> str:
    """Put files that were named one by one into words: the first, and how many others there are."""
    return f"{paths[0]} and {len(paths) - 1} more"


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
