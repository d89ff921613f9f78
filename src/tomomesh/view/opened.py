"""What is looked at: a study, points, a mesh, or nothing yet."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import UnreadableError
from ..io.files.source import suffix_of

if TYPE_CHECKING:
    from ..model.mesh import TriMesh
    from ..model.points import PointSet
    from ..model.volume import Volume
    from ..progress import Progress
    from ..settings import Settings

KINDS = ("study", "points", "mesh")


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
    """

    kind: str = "nothing"
    words: tuple[str, ...] = ()
    volume: Volume | None = field(default=None, repr=False)
    labels: Volume | None = field(default=None, repr=False)
    points: PointSet | None = field(default=None, repr=False)
    mesh: TriMesh | None = field(default=None, repr=False)

    @property
    def command(self) -> str:
        """The command that makes a surface of it."""
        return {"points": "surface", "mesh": "check"}.get(self.kind, "reconstruct")

    @property
    def ready(self) -> bool:
        """Whether it has been read."""
        return (self.volume or self.points or self.mesh) is not None

    @property
    def told(self) -> dict[str, Any]:
        """What the page is told of it."""
        return {"kind": self.kind, "name": Path(self.words[0]).name if self.words else "", "ready": self.ready}


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
        "study": lambda: {"volume": io.read_volume(path, settings=settings.read, select=settings.window.select)},
        "points": lambda: {"points": io.read_points(path, settings=settings.cloud)},
        "mesh": lambda: {"mesh": io.read_mesh(path)},
    }
    found = read[kind]()
    progress("read", 1, 1)
    return Opened(kind, (path,), **found)
