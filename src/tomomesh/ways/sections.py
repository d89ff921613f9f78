"""Sections of the report that several ways have."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.points import BRIDGE, CAP, NEURON
from ..model.sliced import areas_of
from ..results import Enclosed
from ..stage import Stage, folded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..cuberille.leak_test import LeakTest
    from ..isosurface.voxels import Boundary, VoxelSurface
    from ..model.points import PointSet
    from ..model.sliced import Sliced
    from ..model.trace import Trace
    from ..results import Segmentation
    from ..segmentation.sample import Sampling
    from ..settings import Settings

DRAWN = 0.9
"""Share of the vertices that must have a point near them, else a result is warned of. A warning's threshold, chosen: no
mesh depends on it."""
WIDE = 3
"""Closing over which a result is warned of, cubes. A warning's threshold, chosen: no mesh depends on it. The built-in
head and an MR are closed by one (measured)."""
FILLED = 0.05
"""Share of filled faces over which a result is warned of. A warning's threshold, chosen: no mesh depends on it."""


SMALL = ": the cubes are small for the points"
"""What that may mean, on ways that go by cubes."""
FLAT_SHELL = "the points lie in a plane, on a line or at one place: their shell is smoothed, but not fitted"
LEAKY_SHELL = "the outside leaks into the shell: its surface has two walls, and is smoothed, but not fitted"
"""What is warned of where a shell is written though both its walls would rest on the same points."""


def points_found(points: PointSet, spacing: float, *, unit: str = "mm", bridged: int = 0) -> Stage[None]:
    """Tell how many points there are and how far apart."""
    section = {
        "unit": unit,
        "count": len(points),
        "measured": int((points.kinds == NEURON).sum()),
        "on_bridges": int((points.kinds == BRIDGE).sum()),
        "on_caps": int((points.kinds == CAP).sum()),
        "bridged_gaps": bridged,
        "spacing_mm": spacing,
    }
    return Stage(None, {"points": section})


def missed(slices: NDArray[np.int32], mask: Sliced) -> tuple[list[int], tuple[str, ...]]:
    """Return the slices that have no network, and the warning that some of them should have one."""
    areas = areas_of(mask)
    without = np.setdiff1d(np.arange(len(areas)), slices)
    inside = (without > slices[0]) & (without < slices[-1])
    lost = without[inside | (areas[without] > 0)]
    named = ", ".join(map(str, lost[:8])) + (", ..." if len(lost) > 8 else "")
    warning = f"{len(lost)} slice(s) without pixels enough for a network: {named}"
    return without.tolist(), (warning,) if len(lost) else ()


def shell_found(
    leak_test: LeakTest, taken: NDArray[np.bool_], cell: NDArray[np.float64], cubes: int, bridged: int = 0
) -> Stage[None]:
    """Tell of the cubes, the closing that made them tight, and which surfaces were taken."""
    shell, faces = leak_test.shell, leak_test.faces
    stats: dict[str, dict[str, Any]] = {
        "cubes": {
            "cell_mm": cell.tolist(),
            "occupied": cubes,
            "bridge_places": bridged,
            "closing": shell.closing,
            "added_for_composition": shell.added,
            "two_sided": leak_test.two_sided,
            "tight": leak_test.tight,
        },
        "surface": {
            "found": faces.count,
            "cavities": int((faces.inward & taken).sum()),
            "taken": int(taken.sum()),
            "debris": int(faces.debris.sum()),
            "square_faces": int(faces.sizes[taken].sum()),
            "enclosed_cubes": int(faces.volumes[taken].sum()),
        },
    }
    made_up = f"gaps up to {2 * shell.closing} cubes wide were closed: the surface is made up there"
    return Stage(None, stats, (made_up,) if leak_test.tight and shell.closing > WIDE else ())


def sampling_found(sampling: Sampling) -> Stage[None]:
    """Tell of the points that networks on slices were placed as."""
    return points_found(sampling.points, sampling.spacing_mm, bridged=sampling.bridged)


def networks_on_slices(found: Segmentation[Any]) -> dict[str, Any]:
    """Give the networks of slices to the pictures."""
    return {"networks": found.source}


def hollow(leak_test: LeakTest, taken: NDArray[np.bool_], cubes: int, cell: NDArray[np.float64]) -> Enclosed:
    """Return the volume inside a shell without that of its cubes, which may be two walls with nothing between them."""
    enclosed = int(leak_test.faces.volumes[taken].sum())
    return Enclosed("samples", float(max(0, enclosed - cubes) * cell.prod()))


def count_walls(settings: Settings, *, tight: bool, flat: bool) -> Stage[int] | None:
    """Count the walls of a shell; None for one that leaks, unless that was allowed or the points are flat.

    One of two is not fitted: both walls would rest on the same points, and the mesh would fall flat.
    """
    if tight:
        return walls_found(1)
    if flat:
        return walls_found(2, FLAT_SHELL)
    return walls_found(2, LEAKY_SHELL) if settings.cubes.allow_leaks else None


def walls_found(count: int, *warnings: str) -> Stage[int]:
    """Tell whether a surface has one wall, or two: then it is not fitted."""
    return Stage(count, {"cubes": {"walls": count}}, warnings)


def fit_found(
    trace: Trace | None, vertices: int,
    *, collapsed: int = 0, taken_back: int = 0, filled: NDArray[np.bool_] | None = None,
) -> Stage[None]:  # fmt: skip
    """Tell how a mesh came to rest, what of it was not left as the fit had it, and what was filled."""
    steps = 0 if trace is None else len(trace.speed)
    section: dict[str, Any] = {
        "iterations": steps, "converged": None if trace is None else trace.converged, "collapsed": collapsed,
    }  # fmt: skip
    warnings = []
    if collapsed:
        warnings.append(f"{collapsed} component(s) collapsed in the fit: they are smoothed, but not fitted")
    if trace is not None and steps:
        section |= _course(trace)
        drawn = 1 - trace.unattracted[-1] / max(vertices, 1)
        if drawn < DRAWN:
            warnings.append(f"{1 - drawn:.0%} of the vertices have no point near{'' if filled is not None else SMALL}")
        if not trace.converged:
            warnings.append(f"the mesh had not come to rest after {steps} steps")
    section["taken_back"] = taken_back
    if filled is not None:
        section["filled_faces"] = int(filled.sum())
        if filled.mean() > FILLED:
            warnings.append(f"{filled.mean():.0%} of the faces lie where there are no points: they were filled")
    return Stage(None, {"fit": section}, tuple(warnings))


def _course(trace: Trace) -> dict[str, Any]:
    return {
        "speed": float(trace.speed[-1]),
        "acceleration": float(trace.acceleration[-1]),
        "first_distance_mm": float(trace.distance_mm[0]),
        "last_distance_mm": float(trace.distance_mm[-1]),
        "clamped": int(trace.clamped.sum()),
        "unattracted": int(trace.unattracted[-1]),
    }


def boundary_found(found: Boundary, surface: VoxelSurface, *, labels: bool = False) -> Stage[None]:
    """Tell of the boundary of voxels, and how its net came to rest; a mask is what was asked for where it is `labels`.

    Gray levels that are a mask's are warned of, for there was more to know.
    """
    stepped = found.crossings.stepped
    rest = net_found(surface.net_fit.trace, of_mask=stepped and found.parts == 1 and not labels)
    stats: dict[str, dict[str, Any]] = {
        "voxels": {
            "added_for_composition": found.added,
            "interpolated": not stepped,
            "divided_into": found.parts,
            "split_in_four": len(surface.mesh.vertices) - len(found.net.low),
        },
        "surface": {
            "found": len(found.volumes),
            "cavities": found.cavities,
            "taken": len(found.volumes),
            "debris": 0,
            "square_faces": len(found.net.quads),
            "enclosed_cubes": int(found.volumes.sum()),
        },
    }
    return folded(None, Stage(None, stats), rest)


def net_found(trace: Trace, *, of_mask: bool) -> Stage[None]:
    """Tell how a net came to rest, and of gray levels that are a mask's."""
    steps = len(trace.speed)
    fit: dict[str, Any] = {"iterations": steps, "converged": trace.converged, "collapsed": 0}
    if steps:
        fit |= {"speed": float(trace.speed[-1]), "acceleration": float(trace.acceleration[-1])}
    warnings: tuple[str, ...] = ()
    if of_mask:
        warnings = ("the gray levels are those of a mask: the surface is evened out between the voxels",)
    elif steps and not trace.converged:
        warnings = (f"the mesh had not come to rest after {steps} steps",)
    return Stage(None, {"fit": fit}, warnings)


def unit_in_words(report: dict[str, Any]) -> str:
    """Name the unit of lengths; a cloud may not know its own."""
    unit = report["points"]["unit"]
    return "units" if unit == "unknown" else str(unit)


def body_of_cubes(report: dict[str, Any]) -> list[str]:
    """Say in the summary what cubes a surface was tracked on."""
    cubes = report["cubes"]
    cell = cubes["cell_mm"]
    edge = f"{cell[0]:.4g}" if len(set(cell)) == 1 else " x ".join(f"{side:.4g}" for side in cell)
    told = f"edge {edge} {unit_in_words(report)}, {cubes['occupied']} occupied, closed by {cubes['closing']}"
    told += ", one wall" if cubes["walls"] == 1 else ", TWO walls"
    return [f"cubes     {told}"]


def body_of_voxels(report: dict[str, Any], known: str = "gray levels interpolated") -> list[str]:
    """Say in the summary what voxels a surface was laid around."""
    voxels = report["voxels"]
    places = known if voxels["interpolated"] else "a mask, evened out"
    if voxels["divided_into"] > 1:
        places = f"each of a thick slice divided into {voxels['divided_into']}"
    faces = report["surface"]["square_faces"]
    return [f"voxels    {faces} faces, {places}, {voxels['added_for_composition']} added"]
