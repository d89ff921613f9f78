"""What is looked at: a study, points, a mesh, or nothing yet."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import UnreadableError
from ..io.files.source import suffix_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..model.mesh import TriMesh
    from ..model.points import PointSet
    from ..model.volume import Volume
    from ..progress import Progress
    from ..settings import Settings

WHOLE = (".nii", ".nii.gz")
"""Suffixes of label maps with names that are read whole, whichever labels are wanted; of others, only those are."""


@dataclass(frozen=True)
class Opened:
    """What is looked at.

    Attributes
    ----------
    kind : str
        study, points, mesh, or nothing where nothing was opened.
    words : tuple of str
        What names it on a command line.
    volume, labels : Volume or None
        The study, and a label map beside it; None while it is being read.
    points : PointSet or None
    mesh : TriMesh or None
    names : mapping of int to str
        What the labels of a label map are called.
    refused : str
        Why it could not be read, in one line.
    flags : tuple of str
        The options with which it may be.
    """

    kind: str = "nothing"
    words: tuple[str, ...] = ()
    volume: Volume | None = field(default=None, repr=False)
    labels: Volume | None = field(default=None, repr=False)
    points: PointSet | None = field(default=None, repr=False)
    mesh: TriMesh | None = field(default=None, repr=False)
    names: Mapping[int, str] = field(default_factory=dict)
    refused: str = ""
    flags: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """The command that makes a surface of it."""
        return {"points": "surface", "mesh": "check"}.get(self.kind, "reconstruct")

    @property
    def ready(self) -> bool:
        """Whether it has been read."""
        return (self.volume or self.points or self.mesh) is not None

    def reads_otherwise(self, before: Settings, after: Settings) -> bool:
        """Tell whether other settings read a study otherwise."""
        if self.kind != "study":
            return False
        part = bool(self.refused or self.names) and suffix_of(self.words[0]) not in WHOLE
        return before.read != after.read or (part and before.window.select != after.window.select)

    @property
    def told(self) -> dict[str, Any]:
        """What the page is told of it."""
        name = Path(self.words[0]).resolve().name if self.words else ""
        return {
            "kind": self.kind, "name": name, "ready": self.ready, "refused": self.refused, "flags": list(self.flags),
        }  # fmt: skip


def kind_of(path: str) -> str:
    """Tell what a path leads to.

    Raises
    ------
    UnreadableError
        Where it leads nowhere.
    """
    if not Path(path).exists():
        raise UnreadableError("there is no such file or folder", file=path)
    suffix = suffix_of(path)
    if suffix in io.MESH_READERS and suffix not in io.VOLUME_READERS:
        return "mesh"
    return "points" if suffix in io.POINT_READERS and suffix not in io.VOLUME_READERS else "study"


def opened_as(kind: str, path: str, settings: Settings, progress: Progress) -> Opened:
    """Read what a path leads to.

    Raises
    ------
    TomomeshError
        Of the kind that fits.
    """
    progress("read", 0, 1)
    read: dict[str, Any] = {
        "study": lambda: _study(path, settings),
        "points": lambda: {"points": io.read_points(path, settings=settings.cloud)},
        "mesh": lambda: {"mesh": io.read_mesh(path)},
    }
    found = read[kind]()
    progress("read", 1, 1)
    return Opened(kind, (path,), **found)


def _study(path: str, settings: Settings) -> dict[str, Any]:
    volume = io.read_volume(path, settings=settings.read, select=settings.window.select)
    return {"volume": volume, "names": io.label_names(path)}
