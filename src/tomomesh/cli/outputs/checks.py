"""What could not be written is refused before any work."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ... import io
from ...errors import OutputError, UsageError
from ...io.files.source import suffix_of
from ...io.slicer import SCENES

if TYPE_CHECKING:
    from argparse import Namespace

    from ...model.volume import Volume
    from ...settings import Settings

PAGES = (".html", ".htm")
"""Suffixes of pages for a browser."""
OF_STUDIES = (*io.MESH_WRITERS, *io.ARCHIVED)
"""Suffixes of meshes of a study."""


def check_folder(path: str | Path) -> Path:
    """Refuse a folder that could not be made, before any work is done.

    Raises
    ------
    OutputError
    """
    folder = Path(path)
    there = folder if folder.exists() else Path(os.path.realpath(folder)).parent
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        raise OutputError("the folder cannot be made", file=str(path), expected="a place that can be written to")
    return folder


def make_folder(folder: Path) -> None:
    """Make a folder, if it is not there.

    Raises
    ------
    OutputError
    """
    try:
        folder.mkdir(exist_ok=True)
    except OSError as fault:
        raise OutputError("the folder cannot be made", file=str(folder), found=fault.strerror or "") from fault


def check_outputs(chosen: Namespace, writers: Any, *sources: str) -> None:
    """Refuse outputs that could not be written, or that would overwrite what is read."""
    io.check_output(chosen.output, writers, inputs=list(sources))
    check_files(chosen, *sources, chosen.output)


def check_files(chosen: Namespace, *taken: str) -> None:
    """Refuse further outputs that could not be written, or that would overwrite another file of this run."""
    kinds = {
        "points": io.POINT_WRITERS,
        "labels": io.LABEL_WRITERS,
        "mask_out": io.LABEL_WRITERS,
        "report": (".json",),
        "html": PAGES,
        "slicer": SCENES,
        "save_settings": (".toml",),
    }
    names = list(taken)
    for name, suffixes in kinds.items():
        if getattr(chosen, name, None):
            io.check_output(getattr(chosen, name), suffixes, inputs=names)
            names.append(getattr(chosen, name))
    if getattr(chosen, "figures", None):
        check_folder(chosen.figures)


def check_page(chosen: Namespace, folder: Path) -> None:
    """Refuse a page that could not be written; it may lie in a folder that is made only once the work begins.

    Raises
    ------
    OutputError, UsageError
    """
    if not chosen.html:
        return
    page = Path(chosen.html)
    coming = not folder.exists() and os.path.realpath(page.parent) == os.path.realpath(folder)
    io.check_output(folder.parent / page.name if coming else page, PAGES, inputs=[])


def check_frame(output: str | Path, settings: Settings) -> None:
    """Refuse voxel indices of a part to print and in a format of lengths, before any work is done.

    Raises
    ------
    UsageError
    """
    if settings.run.frame == "voxel" and settings.printing.asked:
        raise UsageError("a part to print has no voxels", found="--frame = voxel", expected="--frame lps or ras")
    if settings.printing.asked and suffix_of(output) in io.ARCHIVED:
        raise UsageError("a part to print lies in no patient", file=str(output), expected="a mesh, or another format")
    if settings.run.frame == "voxel" and suffix_of(output) in (*io.LENGTHS, *io.ARCHIVED):
        raise UsageError(
            "3MF, GIFTI and DICOM hold lengths, not voxel indices", found=f"--frame = voxel, --output = {output}",
            expected="--frame lps or ras, or another format",
        )  # fmt: skip


def check_archive(chosen: Namespace, volume: Volume) -> None:
    """Refuse a mesh for the archive of what is no DICOM study, and personal fields in any other file.

    Raises
    ------
    UsageError
    """
    archived = suffix_of(chosen.output) in io.ARCHIVED
    if chosen.patient and not archived:
        raise UsageError("only a mesh for the archive names its patient", found="--patient", expected="-o MESH.dcm")
    if archived:
        io.check_archived(volume.dicom, file=str(chosen.output))
