"""What each command does: read, call, write. Heavy imports happen here, once a command is known to run."""

from __future__ import annotations

import json
import os
from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import io
from ..errors import OutputError, UnreadableError, UsageError
from ..settings import Settings, parameters
from . import summary
from .bars import Bars

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..model.volume import Volume
    from ..results import Segmentation, Surface


def run(chosen: Namespace) -> None:
    """Run the command that was parsed."""
    _COMMANDS[chosen.command](chosen)


def settings_of(chosen: Namespace) -> Settings:
    """Build the settings: the defaults or the paper's, then a file's, then the options given."""
    settings = Settings.for_paper() if getattr(chosen, "paper", False) else Settings()
    if getattr(chosen, "settings", None):
        settings = io.read_settings(chosen.settings, base=settings)
    given = {entry.name: getattr(chosen, entry.name) for _, entry in parameters() if hasattr(chosen, entry.name)}
    if getattr(chosen, "auto", False) and {"lower", "upper", "preset"} & set(given):
        raise UsageError("two windows are asked for", found="--auto and a window", expected="one of them")
    return settings.replace(**given)


def _demo(chosen: Namespace) -> None:
    settings = settings_of(chosen)
    folder = _check_folder(chosen.output)
    from ..phantom import phantom
    from ..pipeline import reconstruct

    with Bars(quiet=chosen.quiet) as progress:
        progress("phantom", 0, 1)
        head = phantom(seed=settings.run.seed)
        progress("phantom", 1, 1)
        settings = settings.replace(lower=head.lower, upper=head.upper)
        surface = reconstruct(head.volume, settings, truth=head.truth, progress=progress)
        _make(folder)
        io.write_mesh(head.truth, folder / "truth.ply")
        outputs = Namespace(
            output=folder / "mesh.stl", points=folder / "points.ply", labels=folder / "labels.nii.gz",
            report=folder / "report.json", save_settings=folder / "settings.toml", figures=folder / "figures",
        )  # fmt: skip
        _write(outputs, surface, settings, progress)
    _tell(chosen, surface.report, summary.of_surface(surface.report, str(chosen.output)))


def _reconstruct(chosen: Namespace) -> None:
    settings = settings_of(chosen)
    _check_outputs(chosen, io.MESH_WRITERS, *_sources(chosen, settings))
    from ..pipeline import reconstruct

    with Bars(quiet=chosen.quiet) as progress:
        volume, labels = _read(chosen, settings, progress)
        surface = reconstruct(volume, settings, labels=labels, progress=progress)
        _write(chosen, surface, settings, progress)
    _tell(chosen, surface.report, summary.of_surface(surface.report, chosen.output))


def _segment(chosen: Namespace) -> None:
    settings = settings_of(chosen)
    _check_outputs(chosen, io.POINT_WRITERS, *_sources(chosen, settings))
    from ..pipeline import segment

    with Bars(quiet=chosen.quiet) as progress:
        volume, labels = _read(chosen, settings, progress)
        found = segment(volume, settings, labels=labels, progress=progress)
        io.write_points(found.points, chosen.output, **_frame(found.report, settings))
        _write_stage_one(chosen, found)
        _write_documents(chosen, found.report, settings)
        _draw(chosen.figures, found, None, settings, progress)
    _tell(chosen, found.report, summary.of_points(found.report, chosen.output))


def _surface(chosen: Namespace) -> None:
    settings = settings_of(chosen)
    _check_outputs(chosen, io.MESH_WRITERS, chosen.cloud)
    from ..pipeline import reconstruct_points

    with Bars(quiet=chosen.quiet) as progress:
        progress("read", 0, 1)
        points = io.read_points(chosen.cloud)
        progress("read", 1, 1)
        surface = reconstruct_points(points, settings, progress=progress)
        _write(chosen, surface, settings, progress)
    _tell(chosen, surface.report, summary.of_surface(surface.report, chosen.output))


def _network(chosen: Namespace) -> None:
    settings = settings_of(chosen)
    folder = _check_folder(chosen.output)
    _check_files(chosen)
    from ..segment.region import train_region
    from ..segment.shapes import SHAPES, shape
    from ..show import save
    from .pictures import film_of_network, pictures_of_network

    given = chosen.region in SHAPES
    if not given and not Path(chosen.region).exists():
        regions = f"{' | '.join(SHAPES)} | a PNG or TIFF file"
        raise UnreadableError("there is no such region", file=chosen.region, expected=regions)
    inputs, area = shape(chosen.region) if given else (_window_of_picture(chosen.region, settings), 1.0)
    trained = train_region(inputs, settings.network, seed=settings.run.seed, pixel_area=area)
    _make(folder)
    title = f"A network over a {chosen.region if given else 'picture'}"
    axes = slice(None if given else 2)  # a neuron's place in a picture is its column and row
    for name, figure in pictures_of_network(trained, title, axes):
        save(figure, folder / f"{name}.png")
    if chosen.film:
        with io.replacing(folder / "02-film.gif") as file:
            file.write(film_of_network(trained, settings, area, title, axes))
    report = {"network": trained.measures, "settings": settings.to_dict()}
    _write_documents(chosen, report, settings)
    _tell(chosen, report, summary.of_network(report, chosen.output))


def _window_of_picture(path: str, settings: Settings) -> NDArray[np.float64]:
    """Return the window's pixels of one picture as (column, -row[, layer]), so that up stays up."""
    import numpy as np

    from ..segment.signal import pixels_of
    from ..segment.window import by_layer, choose_window, window

    picture = io.read_picture(path)
    lower, upper = choose_window(picture, settings.window)
    mask = window(picture, lower=lower, upper=upper, layers=settings.window.layers)[0]
    if picture.layers > 1 and settings.network.inputs == "layers":
        mask = by_layer(picture, lower=lower, upper=upper)[0] & mask[..., None]
    pixels = pixels_of(mask)
    return np.asarray(pixels * np.array([1.0, -1.0, 1.0])[: pixels.shape[1]])


def _inspect(chosen: Namespace) -> None:
    from ..segment.survey import survey

    volume = io.read_volume(chosen.study, settings=settings_of(chosen).read)
    found = survey(volume)
    print(json.dumps(found, indent=2) if chosen.json else "\n".join(summary.of_study(found)))


def _check(chosen: Namespace) -> None:
    if chosen.report:
        io.check_output(chosen.report, (".json",), inputs=[chosen.mesh])
    from ..measure.report import assess

    other = io.read_mesh(chosen.against) if chosen.against else None
    report = assess(io.read_mesh(chosen.mesh), against=other)
    if chosen.report:
        io.write_document(report, chosen.report)
    print(json.dumps(report, indent=2) if chosen.json else "\n".join(summary.of_check(report)))


_COMMANDS = {
    "demo": _demo,
    "reconstruct": _reconstruct,
    "segment": _segment,
    "surface": _surface,
    "network": _network,
    "inspect": _inspect,
    "check": _check,
}


def _sources(chosen: Namespace, settings: Settings) -> list[str]:
    """Return the files that are read; refuse a label map without labels, and a command without any."""
    sources = [path for path in (chosen.study, chosen.labels_in) if path]
    if not sources:
        raise UsageError("there is no study", expected="STUDY, or --labels-in with --select")
    if chosen.labels_in and settings.window.select is None:
        raise UsageError(
            "no label was chosen", found=f"--labels-in {chosen.labels_in}", expected="--select with its labels"
        )
    return sources


def _read(chosen: Namespace, settings: Settings, progress: Bars) -> tuple[Volume, Volume | None]:
    """Read the study, and the label map where there is one beside it."""
    total = 2 if chosen.study and chosen.labels_in else 1
    progress("read", 0, total)
    volume = io.read_volume(chosen.study or chosen.labels_in, settings=settings.read)
    labels = io.read_volume(chosen.labels_in, settings=settings.read) if total == 2 else None
    progress("read", total, total)
    return volume, labels


def _check_folder(path: str | Path) -> Path:
    """Refuse a folder that could not be made, before any work is done."""
    folder = Path(path)
    there = folder if folder.exists() else Path(os.path.realpath(folder)).parent
    if not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        raise OutputError("the folder cannot be made", file=str(path), expected="a place that can be written to")
    return folder


def _make(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as fault:
        raise OutputError("the folder cannot be made", file=str(folder), found=fault.strerror or "") from fault


def _check_outputs(chosen: Namespace, writers: Any, *sources: str) -> None:
    io.check_output(chosen.output, writers, inputs=list(sources))
    _check_files(chosen, *sources, chosen.output)


def _check_files(chosen: Namespace, *taken: str) -> None:
    """Refuse further outputs that could not be written, or that would overwrite another file of this run."""
    kinds = {"points": io.POINT_WRITERS, "labels": io.LABEL_WRITERS, "report": (".json",), "save_settings": (".toml",)}
    names = list(taken)
    for name, suffixes in kinds.items():
        if getattr(chosen, name, None):
            io.check_output(getattr(chosen, name), suffixes, inputs=names)
            names.append(getattr(chosen, name))
    if getattr(chosen, "figures", None):
        _check_folder(chosen.figures)


def _write(chosen: Namespace, surface: Surface, settings: Settings, progress: Bars) -> None:
    """Write the mesh, and whatever else was asked for."""
    stage_one = surface.segmentation
    frame = _frame(surface.report, settings)
    at_vertices, on_faces = _fields(surface, chosen.output)
    io.write_mesh(surface.mesh, chosen.output, **frame, vertex_fields=at_vertices, face_fields=on_faces)
    if getattr(chosen, "points", None):
        io.write_points(surface.points, chosen.points, **frame)
    if stage_one is not None:
        _write_stage_one(chosen, stage_one)
    _write_documents(chosen, surface.report, settings)
    _draw(chosen.figures, stage_one, surface, settings, progress)


def _frame(report: dict[str, Any], settings: Settings) -> dict[str, str]:
    """Name unit and frame: a study is written in patient millimeters, a cloud in whatever its numbers are in."""
    if "study" in report:
        return {"unit": "mm", "frame": "LPS"}
    corner = ",".join(repr(place).removesuffix(".0") for place in report["points"]["origin"])
    return {"unit": settings.run.units, "frame": f"local:{corner}" if settings.run.local_origin else "unknown"}


def _fields(surface: Surface, output: str | Path) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """Return what the format keeps beside the mesh: what is known of the points, and which faces were filled."""
    from ..surface.attributes import carry

    points = surface.points
    kept = {name: values for name, values in points.attributes.items() if io.keeps(output, name)}
    at_vertices = carry(replace(points, attributes=kept), surface.mesh.vertices)
    if not io.keeps(output, "filled", on_faces=True):
        return at_vertices, {}
    filled = surface.filled
    if filled is None and surface.segmentation is not None:
        filled = surface.cap_faces
    return at_vertices, {} if filled is None else {"filled": filled}


def _write_stage_one(chosen: Namespace, found: Segmentation) -> None:
    if getattr(chosen, "labels", None):
        io.write_labels(found.labels, found.volume, chosen.labels)


def _write_documents(chosen: Namespace, report: dict[str, Any], settings: Settings) -> None:
    if chosen.report:
        io.write_document(report, chosen.report)
    if chosen.save_settings:
        io.write_settings(settings, chosen.save_settings)


def _draw(
    folder: str | Path | None,
    stage_one: Segmentation | None,
    surface: Surface | None,
    settings: Settings,
    progress: Bars,
) -> None:
    """Draw the paper's figures of whatever stages there are."""
    if folder is None:
        return
    from ..show import save
    from .pictures import pictures

    where = Path(folder)
    _make(where)
    done, expected = 0, 10 if surface else 6
    for done, (name, figure) in enumerate(pictures(stage_one, surface, settings), 1):
        progress("pictures", done - 1, max(expected, done))
        save(figure, where / f"{name}.png")
    progress("pictures", done, done)


def _tell(chosen: Namespace, report: dict[str, Any], lines: list[str]) -> None:
    if chosen.json:
        print(json.dumps(report, indent=2))
    elif not chosen.quiet:
        print("\n".join(lines))
