"""Many studies, one after the other, with the same settings."""

from __future__ import annotations

import json
import os
import sys
import time
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import BatchError, UsageError, printable
from . import summary
from .faults import as_error
from .outputs.checks import check_files, check_folder, check_frame, make_folder
from .records import COLUMNS, finished, record_of, row_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..results import Surface
    from ..settings import Settings

    Work = Callable[[Namespace, Settings], Surface]

TABLE = "reports.csv"
USUAL = "stl"
"""Format of the meshes where none is asked for."""
SINGLE = ("labels_in", "points", "labels", "mask_out", "figures", "report")
"""Files of one study, which a batch has no place for."""


def reconstruct_each(chosen: Namespace, settings: Settings, work: Work) -> None:
    """Reconstruct every study of a folder; what fails does not stop the rest.

    Parameters
    ----------
    chosen : Namespace
        What was asked for: `study` is the folder of studies, `output` that of the results.
    settings : Settings
    work : callable
        Reads, reconstructs and writes the one study that it is given in `chosen`, and returns its surface.

    Raises
    ------
    BatchError
        At the end, where studies failed.
    UsageError
        For options that are for one study.
    """
    folder = _checked(chosen, settings)
    studies = io.find_studies(chosen.study, without=[folder], series=settings.read.series)
    make_folder(folder)
    rows: list[dict[str, Any]] = []
    try:
        for number, study in enumerate(studies, 1):
            place = printable(f"{number}/{len(studies)} {study.name}")
            if not chosen.quiet:
                print(place, file=sys.stderr)
            rows.append(_done(study, chosen, settings, folder, work))
            if not (chosen.quiet or chosen.json):
                print(summary.of_row(place, rows[-1]), flush=True)
    finally:
        io.write_table(rows, COLUMNS, folder / TABLE)
    if chosen.save_settings:
        io.write_settings(settings, chosen.save_settings)
    if chosen.json:
        print(json.dumps(rows, indent=2))
    _tell_failures(chosen, rows)


def _checked(chosen: Namespace, settings: Settings) -> Path:
    """Return the folder of the results; refuse what does not go with many studies."""
    single = [f"--{name.replace('_', '-')}" for name in SINGLE if getattr(chosen, name)]
    if single:
        raise UsageError("this option is for one study", found=f"{single[0]} with --each", hint="no --each")
    if not isinstance(chosen.study, str):
        raise UsageError("there is no folder of studies", expected="one STUDY, with --each")
    if chosen.output == "-" or os.path.realpath(chosen.output) == os.path.realpath(chosen.study):
        raise UsageError("--each writes into a folder of its own", file=chosen.output, hint="another folder")
    if Path(chosen.output).is_file():
        raise UsageError("--each writes into a folder", file=chosen.output, expected="a folder")
    check_frame(Path(chosen.output, f"NAME.{chosen.format or USUAL}"), settings)
    check_files(chosen)
    return check_folder(chosen.output)


def _done(study: io.Study, chosen: Namespace, settings: Settings, folder: Path, work: Work) -> dict[str, Any]:
    """Return a study's row: of its report, or of its fault; of a fault only words are kept, not what it holds on to."""
    try:
        asked = settings if study.series is None else settings.replace(series=study.series)
        mesh, told = (folder / f"{study.name}.{suffix}" for suffix in (chosen.format or USUAL, "json"))
        state = study.state
        report = None if chosen.force else finished(told, mesh, asked, state)
        if report is not None:
            return row_of(study.name, report) | {"passed": True}
        return row_of(study.name, _worked(study, chosen, asked, (mesh, told, state), work))
    except BrokenPipeError:
        raise
    except Exception as fault:
        error = as_error(fault)
        return {"name": study.name, "exit_code": error.exit_code, "error": str(error)}


def _worked(
    study: io.Study, chosen: Namespace, settings: Settings, outputs: tuple[Path, Path, str], work: Work
) -> dict[str, Any]:
    """Reconstruct one study; its report is written last, so that it stands for the whole."""
    mesh, told, state = outputs
    single = {"study": str(study.path), "output": str(mesh), "save_settings": None}
    start = time.perf_counter()
    report = work(Namespace(**vars(chosen) | single), settings).report
    report = report | {"batch": record_of(mesh, state, time.perf_counter() - start)}
    io.write_document(report, told)
    return report


def _tell_failures(chosen: Namespace, rows: list[dict[str, Any]]) -> None:
    failed = [row for row in rows if row["exit_code"]]
    if not (chosen.quiet or chosen.json):
        print(printable(summary.of_batch(rows, chosen.output)))
    for row in failed:
        print(printable(f"failed    {row['name']}: {row['error']}"), file=sys.stderr)
    if failed:
        raise BatchError(f"{len(failed)} of {len(rows)} studies failed", file=str(Path(chosen.output, TABLE)))
