"""Many studies with the same settings: one after the other, or several at once."""

from __future__ import annotations

import json
import os
import sys
import time
from argparse import Namespace
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import BatchError, UsageError, printable
from ..settings import option_of
from . import summary
from .faults import as_error
from .outputs.checks import check_files, check_folder, check_frame, check_page, make_folder
from .records import finished, record_of, row_of, row_of_fault
from .spread import Batch, check_workers, spread_rows

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Sequence

    from ..results import Surface
    from ..settings import Settings
    from .records import Row

    Work = Callable[[Namespace, Settings], Surface]

TABLE = "reports.csv"
PAGE = ".html"
"""Suffix of the page beside a mesh, where --html asks for an index of them."""
USUAL = "stl"
"""Format of the meshes where none is asked for."""
OF_ONE = ("memory", "slab", "pieces", "neuroglancer")
"""Options of one study that is worked on slab by slab."""
SINGLE = ("labels_in", "points", "labels", "mask_out", "figures", "report", "slicer", *OF_ONE)
"""Options of one study, which a batch has no place for."""


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
    do_all(Batch(studies, chosen, settings, folder, partial(done, work=work)))


def do_all(batch: Batch) -> None:
    """Do all studies of a batch, and tell what became of them.

    Raises
    ------
    BatchError
        At the end, where some failed.
    """
    _refuse_same_page(batch)
    rows, chosen = _rows(batch), batch.chosen
    if chosen.save_settings:
        io.write_settings(batch.settings, chosen.save_settings)
    if chosen.html:
        _write_index(batch, rows)
    if chosen.json:
        print(json.dumps(rows, indent=2))
    _tell_failures(batch, rows)


def _rows(batch: Batch) -> list[Row]:
    """Do all studies, and write the table of those that were done, whatever ends the work."""
    chosen = batch.chosen
    found: dict[int, Row] = {}
    try:
        with closing(spread_rows(batch) if chosen.workers or chosen.scheduler else _rows_in_turn(batch)) as coming:
            for number, row in coming:
                found[number] = row
                if not (chosen.quiet or chosen.json):
                    print(summary.of_row(batch.place(number), row), flush=True)
    finally:
        rows = [found[number] for number in sorted(found)]
        if rows:
            io.write_table(rows, batch.columns, batch.folder / TABLE)
    return rows


def _refuse_same_page(batch: Batch) -> None:
    """Refuse an index with the name of a study's own page."""
    html = batch.chosen.html
    pages = {os.path.realpath(batch.folder / f"{study.name}{PAGE}") for study in batch.studies} if html else set()
    if html and os.path.realpath(html) in pages:
        raise UsageError("the index has the name of a study's own page", file=html, hint="--html with another name")


def _write_index(batch: Batch, rows: list[Row]) -> None:
    """Write the page that leads to that of each study."""
    from ..html.index import index
    from .outputs.html import command_of, write_page

    chosen = batch.chosen
    folder = os.path.relpath(os.path.realpath(batch.folder), os.path.realpath(Path(chosen.html).parent))
    named = "" if folder == os.curdir else Path(folder).as_posix()
    text = index(printable(batch.folder.name), rows, folder=named, command=command_of(chosen))
    write_page(text, chosen.html)


def refuse_for_one(chosen: Namespace) -> None:
    """Refuse what is for many studies, where there is one.

    Raises
    ------
    UsageError
    """
    if chosen.force:
        raise UsageError("this option is for many studies", found="--force without --each", hint="--each")


def _checked(chosen: Namespace, settings: Settings) -> Path:
    """Return the folder of the results; refuse what does not go with many studies."""
    refuse_with("--each", SINGLE, chosen)
    if settings.cubes.shared_walls:
        raise UsageError("walls are shared among the labels of one map", found="--shared-walls", hint="--each-label")
    if not isinstance(chosen.study, str):
        raise UsageError("there is no folder of studies", expected="one STUDY, with --each")
    check_workers(chosen)
    return check_results("--each", chosen, settings)


def refuse_with(many: str, names: Sequence[str], chosen: Namespace) -> None:
    """Refuse options that have no place where the option `many` makes many meshes of one command.

    Raises
    ------
    UsageError
    """
    given = [option_of(name) for name in names if getattr(chosen, name) not in (None, False)]
    if given:
        raise UsageError("this option is for one mesh", found=f"{given[0]} with {many}", hint=f"no {many}")


def check_results(many: str, chosen: Namespace, settings: Settings) -> Path:
    """Return the folder of many results; refuse one that cannot be, before any work.

    Raises
    ------
    UsageError, OutputError
    """
    same = isinstance(chosen.study, str) and os.path.realpath(chosen.output) == os.path.realpath(chosen.study)
    if chosen.output == "-" or same:
        raise UsageError(f"{many} writes into a folder of its own", file=chosen.output, hint="another folder")
    if Path(chosen.output).is_file():
        raise UsageError(f"{many} writes into a folder", file=chosen.output, expected="a folder")
    check_frame(Path(chosen.output, f"NAME.{chosen.format or USUAL}"), settings)
    check_files(Namespace(**vars(chosen) | {"html": None}))
    folder = check_folder(chosen.output)
    check_page(chosen, folder)
    return folder


def _rows_in_turn(batch: Batch) -> Generator[tuple[int, Row]]:
    """Yield the number of each study, from 0, and its row, one after the other."""
    make_folder(batch.folder)
    for number, study in enumerate(batch.studies):
        if not batch.chosen.quiet:
            print(batch.place(number), file=sys.stderr)
        yield number, batch.done(study, batch.chosen, batch.settings, batch.folder)


def done(study: io.Study, chosen: Namespace, settings: Settings, folder: Path, work: Work) -> Row:
    """Return a study's row: of its report, or of its fault; of a fault only words are kept, not what it holds on to."""
    try:
        asked = settings if study.series is None else settings.replace(series=study.series)
        mesh, told = (folder / f"{study.name}.{suffix}" for suffix in (chosen.format or USUAL, "json"))
        state = study.state
        again = chosen.force or (chosen.html and not told.with_suffix(PAGE).is_file())
        report = None if again else finished(told, mesh, asked, state)
        if report is not None:
            return row_of(study.name, report) | {"passed": True}
        return row_of(study.name, _worked(study, chosen, asked, (mesh, told, state), work))
    except BrokenPipeError:
        raise
    except Exception as fault:
        return row_of_fault(study.name, as_error(fault))


def _worked(
    study: io.Study, chosen: Namespace, settings: Settings, outputs: tuple[Path, Path, str], work: Work
) -> dict[str, Any]:
    """Reconstruct one study; its report is written last, so that it stands for the whole."""
    mesh, told, state = outputs
    single = {"study": str(study.path), "output": str(mesh), "save_settings": None}
    single |= {"html": str(told.with_suffix(PAGE)) if chosen.html else None}
    start = time.perf_counter()
    report = work(Namespace(**vars(chosen) | single), settings).report
    report = report | {"batch": record_of(mesh, state, time.perf_counter() - start)}
    io.write_document(report, told)
    return report


def _tell_failures(batch: Batch, rows: list[Row]) -> None:
    chosen = batch.chosen
    failed = [row for row in rows if row["exit_code"]]
    if not (chosen.quiet or chosen.json):
        print(printable(summary.of_batch(rows, chosen.output)))
    for row in failed:
        print(printable(f"failed    {row['name']}: {row['error']}"), file=sys.stderr)
    if failed:
        raise BatchError(f"{len(failed)} of {len(rows)} {batch.of} failed", file=str(Path(chosen.output, TABLE)))
