"""Holes by which resin or powder leaves a cavity."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import UsageError
from ..measure.winding import pieces_of
from .flat_base import direction_of
from .solids import mesh_of, solid_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh

SIDES = 48
"""Sides of a hole. Its area is (2 pi / 48)^2 / 6 = 0.3 % under the circle's, its narrowest width 0.2 %."""
WIDEST = 0.5
"""Most of the part's width that a hole may take: a wider one would take the shape away. Chosen, for a refusal only."""
INSIDE = 1e-6
"""Height over the size of the part from which the wall below a cavity is looked for. What 32-bit coordinates keep,
6e-8, with room for one turn."""


def drained(mesh: TriMesh, diameter: float, down: str) -> TriMesh:
    """Drill a hole down from the lowest place of every cavity to the next place outside.

    Where the cavity has a floor, the hole is in the midst of it.

    Parameters
    ----------
    mesh : TriMesh
        Closed, 2-manifold and outward, but for the linings of cavities.
    diameter : float
    down : str
        One of `tomomesh.settings.printing.SIDES`.

    Returns
    -------
    TriMesh
        Closed and 2-manifold. The mesh itself where it has no cavity.

    Raises
    ------
    UsageError
        For a hole that is wide for the part.
    """
    from manifold3d import Manifold

    way, solid = direction_of(down), solid_of(mesh)
    sides = np.ptp(mesh.vertices, axis=0)
    size, width = float(sides.max()), float(sides[way == 0].min())
    if diameter > WIDEST * width:
        raise UsageError(
            "the drain is too wide for the part", found=f"--drain = {diameter:g}",
            expected=f"at most {WIDEST * width:.3g} mm, {WIDEST:.0%} of its width",
        )  # fmt: skip
    piece, volumes = pieces_of(mesh)
    holes = []
    for inward in np.flatnonzero(volumes < 0):
        # what lies within a tenth of the hole of the lowest place is its floor
        place = _floor(mesh.corners[piece == inward].mean(axis=1), way, 0.1 * diameter)
        hits = solid.ray_cast(place - INSIDE * size * way, place + size * way)
        holes += _hole(place, way, [hit.distance * (1 + INSIDE) * size for hit in hits], diameter)
    return mesh_of(solid - Manifold.batch_boolean(holes, _add())) if holes else mesh


def _floor(middles: NDArray[np.float64], way: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """Return the middle of the face in the midst of those that lie lowest, given the middles of all (m, 3)."""
    heights = -(middles @ way)
    lowest = middles[heights <= heights.min() + reach]
    away = ((lowest - lowest.mean(axis=0)) ** 2).sum(axis=1)
    return np.asarray(lowest[int(np.argmin(away))])


def _add() -> Any:
    from manifold3d import OpType

    return OpType.Add


def _hole(place: NDArray[np.float64], way: NDArray[np.float64], walls: list[float], diameter: float) -> list[Any]:
    """Return a cylinder from above a place through the wall below it, given where the way crosses walls; or none.

    It goes on by its radius, as the outer side may slope; and no farther than half way to what lies below.
    """
    from manifold3d import Manifold

    if len(walls) < 2:
        return []
    end = walls[1] + 0.5 * diameter
    end = min(end, 0.5 * (walls[1] + walls[2])) if len(walls) > 2 else end
    begin = -0.5 * diameter
    across, beside = np.roll(way, 1), np.roll(way, 2)
    frame = np.column_stack([across, beside, np.cross(across, beside)])
    start = place + (begin if frame[:, 2] @ way > 0 else end) * way
    cylinder = Manifold.cylinder(end - begin, 0.5 * diameter, circular_segments=SIDES)
    return [cylinder.transform(np.column_stack([frame, start]))]
