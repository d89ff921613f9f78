"""The studies of a folder: what is one, what it is called, and whether it has changed."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ...errors import FormatError, TomomeshError, UnreadableError
from ..dicom import index_in, is_dicom, list_stacks
from ..files.source import existing, regular_files, suffix_of
from ..volumes.images import FAMILIES
from ..volumes.zarr.omezarr import is_zarr
from .naming import distinct_names
from .read import volumes_among
from .slices import slices_behind

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

SLICES = (".dcm", ".ima", *FAMILIES)
"""Suffixes of files that may be one slice of several."""
DETACHED_HEADERS = (".nhdr", ".mhd", ".hdr", ".hdr.gz")
"""Suffixes of headers whose voxels lie in other files beside them."""
PAGES = (".tif", ".tiff")
"""Suffixes of files that hold one slice, or all pages of a study."""


@dataclass(frozen=True)
class Study:
    """One study of a folder.

    Attributes
    ----------
    name : str
        What its results are called: from the names of its file or folder alone, never from what is inside.
    path : Path
        The file or folder to read.
    series : int or None
        The number of its series, where its folder holds several that are stacks.
    files : tuple of Path
        Those that it is read from.
    """

    name: str
    path: Path
    series: int | None
    files: tuple[Path, ...]

    @property
    def state(self) -> str:
        """A digest of the names, sizes and times of its files: it changes where one of them does."""
        stats = [(file.name, *_size_and_time(file)) for file in self.files]
        return hashlib.sha256(json.dumps(sorted(stats)).encode()).hexdigest()


def _size_and_time(path: Path) -> tuple[int, int]:
    stat = existing(path).stat()
    return stat.st_size, stat.st_mtime_ns


def find_studies(folder: str | Path, *, without: Iterable[Path] = (), series: int | None = None) -> list[Study]:
    """List the studies of a folder.

    A study is each volume file in the folder and in its sub-folders, and the slices of each sub-folder: where they
    are DICOM and more than one series is a stack, each of these. Where the folder itself holds DICOM or a DICOMDIR,
    all slices below it are read with them, as `read_volume` does, and its sub-folders have no slices of their own.

    Parameters
    ----------
    folder : path
        As the user typed it.
    without : iterable of Path
        Sub-folders that are passed over, such as that of the results.
    series : int, optional
        The series to take from every folder of DICOM slices, in place of each.

    Returns
    -------
    list of Study
        Sorted by path. Names differ even where upper and lower case do not.

    Raises
    ------
    UnreadableError
        For a folder that is missing, empty, or may not be read.
    FormatError
        For a folder without studies.
    """
    top = existing(folder)
    if not top.is_dir():
        raise FormatError("--each takes a folder of studies", file=str(folder), found="a file")
    left_out = {path.resolve() for path in without}
    inner = sorted(path for path in top.iterdir() if path.is_dir() and not path.name.startswith("."))
    whole = _has_slices(top)
    found = _volumes_in(top, top, deep=False) + (_slices_in(top, top, series) if whole else [])
    for path in inner:
        if not path.is_symlink() and path.resolve() not in left_out:
            found += _volumes_in(path, top, deep=True)
            found += [] if whole or is_zarr(path) else _slices_in(path, top, series)
    if not found and not any(top.iterdir()):
        raise UnreadableError("the folder is empty", file=str(folder), expected="a folder of studies")
    if not found:
        raise FormatError("the folder holds no studies", file=str(folder), expected="volume files, folders of slices")
    return _named(sorted(found, key=lambda study: (study.path, study.series or 0)))


def _has_slices(folder: Path) -> bool:
    """Tell whether a folder itself holds DICOM, so that it is read with all that is below it."""
    return index_in(folder) is not None or any(map(_surely_dicom, regular_files(folder)[0]))


def _surely_dicom(path: Path) -> bool:
    try:
        return is_dicom(path)
    except UnreadableError:
        return False


def _volumes_in(folder: Path, top: Path, *, deep: bool) -> list[Study]:
    if deep and is_zarr(folder):
        files, _ = regular_files(folder, deep=True, hidden=True)
        return [Study(_joined(folder, top), folder, None, tuple(files))]
    files, _ = regular_files(folder, deep=deep)
    others = [path for path in files if suffix_of(path) not in SLICES or (not deep and suffix_of(path) in PAGES)]
    return [Study(_joined(path, top), path, None, _beside(path)) for path in volumes_among(others)]


def _slices_in(folder: Path, top: Path, wanted: int | None) -> list[Study]:
    """Return the studies of a folder's slices, numbered among the very files that are read."""
    name = _joined(folder, top) or folder.resolve().name
    try:
        slices = slices_behind(folder, str(folder))
        numbers = list_stacks(slices.dicom) if wanted is None else []
    except TomomeshError:  # told when the folder is read, as one study that fails
        return [Study(name, folder, wanted, tuple(regular_files(folder, deep=True)[0]))]
    files = tuple(slices.dicom or slices.images)
    if len(numbers) > 1:
        return [Study(f"{name}-series-{number}", folder, number, files) for number in numbers]
    return [Study(name, folder, wanted if slices.dicom else None, files)] if files else []


def files_of(path: Path) -> tuple[Path, ...]:
    """Return the files that a study may be read from.

    Raises
    ------
    UnreadableError, FormatError
        Where there is none.
    """
    path = existing(path)
    return tuple(regular_files(path, deep=True, hidden=True)[0]) if path.is_dir() else _beside(path)


def _beside(path: Path) -> tuple[Path, ...]:
    """Return the files that a volume may be read from: a header may name any file in its folder."""
    return tuple(regular_files(path.parent)[0]) if suffix_of(path) in DETACHED_HEADERS else (path,)


def _joined(path: Path, top: Path) -> str:
    """Name a file or folder by the folders that lead to it."""
    return "-".join(path.relative_to(top).parts)


def _named(studies: Sequence[Study]) -> list[Study]:
    names = distinct_names([_without_suffix(study) for study in studies], [study.name for study in studies])
    return [replace(study, name=name) for study, name in zip(studies, names, strict=True)]


def _without_suffix(study: Study) -> str:
    return study.name if study.path.is_dir() else study.name[: -len(suffix_of(study.path))]
