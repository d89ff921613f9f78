"""What is looked at: a study, points, a mesh, the folder of a run, or nothing yet."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import EmptyError, FormatError, TomomeshError, UnreadableError
from ..io.files.source import suffix_of
from ..segmentation.labels import fitting

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ..model.mesh import TriMesh
    from ..model.points import PointSet
    from ..model.volume import Volume
    from ..progress import Progress
    from ..settings import Settings

REPORT, SETTINGS, MESH, POINTS = "report.json", "settings.toml", "mesh", "points"
"""What a run calls what it leaves in a folder."""
SLICES = (".dcm", ".ima", "")
"""Suffixes of slices: where they lie, a mesh and a report lie beside their study."""
LONGEST = 64 << 20
"""Bytes of a report that is read: one of a mesh of a million pieces has 20 MB."""


@dataclass(frozen=True)
class Opened:
    """What is looked at.

    Attributes
    ----------
    kind : str
        study, points, mesh, run (the folder that a run has left), or nothing where nothing was opened.
    words : tuple of str
        What names it on a command line.
    beside : str
        The file of a label map beside the study; "" where there is none.
    volume, labels : Volume or None
        The study, and the label map beside it; None while it is being read.
    laid : Volume or None
        The label map on the study's grid.
    points : PointSet or None
    mesh : TriMesh or None
    report : mapping
        What the run that made the mesh has measured; empty where that is not known.
    repeats : tuple of str
        What is known of the command that made the mesh.
    names : mapping of int to str
        What the labels of a label map are called.
    part : bool
        Whether they overlap, so that only those that are chosen were read.
    refused : str
        Why it could not be read, in one line.
    flags : tuple of str
        The options with which it may be.
    """

    kind: str = "nothing"
    words: tuple[str, ...] = ()
    beside: str = ""
    volume: Volume | None = field(default=None, repr=False)
    labels: Volume | None = field(default=None, repr=False)
    laid: Volume | None = field(default=None, repr=False)
    points: PointSet | None = field(default=None, repr=False)
    mesh: TriMesh | None = field(default=None, repr=False)
    report: Mapping[str, Any] = field(default_factory=dict, repr=False)
    repeats: tuple[str, ...] = ()
    names: Mapping[int, str] = field(default_factory=dict)
    part: bool = False
    refused: str = ""
    flags: tuple[str, ...] = ()

    def command(self, settings: Settings) -> tuple[str, ...]:
        """Return the words of the command that makes a surface of it, or checks the one that it is."""
        if self.kind in ("mesh", "run"):
            return self.repeats or (("check", *self.words) if self.kind == "mesh" else ())
        name = "surface" if self.kind == "points" else "reconstruct"
        beside = ("--labels-in", self.beside) if self.beside and settings.window.select else ()
        return (name, *self.words, *beside, *settings.words(), "-o", "mesh.stl")

    @property
    def converts(self) -> bool:
        """Whether it is a mesh that can be written in another format."""
        return self.kind == "mesh" and self.mesh is not None

    def converting(self, output: str) -> tuple[str, ...]:
        """Return the words of the command that writes a mesh in another format."""
        return "print", *self.words, "-o", output

    def chosen_labels(self, settings: Settings) -> Volume | None:
        """Return the label map beside the study, where labels are chosen."""
        return self.labels if settings.window.select else None

    @property
    def ready(self) -> bool:
        """Whether it has been read."""
        return (self.volume or self.points or self.mesh) is not None

    def reads_otherwise(self, before: Settings, after: Settings) -> bool:
        """Tell whether other settings read a study otherwise."""
        if self.kind != "study":
            return False
        part = bool(self.refused) or self.part
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
    if Path(path).is_dir():
        return "run" if is_run(path) else "study"
    suffix = suffix_of(path)
    if _is_mesh(path):
        return "mesh"
    return "points" if suffix in io.POINT_READERS and suffix not in io.VOLUME_READERS else "study"


def meshes_of(folder: str | Path) -> list[Path]:
    """Return the meshes of a folder, by name."""
    with suppress(OSError):
        return sorted(path for path in Path(folder).iterdir() if _is_mesh(path) and path.is_file())
    return []


def is_run(folder: str) -> bool:
    """Tell whether a folder is what a run has left: meshes with a report or settings, or meshes and no study."""
    if not meshes_of(folder) or any(suffix_of(path) in SLICES for path in Path(folder).iterdir() if path.is_file()):
        return False
    if any(Path(folder, name).is_file() for name in (REPORT, SETTINGS)):
        return True
    try:
        io.find_studies(Path(folder))
    except TomomeshError:  # there are none
        return True
    return False


def _is_mesh(path: str | Path) -> bool:
    return suffix_of(path) in {*io.MESH_READERS} - {*io.VOLUME_READERS}


def opened_as(kind: str, path: str, settings: Settings, progress: Progress, *, beside: str = "") -> Opened:
    """Read what a path leads to, and the label map beside a study.

    Raises
    ------
    TomomeshError
        Of the kind that fits.
    """
    progress("read", 0, 1)
    read: dict[str, Any] = {
        "study": lambda: _study(path, settings, beside),
        "points": lambda: {"points": io.read_points(path, settings=settings.cloud)},
        "mesh": lambda: _mesh(Path(path)),
        "run": lambda: _run(Path(path)),
    }
    try:
        found = read[kind]()
    except EmptyError:  # a file whose kind may hold points alone
        if kind != "mesh":
            raise
        kind, found = "points", read["points"]()
    progress("read", 1, 1)
    return Opened(kind, (path,), beside, **found)


def _run(folder: Path) -> dict[str, Any]:
    """Read the mesh of a run and its points, where they are there; of several meshes the one that has the run's name.

    Raises
    ------
    FormatError
        Where it cannot be told which mesh is meant.
    """
    found = meshes_of(folder)
    named = [path for path in found if path.stem == MESH] or found
    if len(named) > 1:
        raise FormatError("the folder holds several meshes", found=str(len(found)), hint="open one of them")
    points = [path for path in folder.glob(f"{POINTS}.*") if suffix_of(path) in io.POINT_READERS]
    read = _mesh(named[0])
    with suppress(TomomeshError):  # the mesh is there all the same
        read["points"] = io.read_points(points[0]) if points and read["report"] else None
    return read


def _mesh(path: Path) -> dict[str, Any]:
    """Read a mesh, and the report and the settings beside it, where they are of this mesh."""
    mesh = io.read_mesh(path)
    reports = filter(None, map(_document, (path.with_suffix(".json"), path.with_name(REPORT))))
    report = next((one for one in reports if _tells_of(one, mesh)), {})
    return {"mesh": mesh, "report": report, "repeats": _repeats(path, report)}


def _document(path: Path) -> dict[str, Any]:
    with suppress(OSError, ValueError, RecursionError):
        if path.stat().st_size <= LONGEST:
            found = json.loads(path.read_bytes())
            return found if isinstance(found, dict) else {}
    return {}


def _tells_of(report: Mapping[str, Any], mesh: TriMesh) -> bool:
    """Tell whether a report is of a mesh: it has as many faces, and as many vertices."""
    quality = report.get("quality")
    counts = (len(mesh.faces), len(mesh.vertices))
    return isinstance(quality, dict) and (quality.get("faces"), quality.get("vertices")) == counts


def _repeats(path: Path, report: Mapping[str, Any]) -> tuple[str, ...]:
    """Tell what repeats the run of a mesh; a report names no files, so that what it was made of stays to be named."""
    settings = next((one for one in (path.with_suffix(".toml"), path.with_name(SETTINGS)) if one.is_file()), None)
    if not report or settings is None:
        return ("check", str(path))
    made = ("reconstruct", "STUDY") if "study" in report else ("surface", "POINTS")
    return (*made, "--settings", str(settings), "-o", path.name)


def _study(path: str, settings: Settings, beside: str) -> dict[str, Any]:
    if not beside:
        volume, part = _labels(path, settings)
        return {"volume": volume, "names": io.label_names(path), "part": part}
    volume = io.read_volume(path, settings=settings.read)
    labels, part = _labels(beside, settings)
    laid = fitting(labels, volume)
    return {"volume": volume, "labels": labels, "laid": laid, "names": io.label_names(beside), "part": part}


def _labels(path: str, settings: Settings) -> tuple[Volume, bool]:
    """Read what may be a label map, all of it, so that any label can be chosen; where they overlap, those that are."""
    try:
        return io.read_volume(path, settings=settings.read), False
    except TomomeshError as fault:
        if "--select" not in fault.flags or not settings.window.select:
            raise
    return io.read_volume(path, settings=settings.read, select=settings.window.select), True
