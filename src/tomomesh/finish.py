"""What becomes of a mesh at the end of every way: checked, smoothed, made even, judged, a part to print, measured."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from .dynamics.fairing import fair
from .dynamics.low_pass import OneRing
from .dynamics.untangle import untangle
from .judgement import follow, require_one_wall
from .measure.intersections import CrossingFaces
from .measure.report import assess, compare
from .measure.topology import check_promise
from .remeshing.remesh import faces_under, remesh
from .stage import Stage, folded, timed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .model.mesh import TriMesh
    from .progress import Progress
    from .results import Surface
    from .settings import Settings
    from .stage import Later

LIKE = 1.25
"""How many times as large or small a volume may become where faces are made larger: what `judgement.LIMITS` allows most
ways of their window's. A limit, chosen: at default edges it stays within 0.1 % (measured)."""
PLAUSIBLE = 0.15
"""Difference from the volume of the rings over which a result is warned of. Measured on the built-in head and an MR:
0.4 and 0.0 %, and 4.5 % around loops."""


def finish(made: Surface, settings: Settings, progress: Progress) -> tuple[Stage[Surface], tuple[Later, ...]]:
    """Hand a mesh on as it is promised and asked for; return also what is measured once the report is read.

    Parameters
    ----------
    made : Surface
        As its way has left it.
    settings : Settings
    progress : callable

    Raises
    ------
    GeometryError
        Where it has two walls, or does not follow what it was made from.
    InternalCheckError
        Where it is not what is promised.
    """
    progress("checks", 0, 2)
    _check(made)
    walls = require_one_wall(made, settings)
    progress("checks", 2, 2)
    smooth = _smooth(made, settings, progress)
    even = _even(smooth.value, settings, progress)
    progress("judgement", 0, 1)
    judged = Stage(None, warnings=walls) if walls else _judged(even.value, smooth.value, settings)
    progress("judgement", 1, 1)
    part = _print(even.value, settings, progress)
    surface = part.value
    later: list[Later] = [partial(_measure, surface, settings, progress)]
    if surface.part is not None:
        later.append(partial(_judge_part, surface))
    return folded(surface, judged, smooth, even, part), tuple(later)


@timed("truth")
def compare_with(surface: Surface, truth: TriMesh) -> Stage[None]:
    """Measure the distance to the exact surface, both ways; the caps are no part of it."""
    return Stage(None, {"truth": compare(surface.mesh, truth, leave_out=surface.cap_faces)})


@timed("quality")
def _judged(made: Surface, finer: Surface, settings: Settings) -> Stage[None]:
    """Refuse a mesh that does not follow what it was made from, as it is to be written."""
    asked = settings.run.edge is not None or settings.run.target_faces is not None
    return follow(made, settings, finer=finer if asked else None)


def _check(made: Surface) -> None:
    check_promise(made.mesh, cavities=made.cavities, open_=made.borders)


def _even(made: Surface, settings: Settings, progress: Progress) -> Stage[Surface]:
    """Give the mesh even triangles, and no more faces than were asked for; not where neighbors share its faces."""
    even = settings.run.even and not settings.cubes.shared_walls
    return _remesh(made, settings, progress) if even else Stage(made)


@timed("remesh")
def _remesh(made: Surface, settings: Settings, progress: Progress) -> Stage[Surface]:
    run = settings.run
    low, near = (np.zeros(3), made.mesh) if made.borders else _from_corner(made.mesh)
    limited = (run.edge or run.target_faces) and not (made.borders or run.allow_far)
    found = remesh(
        near, edge=run.edge, most=run.target_faces, like=LIKE if limited else np.inf, crossing=made.crossing,
        threads=run.threads, progress=progress,
    )  # fmt: skip
    mesh, stats = found.mesh.moved(found.mesh.vertices + low), {"remesh": found.report}
    lined = made.cavities - found.left_out.linings
    even = replace(
        made, mesh=mesh, nearest=np.empty(0, np.int32), crossing=found.crossing, cavities=lined, cut_off=None
    )  # fmt: skip
    _check(even)
    if made.filled is None:
        return Stage(even, stats, found.warnings)
    some = made.filled.any()
    filled = made.filled[faces_under(mesh, made.mesh, run.threads)] if some else np.zeros(len(mesh.faces), np.bool_)
    return Stage(replace(even, filled=filled), stats | {"fit": {"filled_faces": int(filled.sum())}}, found.warnings)


def _from_corner(mesh: TriMesh) -> tuple[NDArray[np.float64], TriMesh]:
    """Count a mesh from its lowest corner, in steps of 2^-32 of its size, so that its place changes no face of it.

    The last bits of the numbers would, which differ from place to place, where edges are equally long. Borders of a
    sheet are to stay where they are, to the last bit.
    """
    low = mesh.vertices.min(axis=0)
    step = 2.0 ** (np.ceil(np.log2(max(float(np.ptp(mesh.vertices, axis=0).max()), 1e-300))) - 32)
    return low, mesh.moved(np.round((mesh.vertices - low) / step) * step)


def _smooth(made: Surface, settings: Settings, progress: Progress) -> Stage[Surface]:
    """Take away the detail that is shorter than what was asked for."""
    if settings.run.smooth <= 0:
        return Stage(made)
    progress("smooth", 0, 1)
    smooth = _faired(made, settings)
    progress("smooth", 1, 1)
    return smooth


@timed("smooth")
def _faired(made: Surface, settings: Settings) -> Stage[Surface]:
    before, threads = made.mesh, settings.run.threads
    found = fair(before, settings.run.smooth)
    ring = OneRing.of_edges(before.edges, len(before.vertices), threads)
    mesh, taken_back, crossing = untangle(
        before.moved(found.vertices), before.vertices, ring, CrossingFaces(threads)
    )  # fmt: skip
    smooth = replace(made, mesh=mesh, crossing=crossing)
    _check(smooth)
    moved = np.sqrt(((mesh.vertices - before.vertices) ** 2).sum(axis=1))
    volumes = [float(one.face_volumes.sum()) for one in (before, mesh)]
    told = {
        "moved_mean_mm": float(moved.mean()),
        "moved_p95_mm": float(np.percentile(moved, 95)),
        "moved_max_mm": float(moved.max()),
        "volume_change": None if made.borders else volumes[1] / volumes[0] - 1,
        "taken_back": taken_back,
        "left": found.left,
    }
    left = f"{found.left} of {found.pieces} pieces are thinner than --smooth, and were left as they are"
    if found.left == found.pieces:
        largest = float(np.ptp(before.vertices, axis=0).max())
        left = f"--smooth {settings.run.smooth:g} changes nothing: all is thinner than that, {largest:.3g} long at most"
    return Stage(smooth, {"smooth": told}, (left,) if found.left else ())


def _print(made: Surface, settings: Settings, progress: Progress) -> Stage[Surface]:
    """Make the part to print, where one is asked for; the surface and what is measured of it stay."""
    return _make_part(made, settings, progress) if settings.printing.asked else Stage(made)


@timed("print")
def _make_part(made: Surface, settings: Settings, progress: Progress) -> Stage[Surface]:
    from .printing.part import make_part

    unit = "mm" if made.place is None else made.place.unit
    return Stage(replace(made, part=make_part(made.mesh, settings, unit=unit, progress=progress)))


@timed("print")
def _judge_part(made: Surface) -> Stage[None]:
    """Tell whether the part can be printed."""
    assert made.part is not None
    return Stage(None, {"print": made.part.report})


@timed("quality")
def _measure(made: Surface, settings: Settings, progress: Progress) -> Stage[None]:
    """Measure the mesh, against what it rests on too."""
    places = made.points.positions if made.rests_on is None else made.rests_on
    quality = assess(
        made.mesh, points=places, cavities=made.cavities, crossing=made.crossing, threads=settings.run.threads,
        progress=progress,
    )  # fmt: skip
    crossing = quality["self_intersections"]
    crossed = (f"{crossing} faces pass through others",) if crossing else ()
    measured = Stage(None, {"quality": quality})
    return folded(None, measured, _beside_rings(made, quality["volume_mm3"]), Stage(None, warnings=crossed))


def _beside_rings(made: Surface, volume: float | None) -> Stage[None]:
    """Compare the volume of a mesh with the areas of the rings times the distance of their slices."""
    rings = 0.0 if made.segmentation is None else made.segmentation.sampling.volume_mm3
    if volume is None or rings <= 0:
        return Stage(None)
    over = volume / rings
    off = f"the mesh encloses {over:.0%} of the volume of its rings"
    stats = {"quality": {"rings_volume_mm3": rings, "volume_over_rings": over}}
    return Stage(None, stats, (off,) if abs(over - 1) > PLAUSIBLE else ())
