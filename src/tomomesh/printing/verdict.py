"""Whether a mesh can be printed, and why not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..measure.intersections import self_intersections
from ..measure.thickness import SHARE, walls_and_gaps
from ..measure.topology import topology
from ..measure.winding import linings, pieces_of
from ..model.units import length_in_words
from ..progress import Progress, silent
from .flat_base import direction_of

if TYPE_CHECKING:
    from ..measure.thickness import Thickness
    from ..model.mesh import TriMesh
    from ..settings import PrintSettings

STEEP = float(np.sqrt(0.5))
"""Cosine of the angle to the way down over which a face hangs over: 45 degrees, the usual limit of printers without
supports (Thomas 2009)."""
NEAR = 10
"""Widest gap that is looked for, over the thinnest wall that the printer makes. Chosen: wider ones are left out of the
report, and none of them keeps a part from being printed."""
SMALLEST, LARGEST = 5.0, 1000.0
"""Thinnest walls that a part is long at least, and millimeters at most, for a note alone. Chosen: what is smaller has
no inside, and build volumes of usual printers end below a meter."""
ON_PLATE = 1e-6
"""Height over the size of the part up to which it lies on the plate. What 32-bit coordinates keep, 6e-8, with room for
one turn."""


def verdict(mesh: TriMesh, settings: PrintSettings, *, threads: int = 0, progress: Progress = silent) -> dict[str, Any]:
    """Tell whether a mesh can be printed, and measure what decides it.

    Parameters
    ----------
    mesh : TriMesh
        In millimeters; one face at least.
    settings : PrintSettings
        The thinnest wall that the printer makes, and where down is.
    threads : int
        0 is one a core. The result does not depend on it.
    progress : callable

    Returns
    -------
    dict
        See docs/printing.md. Walls, gaps and pieces are measured only where the mesh is closed and manifold.
    """
    lined = linings(mesh)
    found = topology(mesh, cavities=lined)
    crossing = int(self_intersections(mesh, threads=threads).sum())
    told: dict[str, Any] = {"printable": False, "reasons": [], "notes": [], "scale": settings.scale}
    told |= {"sound": found.sound, "self_intersections": crossing, "sealed_cavities": lined}
    told |= _of_shape(mesh, settings.down)
    if not found.sound:
        faults = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in found.faults.items() if count)
        told["reasons"] = [f"it is not closed and manifold: {faults}"]
        return told
    told |= _of_pieces(mesh, settings.down)
    walls, gaps = walls_and_gaps(mesh, near=NEAR * settings.least_wall, threads=threads, progress=progress)
    told |= _of_widths(walls, "wall", settings.least_wall) | _of_widths(gaps, "gap", settings.least_wall)
    narrow = [width for width in (told["thinnest_wall_mm"], told["thinnest_gap_mm"]) if width is not None]
    told["smallest_feature_mm"] = min(narrow, default=None)
    told["reasons"] = _reasons(told, walls, settings.least_wall)
    told["notes"] = _notes(told, settings.least_wall)
    told["printable"] = not told["reasons"]
    return told


def _of_shape(mesh: TriMesh, down: str) -> dict[str, Any]:
    """Measure size, volume, base and overhang of a mesh."""
    way = direction_of(down)
    heights = -(mesh.vertices @ way)
    size = np.ptp(mesh.vertices, axis=0)
    on_plate = (heights <= heights.min() + ON_PLATE * size.max())[mesh.faces].all(axis=1)
    areas = mesh.face_areas
    hangs = (mesh.face_vectors @ way > 2 * STEEP * areas) & ~on_plate
    return {
        "size_mm": size.tolist(),
        "volume_mm3": float(mesh.face_volumes.sum()),
        "base_area_mm2": float(areas[on_plate].sum()),
        "overhang_share": float(areas[hangs].sum() / areas.sum()),
    }


def _of_pieces(mesh: TriMesh, down: str) -> dict[str, int]:
    """Count the pieces of a closed mesh, and those that do not reach the plate."""
    piece, volumes = pieces_of(mesh)
    heights = -(mesh.vertices @ direction_of(down))
    lowest = np.full(len(volumes), np.inf)
    np.minimum.at(lowest, piece, heights[mesh.faces].min(axis=1))
    solid, reach = volumes > 0, ON_PLATE * float(np.ptp(mesh.vertices, axis=0).max())
    floating = solid & (lowest > heights.min() + reach)
    return {"pieces": int(solid.sum()), "floating_pieces": int(floating.sum())}


def _of_widths(found: Thickness, name: str, least: float) -> dict[str, Any]:
    """Sum up walls or gaps; what there is none of is None."""
    width, place = found.least
    common = found.percentile(SHARE)
    return {
        f"thinnest_{name}_mm": width if np.isfinite(width) else None,
        f"thinnest_{name}_at_mm": place.tolist() if np.isfinite(width) else None,
        f"{name}_p1_mm": common if np.isfinite(common) else None,
        f"thin_{name}_share": found.area_below(least) / float(found.areas.sum()),
    }


def _reasons(told: dict[str, Any], walls: Thickness, least: float) -> list[str]:
    """Say what keeps a part from being printed; thin spots smaller than the printer's own wall do not."""
    reasons, longest = [], max(told["size_mm"])
    if longest < least:
        reasons.append(f"{_long(longest)}, it is smaller than the printer's thinnest wall (--scale)")
    if told["floating_pieces"]:
        reasons.append(f"{told['floating_pieces']} of {told['pieces']} pieces float free of the plate (--one-piece)")
    if walls.widest_spot(least) > least**2:
        share = 100 * told["thin_wall_share"]
        thin = f"{share:.3g} % of the surface under {least:g} mm"
        reasons.append(
            f"thinnest wall {_at(told['thinnest_wall_mm'], told['thinnest_wall_at_mm'])}, {thin} (--thicken {least:g})"
        )
    return reasons


def _notes(told: dict[str, Any], least: float) -> list[str]:
    """Say what a printer should know."""
    notes, longest = [], max(told["size_mm"])
    if SMALLEST * least > longest >= least or longest > LARGEST:
        size = "smaller than a printer resolves" if longest < LARGEST else "larger than printers are"
        notes.append(f"{_long(longest)}, it is {size}: --scale, or --units where they are not mm")
    if told["sealed_cavities"]:
        notes.append(
            f"{told['sealed_cavities']} sealed cavity(ies): resin or powder stays inside (--drain, --fill-cavities)"
        )
    if told["thin_gap_share"] > 0:
        gap = _at(told["thinnest_gap_mm"], told["thinnest_gap_at_mm"])
        notes.append(f"narrowest gap {gap} may close")
    if told["self_intersections"]:
        notes.append(f"{told['self_intersections']} faces pass through others")
    if told["base_area_mm2"] == 0:
        notes.append("it has no flat base (--flat-base)")
    return notes


def _long(side: float) -> str:
    return f"{length_in_words(side, digits=3)} long"


def _at(width: float, place: list[float]) -> str:
    """Name a width and its place."""
    return f"{length_in_words(width, digits=3)} at ({', '.join(f'{c:.1f}' for c in place)})"
