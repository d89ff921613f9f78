"""Options that several commands have, each group under its heading."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

from ...settings import Settings, option_of, parameters
from .formats import LABEL, POINT, STUDY
from .parameters import add_parameter, chosen_from

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence


HTML = "write one page that opens in any browser, offline: verdict, mesh in 3-D, pictures, report, and how to repeat it"
"""What ``--html`` writes."""


def add_study(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that name a study, and what is chosen in it."""
    parser.add_argument(
        "study",
        metavar="STUDY",
        nargs="*",
        help=f"{STUDY}, or its slices one by one, or - with --input-format; --labels-in may stand in its place",
    )
    parser.add_argument(
        "--labels-in",
        metavar="FILE",
        help="a label map or a DICOM segmentation on the study's grid or a part of it, or alone: "
        "its labels of --select are the window",
    )


def add_streams(
    parser: argparse.ArgumentParser, read: Sequence[str], written: Sequence[str] = (), *, usual: str = "nii"
) -> None:
    """Add the options that name formats where no suffix does."""
    group = parser.add_argument_group("Streams")
    group.add_argument(
        "--input-format",
        **chosen_from(
            read, f"what is read from standard input (default {usual}), or from a file whose suffix does not tell"
        ),
    )
    if written:
        group.add_argument("--format", **chosen_from(written, "what is written to standard output (-o -)"))


def add_each(parser: argparse.ArgumentParser) -> None:
    """Add the options of a batch."""
    group = parser.add_argument_group("Many studies")
    group.add_argument(
        "--each",
        action="store_true",
        help="STUDY is a folder of studies, each reconstructed into the folder MESH: NAME.stl (or --format), its "
        "report NAME.json, and all in reports.csv; what is finished is passed over",
    )
    group.add_argument(
        "--each-label",
        action="store_true",
        help="each label of a label map, or each of --select, is reconstructed by itself into the folder MESH: "
        "label-0005-NAME.stl (or --format), its report .json beside it, and all in reports.csv; the map is read once",
    )
    group.add_argument(
        "--label-names",
        metavar="FILE",
        help="names of the labels, for --each-label and --select: a table .csv or .tsv, .json, or the text of "
        "FreeSurfer, ITK-SNAP or 3D Slicer; where not given, those in the label map's own file",
    )
    group.add_argument("--force", action="store_true", help="reconstruct again what is finished")


def add_scale(parser: argparse.ArgumentParser) -> None:
    """Add the options of many processes, and of what is larger than the memory."""
    group = parser.add_argument_group("Many processes, and studies larger than the memory")
    group.add_argument(
        "--workers",
        type=int,
        metavar="N",
        help="work on N studies of --each, or slabs of one study, at once, each in a process of its own, with Dask",
    )
    group.add_argument(
        "--scheduler",
        metavar="ADDRESS|FILE",
        help="work on as many of them at once as a Dask cluster has threads: its scheduler's address, or the file that "
        "the scheduler wrote; its machines see the same folders",
    )
    group.add_argument(
        "--memory",
        metavar="SIZE",
        help="work on one study slab by slab, each process within so much memory, as 4GB or 500MiB; its voxels, and "
        "the mesh around them, are never whole",
    )
    group.add_argument(
        "--slab", type=int, metavar="N", help="slices of a slab, in place of as many as the memory holds"
    )
    group.add_argument(
        "--pieces",
        type=int,
        metavar="N",
        help="write a mesh that was made slab by slab as N files, NAME-001.ply and so on, that weld exactly",
    )
    group.add_argument(
        "--neuroglancer",
        metavar="FOLDER",
        help="write levels of detail of such a mesh too, as Neuroglancer reads them",
    )


def add_outputs(parser: argparse.ArgumentParser, *files: str) -> Any:
    """Add the options that name further files; what is shown goes with `add_settings`."""
    kinds = {
        "points": ("FILE", f"write the points: {POINT}"),
        "labels": ("FILE", f"write the regions on the study's own grid: {LABEL}"),
        "mask_out": ("FILE", f"write the voxels inside the mesh on the study's own grid: {LABEL}"),
        "figures": ("FOLDER", "write the pictures"),
        "html": ("FILE.html", HTML),
        "slicer": ("FILE.mrml", "write a scene that opens study and mesh together in 3D Slicer"),
    }
    group = parser.add_argument_group("More results")
    for name in files:
        metavar, text = kinds[name]
        group.add_argument(option_of(name), metavar=metavar, help=text)
    group.add_argument("--report", metavar="FILE.json", help="write the report")
    group.add_argument("--save-settings", metavar="FILE.toml", help="write the settings of this run, to repeat it")
    return group


def add_settings(
    parser: argparse.ArgumentParser, groups: tuple[str, ...], *, without: tuple[str, ...] = (), paper: bool = True
) -> None:
    """Add an option for each parameter of some groups but a few, and those that choose or show them all."""
    sections = {
        entry.name: parser.add_argument_group(_title(entry.name)) for entry in fields(Settings) if entry.name in groups
    }
    for group, entry in parameters():
        if group in sections and entry.name not in without:
            add_parameter(sections[group], entry)
    if "window" in sections:
        sections["window"].add_argument(
            "--auto", action="store_true", help="take Otsu's threshold, as is done where no window is given"
        )
    if paper:
        _add_run(sections["run"])


def _add_run(group: argparse._ArgumentGroup) -> None:
    """Add the options that choose or show all settings, and those of what is printed."""
    group.add_argument("--paper", action="store_true", help="take the paper's own choices as defaults")
    group.add_argument("--settings", metavar="FILE.toml", help="read settings; options given here win over them")
    group.add_argument("--quiet", action="store_true", help="print nothing but errors")
    group.add_argument("--json", action="store_true", help="print the report as JSON in place of the summary")


def _title(section: str) -> str:
    """Return the first line of a group's docstring."""
    return (getattr(Settings(), section).__doc__ or section).splitlines()[0].rstrip(".")
