"""What each command does: read, call, write. Heavy imports happen here, once a command is known to run."""

from __future__ import annotations

import json
import time
from argparse import Namespace
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import UsageError, printable
from ..memory.limit import memory_limit
from ..settings import Settings, option_of, parameters
from . import summary
from .against import compared, is_mesh
from .bars import Bars, bars_of
from .batch import reconstruct_each, refuse_for_one
from .each_label import reconstruct_each_label
from .large import is_large, reconstruct_in_slabs
from .options.likely import require_kind
from .outputs.checks import (
    OF_STUDIES,
    check_archive,
    check_files,
    check_folder,
    check_frame,
    check_outputs,
    check_page,
    make_folder,
)
from .outputs.parts import frame_of_mesh, frame_of_part
from .outputs.slicer import check_place, check_scene
from .outputs.write import (
    draw,
    draw_network,
    write_documents,
    write_points,
    write_stage_one,
    write_surface,
)
from .sources import gathered, numbered, read_study, region_of, sources_of
from .streams import streamed

if TYPE_CHECKING:
    from ..model.mesh import TriMesh
    from ..model.volume import Volume
    from ..results import Surface


def run(chosen: Namespace) -> None:
    """Run the command that was parsed."""
    with streamed(gathered(chosen)) as named:
        require_kind(named)
        _COMMANDS[named.command](numbered(named))


def settings_of(chosen: Namespace) -> Settings:
    """Build the settings: the defaults or the paper's, then a file's, then the options given."""
    paper = getattr(chosen, "paper", False) or getattr(chosen, "way", "") == "paper"
    settings = Settings.for_paper() if paper else Settings()
    if getattr(chosen, "settings", None):
        settings = io.read_settings(chosen.settings, base=settings)
    given = given_of(chosen)
    if getattr(chosen, "auto", False) and {"lower", "upper", "preset"} & set(given):
        raise UsageError("two windows are asked for", found="--auto and a window", expected="one of them")
    return settings.replace(**given)


def given_of(chosen: Namespace) -> dict[str, Any]:
    """Return the parameters that were given as options."""
    return {entry.name: getattr(chosen, entry.name) for _, entry in parameters() if hasattr(chosen, entry.name)}


def _demo(chosen: Namespace) -> None:
    settings = settings_of(chosen)
    folder = check_folder(chosen.output)
    check_page(chosen, folder)
    from ..head_phantom import phantom
    from ..pipeline import reconstruct

    with Bars(quiet=chosen.quiet) as progress:
        progress("phantom", 0, 1)
        head = phantom(seed=settings.run.seed)
        progress("phantom", 1, 1)
        settings = settings.replace(lower=head.lower, upper=head.upper)
        surface = reconstruct(head.volume, settings, truth=head.truth, progress=progress)
        make_folder(folder)
        io.write_mesh(head.closed_truth, folder / "truth.ply", precision=settings.run.precision)
        outputs = Namespace(
            output=folder / "mesh.stl", points=folder / "points.ply", labels=folder / "labels.nii.gz",
            report=folder / "report.json", save_settings=folder / "settings.toml", figures=folder / "figures",
            html=chosen.html or folder / "report.html", words=chosen.words,
        )  # fmt: skip
        surface = write_surface(outputs, surface, settings, progress)
    _tell(chosen, surface.report, summary.of_surface(surface.report, str(chosen.output)))


def _reconstruct(chosen: Namespace) -> None:
    settings = settings_of(chosen)
    if chosen.each and not chosen.each_label:
        reconstruct_each(chosen, settings, _reconstruct_one)
        return
    if chosen.each_label:
        reconstruct_each_label(chosen, settings, given_of(chosen), _reconstruct_one)
        return
    refuse_for_one(chosen)
    if is_large(chosen):
        surface = reconstruct_in_slabs(chosen, settings, given_of(chosen))
    else:
        surface = _reconstruct_one(chosen, settings)
    _tell(chosen, surface.report, summary.of_surface(surface.report, _shown(chosen)))


def _reconstruct_one(chosen: Namespace, settings: Settings) -> Surface:
    check_outputs(chosen, OF_STUDIES, *sources_of(chosen, settings))
    check_frame(chosen.output, settings)
    check_scene(chosen, settings)
    from ..pipeline import reconstruct, reconstruct_once

    def read() -> tuple[Volume, Volume | None]:
        volume, labels = read_study(chosen, settings, progress)
        check_archive(chosen, volume)
        check_place(chosen, settings, volume)
        return volume, labels

    with bars_of(chosen) as progress:
        if chosen.figures or chosen.labels or chosen.mask_out or chosen.html:
            volume, labels = read()
            surface = reconstruct(volume, settings, labels=labels, progress=progress, **given_of(chosen))
        else:
            surface = reconstruct_once(read, settings, progress=progress, **given_of(chosen))
        return write_surface(chosen, surface, settings, progress)


def _segment(chosen: Namespace) -> None:
    settings = settings_of(chosen)
    check_outputs(chosen, io.POINT_WRITERS, *sources_of(chosen, settings))
    from ..pipeline import segment
    from ..stage import Stage

    with Bars(quiet=chosen.quiet) as progress:
        volume, labels = read_study(chosen, settings, progress)
        found = segment(volume, settings, labels=labels, progress=progress, **given_of(chosen))
        written = write_points(found.points, found, chosen.output, settings)
        found = replace(found, stages=(*found.stages, Stage(None, {"written": written})))
        write_stage_one(chosen, found)
        write_documents(chosen, found.report, settings)
        draw(chosen.figures, found, None, settings, progress)
    _tell(chosen, found.report, summary.of_points(found.report, _shown(chosen)))


def _surface(chosen: Namespace) -> None:
    settings = settings_of(chosen)
    if settings.run.frame != "lps":
        raise UsageError(
            "a cloud keeps its own frame", found=f"--frame = {settings.run.frame}", expected="a study, for --frame"
        )
    check_outputs(chosen, io.MESH_WRITERS, chosen.cloud)
    from ..pipeline import reconstruct_points

    with memory_limit(chosen.memory), Bars(quiet=chosen.quiet) as progress:
        progress("read", 0, 1)
        points = io.read_points(chosen.cloud, settings=settings.cloud, roi=settings.crop.roi)
        progress("read", 1, 1)
        surface = reconstruct_points(points, settings, progress=progress, **given_of(chosen))
        surface = write_surface(chosen, surface, settings, progress)
        report = surface.report
    _tell(chosen, report, summary.of_surface(report, _shown(chosen)))


def _network(chosen: Namespace) -> None:
    settings = settings_of(chosen)
    settings = replace(settings, network=settings.network.taking(settings.network.detailed or "ring"))
    folder = check_folder(chosen.output)
    check_files(chosen)
    from ..effect import without_effect
    from ..som.region import train_region

    inputs, area, notes = region_of(chosen.region, settings)
    trained = train_region(inputs, settings.network, seed=settings.run.seed, pixel_area=area)
    make_folder(folder)
    draw_network(folder, chosen, trained, settings, area)
    warnings = notes + without_effect(settings, given_of(chosen), input="color")  # a picture may be in color
    report = {"network": trained.measures, "settings": settings.to_dict(), "warnings": warnings}
    write_documents(chosen, report, settings)
    _tell(chosen, report, summary.of_network(report, chosen.output))


def _inspect(chosen: Namespace) -> None:
    from .inspect.findings import of_study
    from .inspect.inspection import inspected

    found = inspected(chosen.study, settings_of(chosen), typed=getattr(chosen, "typed", ""))
    _say(found, None if chosen.json else of_study(found))


def _check(chosen: Namespace) -> None:
    check_files(chosen, chosen.mesh)
    from ..measure.report import assess
    from ..measure.winding import linings

    settings = settings_of(chosen)
    _refuse_voxels_of_nothing(chosen, settings)
    mesh = io.read_mesh(chosen.mesh)
    report = assess(mesh, cavities=linings(mesh))
    if chosen.against:
        found = compared(chosen, mesh, settings)
        report |= {key: found.pop(key) for key in [*found] if key == "dice" or key.endswith("_mm")}
        report["against"] = found
    if chosen.print_check:
        report["print"] = _verdict(chosen, mesh, settings)
    if chosen.report:
        io.write_document(report, chosen.report)
    if chosen.html:
        from .outputs.html import write_mesh_html

        write_mesh_html(chosen, report, mesh, summary.of_check(report), **frame_of_mesh(chosen.mesh))
    _say(report, None if chosen.json else summary.of_check(report))


def _refuse_voxels_of_nothing(chosen: Namespace, settings: Settings) -> None:
    of_study = given_of(chosen).keys() - {entry.name for entry in fields(settings.printing)}
    if of_study and (not chosen.against or is_mesh(chosen.against)):
        asked_for = ", ".join(map(option_of, sorted(of_study)))
        raise UsageError("there is no study to choose voxels of", found=asked_for, expected="--against STUDY")


def _verdict(chosen: Namespace, mesh: TriMesh, settings: Settings) -> dict[str, Any]:
    """Tell whether a mesh can be printed, in the unit and frame that its file states."""
    from ..printing.part import PRINTED_MM, resized, turned
    from ..printing.verdict import verdict

    named = frame_of_mesh(chosen.mesh)
    asked = turned(settings.printing, named["frame"])
    return verdict(resized(mesh, PRINTED_MM[named["unit"]]), asked)


def _print(chosen: Namespace) -> None:
    settings = settings_of(chosen)
    check_outputs(chosen, io.MESH_WRITERS, chosen.mesh)
    from ..printing.part import make_part, turned

    with Bars(quiet=chosen.quiet) as progress:
        mesh = io.read_mesh(chosen.mesh)
        named = frame_of_mesh(chosen.mesh, given_of(chosen).get("units"))
        asked = replace(settings, printing=turned(settings.printing, named["frame"]))
        part = make_part(mesh, asked, unit=named["unit"], progress=progress)
        named = frame_of_part(named, settings.printing.scale)
        io.write_mesh(
            part.mesh, chosen.output, unit=named["unit"], frame=named["frame"], z_up=True,
            precision=settings.run.precision,
        )  # fmt: skip
    in_file = io.frame_in_file(chosen.output, **named)
    written = {"unit": in_file.unit, "frame": in_file.name}
    report = {"print": part.report, "written": written, "settings": settings.to_dict()}
    if chosen.report:
        io.write_document(report, chosen.report)
    said = summary.of_part(report["print"], _shown(chosen))
    if chosen.html:
        from .outputs.html import write_mesh_html

        write_mesh_html(chosen, report, part.mesh, said, **named)
    _tell(chosen, report, said)


def _view(chosen: Namespace) -> None:
    from .view import view

    view(chosen, settings_of(chosen), given_of(chosen))


_COMMANDS = {
    "demo": _demo,
    "reconstruct": _reconstruct,
    "segment": _segment,
    "surface": _surface,
    "network": _network,
    "inspect": _inspect,
    "check": _check,
    "print": _print,
    "view": _view,
}


def _shown(chosen: Namespace) -> str:
    """Name the output as it was typed."""
    return getattr(chosen, "shown", None) or str(chosen.output)


def _tell(chosen: Namespace, report: dict[str, Any], lines: list[str]) -> None:
    if chosen.json or not chosen.quiet:
        spent = f", computed in {time.perf_counter() - chosen.begun:.2f} s, reading and writing included"
        _say(report, None if chosen.json else [line + spent * line.startswith("written ") for line in lines])


def _say(report: dict[str, Any], lines: list[str] | None) -> None:
    """Print what was found: as JSON, which has its own escapes, or in words, where names may hold any character."""
    print(json.dumps(report, indent=2) if lines is None else "\n".join(map(printable, lines)))
