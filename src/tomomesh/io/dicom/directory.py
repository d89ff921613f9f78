"""DICOMDIR: the index of a disc, and the files that it names."""

from __future__ import annotations

from collections import Counter
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

from ...errors import FormatError
from ..files.source import leaves_folder, regular_files, third_party
from .bad import listed
from .headers.dataset import read_dataset
from .read import read_dicom

if TYPE_CHECKING:
    from pathlib import Path

    from ...model.volume import Volume
    from ...settings import ReadSettings

NAME = "DICOMDIR"
GONE = "missing, though DICOMDIR names them"


def is_index(path: Path) -> bool:
    """Tell from its name whether a file is the index of a disc."""
    return path.name.upper() == NAME and path.is_file()


def index_in(folder: Path) -> Path | None:
    """Return the index of a folder, if it has one."""
    return next(filter(is_index, regular_files(folder)[0]), None)


def read_index(index: Path, settings: ReadSettings, *, study: str) -> Volume:
    """Read one series of the files that an index names.

    Parameters
    ----------
    index : Path
        The DICOMDIR.
    settings : ReadSettings
        As `read_dicom`; `skip_bad` goes on where files are missing.
    study : str
        The path as the user typed it.

    Raises
    ------
    FormatError
        Where the index is broken, names files outside of its folder, or ones that are missing.
    TomomeshError
        As `read_dicom`.
    """
    files, gone = indexed(index, study=study)
    if gone and not settings.skip_bad:
        raise FormatError(
            f"{len(gone)} of {len(files) + len(gone)} files that DICOMDIR names are missing",
            file=study,
            found=listed(gone),
            expected="all files beside it",
            hint="the whole disc, or --skip-bad to go on without them",
            flags=["--skip-bad"],
        )
    return read_dicom(files, settings, study=study, others=Counter({GONE: len(gone)} if gone else {}))


def indexed(index: Path, *, study: str) -> tuple[list[Path], list[PurePosixPath]]:
    """Find the files that an index names, and the names of those that are missing.

    Raises
    ------
    FormatError
        Where the index is broken, or names files outside of its folder.
    """
    named, files = _named(index), _beside(index)
    outside = [name for name in named if leaves_folder(name)]
    if outside:
        raise FormatError(
            "DICOMDIR names files outside of its folder",
            file=study,
            found=f"files = {len(outside)}",
            expected="files in its folder or below",
        )
    gone = [PurePosixPath(name) for name in named if name.lower() not in files]
    return [files[name.lower()] for name in named if name.lower() in files], gone


def _beside(index: Path) -> dict[str, Path]:
    """Return the files of the index's folder by their names in it, small: discs are mounted in capitals or not."""
    files, _ = regular_files(index.parent, deep=True)
    return {path.relative_to(index.parent).as_posix().lower(): path for path in files}


def _named(index: Path) -> list[str]:
    """Return the names of all files in an index, each once, in its order."""
    with third_party("pydicom", index.name):
        header = read_dataset(index)
        records = header.get("DirectoryRecordSequence") or []
        names = [_joined(record.get("ReferencedFileID")) for record in records if "ReferencedFileID" in record]
    if not any(names):
        raise FormatError(
            "DICOMDIR names no files",
            file=index.name,
            expected="ReferencedFileID of each image",
            hint="the folder of the slices without its DICOMDIR",
        )
    return list(dict.fromkeys(filter(None, names)))


def _joined(parts: Any) -> str:
    """Join the parts of a file's name: one text or several; some writers use separators of their own."""
    parts = [parts] if isinstance(parts, str) else list(parts or [])
    return "/".join(str(part).replace("\\", "/") for part in parts)
