"""Every label of a label map as a mesh of its own: the map is read once, and each label is a study of a batch.

Where workers make them each reads the map once, and keeps it for the labels that it is given.
"""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from .. import io
from ..errors import GeometryError, TomomeshError, UsageError
from ..io.meshes.attributes import fits_single
from ..io.meshes.pieces.parts import InOnePiece
from ..io.studies.naming import safe_name
from .bars import bars_of
from .batch import OF_ONE, check_results, do_all, done, refuse_with
from .outputs.checks import check_archive
from .outputs.write import frame_asked, write_surface
from .records import COLUMNS, row_of_fault
from .sources import names_of, read_study, sources_of
from .spread import Batch, check_workers

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from ..label_surfaces import LabelSurfaces
    from ..model.volume import Volume
    from ..progress import Progress
    from ..results import Surface
    from ..settings import Settings
    from .batch import Work
    from .records import Row

    Make = Callable[[int, Namespace, Settings], Surface]

OPTION = "--each-label"
SINGLE = ("each", "points", "labels", "mask_out", "figures", "report", "slicer", *OF_ONE)
"""Options that have no place beside labels that are each a mesh."""


def reconstruct_each_label(chosen: Namespace, settings: Settings, given: Mapping[str, Any], work: Work) -> None:
    """Reconstruct every label of a label map; what fails does not stop the rest.

    Parameters
    ----------
    chosen : Namespace
        What was asked for; `output` is the folder of the results.
    settings : Settings
        Its ``select`` are the labels; where it has none, all but 0 are.
    given : mapping
        Parameters that were given as options.
    work : callable
        Reads and reconstructs the labels of `chosen` alone, for label maps whose labels overlap.

    Raises
    ------
    BatchError
        At the end, where labels failed.
    TomomeshError
        Where there is no label map, and for options that are for one mesh.
    """
    folder, sources = _checked(chosen, settings), sources_of(chosen, settings)
    names = names_of(chosen.label_names, chosen.labels_in or chosen.study)
    numbers, make = _labels(chosen, settings, given, work)
    files = tuple(file for source in sources for file in io.files_of(Path(source)))
    studies = [io.Study(_file_name(number, names), Path(sources[0]), None, files) for number in numbers]
    labels = {study.name: number for study, number in zip(studies, numbers, strict=True)}
    columns = (COLUMNS[0], "label", "label_name", *COLUMNS[1:])
    try:
        do_all(Batch(studies, chosen, settings, folder, _Done(labels, names, make), columns, "labels"))
    finally:
        _KEPT.clear()


def _checked(chosen: Namespace, settings: Settings) -> Path:
    """Return the folder of the results; refuse what no label could have, before anything is read."""
    from ..ways import choose_way, way_of

    refuse_with(OPTION, SINGLE, chosen)
    check_workers(chosen)
    way_of(choose_way(settings.replace(select=(0,)), "gray")).require(settings)  # no other window than labels
    return check_results(OPTION, chosen, settings)


def _file_name(number: int, names: Mapping[int, str]) -> str:
    """Name the files of a label by its number, which no other has, and by its name where there is one."""
    return safe_name(f"label-{number:04d}" + (f"-{names[number]}" if names.get(number) else ""))


@dataclass(frozen=True)
class _Done:
    """Makes the row of a label."""

    labels: Mapping[str, int]
    names: Mapping[int, str]
    make: Make

    def __call__(self, study: io.Study, chosen: Namespace, settings: Settings, folder: Path) -> Row:
        number = self.labels[study.name]
        label = {"label": number, "label_name": self.names.get(number, "")}
        try:
            settings = settings.replace(select=(number,))
        except TomomeshError as error:  # the number of no label
            return row_of_fault(study.name, error) | label
        return done(study, chosen, settings, folder, lambda *asked: self.make(number, *asked)) | label


def _labels(chosen: Namespace, settings: Settings, given: Mapping[str, Any], work: Work) -> tuple[Sequence[int], Make]:
    """Return the labels, and what makes the surface of one."""
    read = {name: _absolute(getattr(chosen, name)) for name in ("study", "labels_in")}
    made = _InOnePass(chosen, settings, given, uuid4().hex)
    try:
        with bars_of(chosen) as progress:
            numbers = tuple(made.found(progress))
        if chosen.workers or chosen.scheduler:
            _KEPT.clear()  # each of them reads it
        return numbers, replace(made, chosen=Namespace(**vars(chosen) | read))
    except GeometryError as fault:
        if "--select" not in fault.flags:
            raise
    if settings.cubes.shared_walls:
        raise UsageError("labels that overlap share no walls", found="--shared-walls", hint="no --shared-walls")
    # segments overlap: no one label map holds them, and each is read alone
    numbers = settings.window.select or tuple(sorted(names_of(None, chosen.labels_in or chosen.study)))
    return numbers, _EachAlone(read, work)


def _absolute(named: str | tuple[str, ...] | None) -> str | tuple[str, ...] | None:
    """Name files as workers find them, wherever these were started."""
    if isinstance(named, tuple):
        return tuple(str(Path(one).absolute()) for one in named)
    return named and str(Path(named).absolute())


@dataclass(frozen=True)
class _EachAlone:
    """Reads the map for each label anew."""

    read: dict[str, Any]
    work: Work

    def __call__(self, number: int, asked: Namespace, own: Settings) -> Surface:
        return self.work(Namespace(**vars(asked) | self.read), own)


@dataclass(frozen=True)
class _InOnePass:
    """Makes the surface of any label of a map, which is read when the first one of a run is asked for."""

    chosen: Namespace
    settings: Settings
    given: Mapping[str, Any]
    run: str

    def __call__(self, number: int, asked: Namespace, own: Settings) -> Surface:
        with bars_of(asked) as progress:
            surface = self.found(progress).surface(number, progress)
            return write_surface(asked, surface, own, progress, fits=self._fits(surface, asked, own))

    def _fits(self, surface: Surface, asked: Namespace, own: Settings) -> bool | None:
        """Tell whether 32 bits hold all walls of the map, where these are asked for: neighbors then have the same."""
        walls = _KEPT[self.run].walls
        if walls is None or own.run.precision == 64:
            return None
        if self.run not in _FIT:
            frame = frame_asked(surface, asked.output, own)
            _FIT.clear()
            _FIT[self.run] = fits_single(InOnePiece(frame.mesh(walls)))
        return _FIT[self.run]

    def found(self, progress: Progress) -> LabelSurfaces:
        """Return the labels of this run, which its process keeps until it works for another one."""
        with _READING:
            if self.run not in _KEPT:
                _KEPT.clear()
                _KEPT[self.run] = self._found(progress)
            return _KEPT[self.run]

    def _found(self, progress: Progress) -> LabelSurfaces:
        from ..label_surfaces import LabelSurfaces

        def read() -> tuple[Volume, Volume | None]:
            volume, labels = read_study(self.chosen, self.settings.replace(select=None), progress)
            check_archive(self.chosen, volume)
            return volume, labels

        return LabelSurfaces(read, self.settings, progress, self.given, kept=bool(self.chosen.html))


_KEPT: dict[str, LabelSurfaces] = {}
"""Run to its labels: of one run at most."""
_FIT: dict[str, bool] = {}
"""Run to whether 32 bits hold its walls: of one run at most."""
_READING = Lock()
"""Held while a map is read: a worker may have threads."""
