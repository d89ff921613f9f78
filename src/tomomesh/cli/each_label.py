"""Every label of a label map as a mesh of its own: the map is read once, and each label is a study of a batch."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import GeometryError, TomomeshError
from ..io.studies.naming import safe_name
from .bars import bars_of
from .batch import check_results, do_all, done, refuse_with
from .outputs.checks import check_archive
from .outputs.write import write_surface
from .records import COLUMNS, row_of_fault
from .sources import names_of, read_study, sources_of
from .spread import Batch

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from ..model.volume import Volume
    from ..results import Surface
    from ..settings import Settings
    from .batch import Work
    from .records import Row

    Made = tuple[Sequence[int], Callable[[int, Namespace, Settings], Surface]]

OPTION = "--each-label"
SINGLE = ("each", "workers", "scheduler", "points", "labels", "mask_out", "figures", "report")
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
    refuse_with(OPTION, SINGLE, chosen)
    settings.replace(select=(0,))  # refuses another window
    sources = sources_of(chosen, settings)
    folder = check_results(OPTION, chosen, settings)
    names = names_of(chosen.label_names, chosen.labels_in or chosen.study)
    numbers, make = _labels(chosen, settings, given, work)
    files = tuple(file for source in sources for file in io.files_of(Path(source)))
    studies = [io.Study(_file_name(number, names), Path(sources[0]), None, files) for number in numbers]
    labels = {study.name: number for study, number in zip(studies, numbers, strict=True)}
    columns = (COLUMNS[0], "label", "label_name", *COLUMNS[1:])
    do_all(Batch(studies, chosen, settings, folder, _Done(labels, names, make), columns, "labels"))


def _file_name(number: int, names: Mapping[int, str]) -> str:
    """Name the files of a label by its number, which no other has, and by its name where there is one."""
    return safe_name(f"label-{number:04d}" + (f"-{names[number]}" if names.get(number) else ""))


@dataclass(frozen=True)
class _Done:
    """Makes the row of a label."""

    labels: Mapping[str, int]
    names: Mapping[int, str]
    make: Callable[[int, Namespace, Settings], Surface]

    def __call__(self, study: io.Study, chosen: Namespace, settings: Settings, folder: Path) -> Row:
        number = self.labels[study.name]
        label = {"label": number, "label_name": self.names.get(number, "")}
        try:
            settings = settings.replace(select=(number,))
        except TomomeshError as error:  # the number of no label
            return row_of_fault(study.name, error) | label
        return done(study, chosen, settings, folder, lambda *asked: self.make(number, *asked)) | label


def _labels(chosen: Namespace, settings: Settings, given: Mapping[str, Any], work: Work) -> Made:
    """Return the labels, and what makes the surface of one."""
    try:
        return _in_one_pass(chosen, settings, given)
    except GeometryError as fault:
        if "--select" not in fault.flags:
            raise
    # segments overlap: no one label map holds them, and each is read alone
    numbers = settings.window.select or tuple(sorted(names_of(None, chosen.labels_in or chosen.study)))
    return numbers, lambda _number, asked, own: work(Namespace(**vars(asked) | {"study": chosen.study}), own)


def _in_one_pass(chosen: Namespace, settings: Settings, given: Mapping[str, Any]) -> Made:
    from ..label_surfaces import LabelSurfaces

    def read() -> tuple[Volume, Volume | None]:
        volume, labels = read_study(chosen, settings.replace(select=None), progress)
        check_archive(chosen, volume)
        return volume, labels

    def make(number: int, asked: Namespace, own: Settings) -> Surface:
        with bars_of(asked) as progress:
            return write_surface(asked, found.surface(number, progress), own, progress)

    with bars_of(chosen) as progress:
        found = LabelSurfaces(read, settings, progress, given, kept=False)
    return tuple(found), make
