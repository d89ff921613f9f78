"""Close the gaps of a shell of cubes, and tell whether it keeps the outside out.

Topology comes from a coarser scale than geometry: the cubes are dilated until the outside no longer reaches the
inside, and what was added is taken away again from the outside only (a morphological closing).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ResourceError
from ..kernels.cells import label_components, spread
from ..progress import Progress, silent
from .neighbors import FACE_COLUMNS, column_of, dilate, neighbor_table

if TYPE_CHECKING:
    from numpy.typing import NDArray

WIDEST = 8
"""Largest closing that is tried by itself, cubes."""
MOST_CUBES = 10_000_000
"""Cubes over which no wider closing is tried: their table of neighbors takes a gigabyte."""
LEAKING = 1
"""Closing of a shell that none makes hold, as of a sheet or a thin slab: it fills single holes."""
HELD = 0.5
"""Share of a component's occupied cubes that must be near the inside for the shell to hold."""
NEAR = 2
"""Steps, beyond twice the dilation, from enclosed space within which an occupied cube counts as near it: noise may
make a shell two cubes thick, and a dilation leaves little of what is enclosed."""
SOLID = 0.2
"""Share of a component's cubes that must be surrounded by occupied ones for it to be a solid."""
DEBRIS = 0.01
"""Components with less than this share of the occupied cubes have no say."""

BELOW = column_of((0, 0, -1))


@dataclass(frozen=True)
class Shell:
    """A set of cubes after closing.

    Attributes
    ----------
    keys : (c,) int64 array
        Occupied cubes and those added, rising.
    closing : int
        Cubes by which the shell was dilated and eroded.
    two_sided : float
        Smallest share, over the components, of occupied cubes that are near enclosed space: near 1 where the
        shell holds, near 0 where the outside leaks in and the surface would be two-walled.
    """

    keys: NDArray[np.int64]
    closing: int
    two_sided: float

    @property
    def holds(self) -> bool:
        """Whether the outside stays out."""
        return self.two_sided >= HELD


def close_shell(occupied: NDArray[np.int64], closing: int | None = None, progress: Progress = silent) -> Shell:
    """Close the shell by a given number of cubes, or by the fewest that make it hold.

    Parameters
    ----------
    occupied : (c,) int64 array
        Keys of the cubes that hold points, rising.
    closing : int, optional
    progress : callable

    Returns
    -------
    Shell
        Where no closing up to `WIDEST` holds, closed by `LEAKING`; see `Shell.holds`.
    """
    tried = range(WIDEST + 1) if closing is None else [closing]
    dilated, reached = occupied, 0
    for count, steps in enumerate(tried):
        progress("closing", count, len(tried))
        while reached < steps and len(dilated) <= MOST_CUBES:
            dilated, reached = dilate(dilated, 1), reached + 1
        if len(dilated) > MOST_CUBES:
            break
        band = _Band.around(occupied, dilated, steps)
        share = band.two_sided()
        if share >= HELD or closing is not None:
            progress("closing", count + 1, count + 1)
            return Shell(band.closed(), steps, share)
    progress("closing", len(tried), len(tried))
    if closing is not None:
        raise ResourceError(
            "the closing would take more cubes than fit",
            found=f"--closing = {closing}",
            expected=f"at most {MOST_CUBES} cubes",
            hint="a larger --cell-mm or a smaller --closing",
        )
    band = _Band.around(occupied, dilate(occupied, LEAKING), LEAKING)
    return Shell(band.closed(), LEAKING, band.two_sided())


@dataclass(frozen=True)
class _Band:
    """Dilated cubes with one layer of empty ones around them: all that the test and the erosion look at."""

    keys: NDArray[np.int64]
    table: NDArray[np.int32]
    occupied: NDArray[np.bool_]
    dilated: NDArray[np.bool_]
    outside: NDArray[np.bool_]
    steps: int

    @classmethod
    def around(cls, occupied: NDArray[np.int64], inner: NDArray[np.int64], steps: int) -> _Band:
        keys = dilate(inner, 1)
        table = neighbor_table(keys)
        dilated = np.isin(keys, inner, assume_unique=True)
        return cls(
            keys,
            table,
            np.isin(keys, occupied, assume_unique=True),
            dilated,
            _outer_layer(table, dilated),
            steps,
        )

    def eroded(self) -> NDArray[np.bool_]:
        """Tell which cubes the outside takes back: those it reaches within the dilation, past no occupied cube."""
        depth = np.where(self.outside, 0, -1).astype(np.int32)
        lining = np.append(~self.dilated & ~self.outside, False)[self.table].any(axis=1)
        spread(self.table, self.dilated & ~self.occupied & ~lining, depth, self.steps)
        return depth >= 0

    def closed(self) -> NDArray[np.int64]:
        """Return the keys of the closed shell."""
        return self.keys[self.dilated & ~self.eroded()]

    def two_sided(self) -> float:
        """Return the smallest share, over the components, of occupied cubes that are near enclosed space.

        Only space that the dilation left empty counts: a closing makes small pockets within a wall, too. A
        component counts in full where it is a solid, many of whose cubes are surrounded by others.
        """
        depth = np.where(~self.dilated & ~self.outside, 0, -1).astype(np.int32)
        spread(self.table, self.dilated & ~self.eroded(), depth, 2 * self.steps + NEAR)
        deep = np.asarray(np.append(self.occupied, False)[self.table].all(axis=1))
        labels = np.full(len(self.keys), -1, np.int32)
        label_components(self.table, self.dilated, labels)
        cubes = np.bincount(labels[self.occupied])
        seeing = np.bincount(labels[self.occupied], weights=depth[self.occupied] >= 0)
        solid = np.bincount(labels[self.occupied], weights=deep[self.occupied]) >= SOLID * cubes
        heard = np.asarray(cubes >= min(DEBRIS * cubes.sum(), cubes.max()))
        share = np.asarray(np.maximum(seeing / np.maximum(cubes, 1), solid))
        return float(share[heard].min())


def _outer_layer(table: NDArray[np.int32], dilated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which cubes of the empty layer lie outside.

    The layer falls apart into pieces that are connected over faces, one around each object and one lining each
    cavity. The lowest cube of a cavity has the object right below it; the lowest cube around an object has not.
    """
    labels = np.full(len(dilated), -1, np.int32)
    count = label_components(np.ascontiguousarray(table[:, FACE_COLUMNS]), ~dilated, labels)
    empty = np.flatnonzero(~dilated)
    _, first = np.unique(labels[empty], return_index=True)
    below = table[empty[first], BELOW]
    lining = (below >= 0) & dilated[below]
    return np.append(~lining, False)[labels] if count else np.zeros(len(dilated), bool)
