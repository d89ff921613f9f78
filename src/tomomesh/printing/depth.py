"""How deep inside of a mesh the nodes of a grid lie, known exactly where it matters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..errors import ResourceError
from ..isosurface.voxels import boundary, voxel_surface
from ..measure.fill import fill_mesh
from ..measure.tree import Tree
from ..measure.winding import winding_number
from ..model.columns import box
from ..model.volume import Volume
from ..settings import FitSettings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..model.mesh import TriMesh
    from ..progress import Progress

    Floats = NDArray[np.float64]

STEPS = 3
"""Nodes along the thickness of a wall. Chosen: half of it changes the distance of the inner side by +7.1 %, twice by
-0.9 %, with eight times the nodes."""
COARSEST = 16
"""Nodes along the blocks that are looked at first; they are halved four times. Only speed depends on it."""
LOOKED_AT = 48
"""Nodes along the longest side of a part among which the deepest is sought: known to half their distance."""
FIT = FitSettings()
"""At the default stiffness an inner side is even; with less of it, its vertices swing about the distance asked for."""
MOST_NODES = 100_000_000
"""Nodes over which a grid is refused: it would take some two gigabytes."""


@dataclass(frozen=True)
class Depth:
    """Distances from the nodes of a grid to the nearest face.

    Attributes
    ----------
    low : (3,) float array
        The node of number 0.
    step : float
        Distance of the nodes.
    values : (X, Y, Z) float32 array
        Exact near the distance that was asked for; elsewhere on the right side of it.
    """

    low: Floats
    step: float
    values: NDArray[np.float32]


def depth_near(
    mesh: TriMesh, wall: float, *, threads: int, progress: Progress, stage: str = "hollow", around: float = 0.0,
    steps: float = STEPS,
) -> Depth:  # fmt: skip
    """Measure the distance to a mesh on a grid, exactly where it is near the thickness of a wall.

    Blocks of nodes are halved where the distance of their middle does not tell that all lie on one side. So the work
    follows the area of the surface that is looked for, not the volume. The grid reaches `around` beyond the mesh, with
    `steps` nodes along the wall.

    Raises
    ------
    ResourceError
        Where the grid would be too large; names the thinnest wall that fits.
    """
    lowest, highest = box(mesh.vertices)
    step = wall / steps
    low = lowest - step - around
    shape = np.ceil((highest - lowest + 2 * around) / step / COARSEST + 0.5).astype(np.int64)
    nodes = float(np.prod(shape.astype(np.float64))) * COARSEST**3
    if nodes > MOST_NODES:
        raise ResourceError(
            "so thin a wall takes too fine a grid",
            found=f"--{stage} = {wall:g}",
            expected=f"about {wall * (nodes / MOST_NODES) ** (1 / 3):.3g} or more",
        )
    tree = Tree.of_faces(mesh, threads=threads)
    values = np.zeros(tuple(shape), np.float32)
    kept = np.argwhere(values == 0)
    side, level, levels = COARSEST, 0, COARSEST.bit_length()
    while True:
        middles = low + step * ((kept + 0.5) * side - 0.5)
        found, _ = tree.nearest(middles, threads=threads)
        values[tuple(kept.T)] = found
        level += 1
        progress(stage, level, levels + 1)
        if side == 1:
            return Depth(low, step, values)
        reach = step * (np.sqrt(3) / 2 * (side - 1) + 1)
        kept = kept[np.abs(found - wall) <= reach]
        kept = (2 * kept[:, None] + np.argwhere(np.ones((2, 2, 2)))).reshape(-1, 3)
        values, side = values.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2), side // 2


def deep_inside(depth: Depth, mesh: TriMesh, wall: float, least: float) -> NDArray[np.bool_]:
    """Return the nodes inside of a mesh that are deeper than its wall, but for cavities of less volume than `least`.

    Two neighbors, both farther from the surface than half of their distance, lie on the same side of it. So one node
    tells for all that hang together, by how often the mesh goes around it.
    """
    pieces, count = scipy.ndimage.label(depth.values > wall)
    sizes = np.bincount(pieces.ravel(), minlength=count + 1)
    taken = np.zeros(count + 1, np.bool_)
    boxes = scipy.ndimage.find_objects(pieces)
    for piece in np.flatnonzero(sizes[1:] * depth.step**3 >= least) + 1:
        where = boxes[piece - 1]
        own = np.where(pieces[where] == piece, depth.values[where], -1)
        deepest = np.unravel_index(int(np.argmax(own)), own.shape) + np.array([part.start for part in where])
        taken[piece] = winding_number(mesh, depth.low + depth.step * deepest) > 0.5
    return taken[pieces]


def level_surface(depth: Depth, within: NDArray[np.bool_], level: float, threads: int) -> TriMesh:
    """Return the surface around nodes that lie beyond a level, outward from them, between the nodes by their values."""
    affine = np.diag([depth.step, depth.step, depth.step, 1.0])
    affine[:3, 3] = depth.low
    mask = np.ascontiguousarray(within.transpose(2, 1, 0))
    values = np.ascontiguousarray(depth.values.transpose(2, 1, 0))
    found = boundary(Volume.from_stored(values, affine), mask, lower=level, threads=threads)
    return voxel_surface(found, FIT, threads=threads).mesh


def deepest(mesh: TriMesh, threads: int) -> float:
    """Return about how far the place deepest inside of a mesh is from its faces, among `LOOKED_AT` a side."""
    lowest, highest = box(mesh.vertices)
    step = float((highest - lowest).max()) / LOOKED_AT
    affine = np.diag([step, step, step, 1.0])
    affine[:3, 3] = lowest + 0.5 * step
    shape = np.maximum(np.ceil((highest - lowest) / step), 1).astype(np.int64)
    grid = Volume.from_stored(np.zeros(tuple(shape), np.uint8), affine)
    inside = grid.to_mm(np.argwhere(fill_mesh(mesh, grid))[:, ::-1].astype(np.float64))
    return float(Tree.of_faces(mesh, threads=threads).nearest(inside, threads=threads)[0].max(initial=0.0))
