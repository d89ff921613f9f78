"""What the ways from any points share: the samples of a surface, and the edges of cubes that suit them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import GeometryError
from ...model.columns import box
from ...pointcloud.forecast import require_room_for_points
from ...pointcloud.samples import Samples, settle_points
from ...stage import Stage, timed
from ..sections import unit_in_words

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...progress import Progress
    from ...settings import Settings
    from .points import Points

    Floats = NDArray[np.float64]

FINE, COARSE = 0.95, 1.5
"""Least and greatest edge of the cubes over the sampling distance, but for noise. Chosen: half of the first changes the
distance by -36 %, with four times the faces, twice by +62 %; half of the second by -18 %, twice nothing."""
BENT = 0.08
"""Bend of the samples from which the finest cubes are taken; for less, the sagitta of an edge stays as it is there.
Chosen: half of it changes the distance by -0.5 % where `MANY` is low, twice by +40 %."""
MANY = 250_000
"""Samples up to which the finest cubes are taken in any case: the mesh then has a million faces."""
NOISE = (1.8, 1.3, 1.0)
"""Edges of the cubes over the noise of the points, tried one after the other: small cubes show noise as handles, large
ones fill thin parts. Chosen: half of them changes the distance by +0.2 %, twice by -1.6 %."""
STEPS = 64
"""Steps between numbers that the extent of a cloud must hold: its cubes and the vertices between are smaller yet."""
ACROSS = 4
"""Cubes across an object under which nothing is inside: two sides, which may lie across two cubes each."""
STRAYS = 0.05
"""Share of strays among the points over which a result is warned of. A warning's threshold, chosen: no mesh depends on
it."""


def lowest_corner(points: Points) -> Floats:
    """Return the corner (3,) that the samples of a cloud are counted from."""
    return box(points.places)[0]


@timed("samples")
def settle(points: Points, settings: Settings, progress: Progress) -> Stage[Samples]:
    """Let each point settle on the surface around it; strays are left out. Positions count from the lowest corner."""
    positions = points.places
    _require_digits(positions)
    require_room_for_points(len(positions))
    samples = settle_points(positions - lowest_corner(points), threads=settings.run.threads, progress=progress)
    return _samples_found(points, samples)


def _require_digits(positions: Floats) -> None:
    """Refuse points so far from the origin that numbers beside theirs are as far apart as the points, or as 1 is."""
    step, extent = float(np.spacing(np.abs(positions).max())), float(np.ptp(positions, axis=0).max())
    if step * STEPS > (extent or 1.0):
        raise GeometryError(
            "the points are too far from the origin for their extent",
            found=f"extent = {extent:.4g}, distance = {np.abs(positions).max():.4g}",
            expected=f"an extent of {STEPS} steps of 64-bit numbers there at least", hint="--local-origin",
        )  # fmt: skip


def _samples_found(points: Points, samples: Samples) -> Stage[Samples]:
    """Tell how far apart the points are, how noisy, and how many are strays."""
    count = len(points.places)
    section: dict[str, Any] = {
        "unit": points.place.unit,
        "count": len(points.cloud),
        "interpolated": len(points.between),
        "distinct": len(samples.positions) + samples.strays,
        "strays": samples.strays,
        "spacing_mm": float(np.median(samples.spacing)),
        "spacing_p5_mm": float(np.percentile(samples.spacing, 5)),
        "spacing_p95_mm": float(np.percentile(samples.spacing, 95)),
        "noise_mm": float(np.median(samples.noise)),
        "noise_p95_mm": float(np.percentile(samples.noise, 95)),
    }
    many = samples.strays > STRAYS * count
    warnings = (f"{samples.strays} of {count} points are strays, and were left out",) if many else ()
    return Stage(samples, {"points": section}, warnings)


def cell_edges(samples: Samples, settings: Settings) -> list[Floats]:
    """Return the edges of the cubes along each axis: the sampling distance, or what the noise needs, or as asked."""
    spacing, noise = float(np.median(samples.spacing)), float(np.median(samples.noise))
    most = min(COARSE, FINE * max(1.0, np.sqrt(len(samples.positions) / MANY)))
    fine = float(np.clip(FINE * np.sqrt(BENT / max(samples.bend, 1e-300)), FINE, most))
    own = dict.fromkeys(max(fine * spacing, factor * noise) for factor in NOISE)
    asked = [settings.cubes.cell_mm] if settings.cubes.cell_mm else [(edge,) for edge in own]
    return [np.broadcast_to(np.array(one) * settings.cubes.cell_factor, 3).copy() for one in asked]


def require_parts(samples: Samples, cell: Floats, axes: int) -> None:
    """Refuse cubes that are wider than the points' extent leaves room for: two sides, and a cube inside.

    Parameters
    ----------
    samples : Samples
    cell : (3,) float array
        Edge of the cubes along each axis.
    axes : int
        Along how many axes there must be room: 3 for a solid, 2 for a sheet.

    Raises
    ------
    GeometryError
        Naming the widest edge that could do.
    """
    extents = np.ptp(samples.positions, axis=0)
    across = np.sort(extents / cell)[-axes]
    if 0 < across < ACROSS and cell.min() > ACROSS * float(np.median(samples.spacing)):
        raise too_wide(cell, f"at most {cell.max() * across / ACROSS:.2g}, {ACROSS} of them across the points")


def too_wide(
    cell: Floats, expected: str = "both sides of every part in cubes of their own, and some between them"
) -> GeometryError:
    """Return the error of cubes in whose shell the object has no inside."""
    return GeometryError(
        "the cubes are wider than the parts of the object", found=f"cell = {cell.max():.4g}", expected=expected,
        hint="a smaller --cell, or none: it is found from the points",
    )  # fmt: skip


def points_in_words(report: dict[str, Any]) -> str:
    """Say in the summary how far apart the points of a cloud are, and how noisy."""
    points, unit = report["points"], unit_in_words(report)
    apart = f"{points['spacing_mm']:.4g} {unit} apart, noise {points['noise_mm']:.2g} {unit}"
    return f"{points['count']}, {points['strays'] or 'no'} stray(s) left out, {apart}"
