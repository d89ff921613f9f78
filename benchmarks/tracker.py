"""Find the faces of a cuberille by a scan of all cubes and by tracking from face to face: python benchmarks/tracker.py.

Shapes are spheres, two cubes thick, and random sets in which every other face is a bend. Both ways find the same
faces; the whole step also lists them as squares, and tells surfaces apart. CPU time, the least of three.
"""

from __future__ import annotations

import time
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from bench import at_most, header, holds, note
from tomomesh.cuberille.bitmasks import Blocks
from tomomesh.cuberille.closing import Shell
from tomomesh.cuberille.faces import TRACKERS, exposed_faces
from tomomesh.kernels.cuberille.bitmasks import compose

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

FACES = (10_000, 100_000, 1_000_000, 10_000_000)
ROUNDS = 3


def sphere(faces: int) -> NDArray[np.int64]:
    """Return the cells of a sphere of about so many faces: of a radius r, 6 pi r^2 on either side."""
    radius = np.sqrt(faces / (12 * np.pi))
    line = np.arange(-int(radius) - 2, int(radius) + 3)
    rows = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = []
    for z in line:
        far = np.sqrt((rows**2).sum(axis=1) + z**2)
        near = rows[np.abs(far - radius) <= 1]
        cells.append(np.column_stack([near, np.full(len(near), z)]))
    return np.concatenate(cells)


def riddled(faces: int) -> NDArray[np.int64]:
    """Return the cells of a random half of a box, which have about as many faces as cells once they are composed."""
    wide = round((1.1 * faces) ** (1 / 3))
    return np.argwhere(np.random.default_rng(1).random((wide, wide, wide)) < 0.2)


def composed(cells: NDArray[np.int64]) -> Shell:
    """Return some cells, and those that make them well composed."""
    blocks = Blocks.around(cells, 2)
    solid = blocks.bitmask_of(cells)
    while True:
        filled = solid.copy()
        if not compose(solid, blocks.table, blocks.grown(solid) & ~solid, filled, 0, len(blocks)):
            return Shell(blocks, solid, solid, solid, cells[:0], closing=0, added=0)
        solid = filled


def seconds(work: Callable[[], Any]) -> float:
    """Return the least CPU time of some rounds."""
    times = []
    for _ in range(ROUNDS):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def found(shell: Shell, tracking: str) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
    """Return the faces and vertices as bitmasks."""
    exposed, corners = np.zeros((6, *shell.solid.shape), np.uint64), shell.blocks.empty()
    TRACKERS[tracking](shell.solid, shell.blocks.table, exposed, corners)
    return exposed, corners


def main() -> None:
    """Print a row for each shape and size."""
    header("Faces of a cuberille: scan of all cubes against tracking from face to face")
    for name, shape in (("sphere", sphere), ("riddled", riddled)):
        for faces in FACES:
            shell = composed(shape(faces))
            scanned, tracked = (found(shell, way) for way in TRACKERS)
            count, surfaces = int(np.bitwise_count(scanned[0]).sum()), exposed_faces(shell).count
            what = f"{name}, {count:,} faces, {surfaces:,} surfaces"
            holds(f"{what}: the same", all(map(np.array_equal, scanned, tracked)))
            scan, follow = (seconds(partial(found, shell, way)) for way in TRACKERS)
            note(f"{what}: scan, tracking", f"{1000 * scan:.3g} ms, {1000 * follow:.3g} ms")
            at_most(f"{what}: tracking over scan", follow / scan, 1)
            whole = [seconds(partial(exposed_faces, shell, tracking=way)) for way in TRACKERS]
            note(f"{what}: the whole step, over the scan's", f"{whole[1] / whole[0]:.2f}")


if __name__ == "__main__":
    main()
