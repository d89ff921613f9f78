"""Which files may be opened: those that were named on the command line, and what lies in a folder to browse."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import FormatError, UnreadableError, UsageError
from ..io.files.source import regular_files, suffix_of
from .opened import kind_of, meshes_of

if TYPE_CHECKING:
    from collections.abc import Iterator


@dataclass(frozen=True)
class Reach:
    """What may be opened.

    Attributes
    ----------
    named : tuple of str
        Paths as they were typed.
    folder : Path or None
        All in it may be opened too, links out of it not.
    """

    named: tuple[str, ...] = ()
    folder: Path | None = None

    def check(self, path: str) -> str:
        """Return a path that may be opened, as it is.

        Raises
        ------
        UsageError
            For one that may not, whether there is such a file or not.
        """
        if path in self.named or path in self._meshes or self._in_folder(path):
            return path
        raise UsageError(
            "only files that were named on the command line can be opened", found="another path",
            hint="tomomesh view --browse FOLDER, for all in a folder",
        )  # fmt: skip

    @property
    def _meshes(self) -> list[str]:
        """The meshes of folders of runs that were named."""
        return [str(mesh) for path in self.named if kind_of(path) == "run" for mesh in meshes_of(path)]

    def _in_folder(self, path: str) -> bool:
        if self.folder is None:
            return False
        try:
            return Path(path).resolve().is_relative_to(self.folder.resolve())
        except (OSError, RuntimeError, ValueError):
            return False

    def listed(self) -> list[dict[str, Any]]:
        """List what may be opened: paths, names, what each is, and its number where a folder holds several series."""
        named = [{"path": path, "name": Path(path).resolve().name, "kind": kind_of(path), "series": None}
                 for path in (*self.named, *self._meshes)]  # fmt: skip
        return named + ([] if self.folder is None else [*_studies(self.folder), *_surfaces(self.folder)])


def browsed(folder: str) -> Path:
    """Return a folder to browse.

    Raises
    ------
    UnreadableError
        Where there is none.
    """
    if not Path(folder).is_dir():
        raise UnreadableError("there is no such folder", file=folder, expected="--browse FOLDER")
    return Path(folder)


def _studies(folder: Path) -> Iterator[dict[str, Any]]:
    try:
        studies = io.find_studies(folder)
    except (FormatError, UnreadableError):  # there are none
        return
    for study in studies:
        path = str(study.path)
        yield {"path": path, "name": study.name, "kind": "study", "series": study.series}


def _surfaces(folder: Path) -> Iterator[dict[str, Any]]:
    """List meshes and points; what may also be a study is listed as one."""
    for file in regular_files(folder, deep=True)[0]:
        suffix = suffix_of(file)
        if suffix in {*io.MESH_READERS, *io.POINT_READERS} - {*io.VOLUME_READERS}:
            yield {"path": str(file), "name": str(file.relative_to(folder)), "kind": kind_of(str(file)), "series": None}
