"""Objects that the closing of their shell joined: parted where each holds by itself, else told of by their joint."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..kernels.cuberille.cells import label_components
from ..model.cubes import keys_of
from .bitmasks import EDGE
from .closing import DEEP, close_shell
from .neighbors import neighbor_table

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .closing import Shell

LEAST = 0.01
"""Share of the cubes from which those that touch one another may be an object: fewer belong to the nearest one. Chosen:
half and twice of it part the same spheres and boxes, of which the smallest holds a twentieth."""


FEW, BESIDE = 12, 4.0
"""Cubes with points deep inside of the surface that tell of a joint, within how many cubes of one of them: 17 and more
where spheres were joined, at most 9 in 15,000 points of the noisy clouds of docs/clouds.md (measured)."""
MANY = 0.001
"""Share of all cubes that tell of a joint wherever they lie: .2 % and more with strays and noise at once, at most .07 %
in those clouds (measured)."""


def close_apart(joined: Shell, cells: NDArray[np.int64]) -> Shell | None:
    """Close each piece of a shell by itself, as far as the shell.

    Parameters
    ----------
    joined : Shell
    cells : (c, 3) int64 array
        The cubes that hold points, that it was closed from.

    Returns
    -------
    Shell or None
        In the blocks of the joined one; None where its cubes are of one piece, or lie in cavities too.
    """
    if joined.closing == 0 or len(joined.within):
        return None
    pieces = _pieces(cells)
    if not pieces.any():
        return None
    threads = joined.blocks.threads
    each = [close_shell(cells[pieces == n], joined.closing, threads=threads) for n in range(pieces.max() + 1)]
    solid = joined.blocks.united([(one.blocks, one.solid) for one in each], joined.solid)
    witnesses = joined.blocks.united([(one.blocks, one.witnesses) for one in each], joined.witnesses)
    return replace(joined, solid=solid, witnesses=witnesses, added=sum(one.added for one in each))


def joint(shell: Shell, finer: int = 1) -> NDArray[np.int64] | None:
    """Return the cube (3,) around which most points lie deep inside of the surface; None where no joint is told of.

    Of a shell of cubes that are so many times finer, deep is as many times more cubes, and few the square of it.
    """
    buried = shell.buried(DEEP * finer)
    if len(buried) == 0:
        return None
    beside = scipy.spatial.cKDTree(buried).query_ball_point(buried, BESIDE * finer, return_length=True)
    few = beside.max() < FEW * finer**2 and len(buried) < MANY * int(shell.blocks.count(shell.occupied).sum())
    return None if few else np.asarray(buried[beside.argmax()])


def neck(shell: Shell, places: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Return a cube (3,) by which two objects hang together; None where there is none near some cubes (p, 3).

    What cubes part everywhere but at a few falls to more pieces when `DEEP` of them are eroded, within a block's width
    of one of the places.
    """
    _, once = np.unique(places // EDGE, axis=0, return_index=True)
    solid = shell.blocks.cells(shell.solid)
    tree = scipy.spatial.cKDTree(solid)
    for place in places[once]:
        near = solid[tree.query_ball_point(place, EDGE, p=np.inf)] - place + EDGE
        window = np.zeros(3 * (2 * EDGE + 1,), np.bool_)
        window[tuple(near.T)] = True
        eroded = scipy.ndimage.binary_erosion(window, iterations=DEEP, border_value=1)
        if scipy.ndimage.label(eroded)[1] > scipy.ndimage.label(window)[1]:
            return np.asarray(place)
    return None


def _pieces(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the number of the object that each cube may belong to, (c,)."""
    keys = keys_of(cells)
    order = np.argsort(keys, kind="stable")
    labels = np.full(len(keys), -1, np.int32)
    label_components(neighbor_table(keys[order]), np.ones(len(keys), np.bool_), labels)
    sizes = np.bincount(labels)
    large = np.flatnonzero(sizes >= LEAST * len(keys))
    pieces = np.full(len(keys), -1)
    pieces[order] = np.where(np.isin(labels, large), np.searchsorted(large, labels), -1)
    if len(large) < 2:
        return np.zeros(len(keys), np.int64)
    small = pieces < 0
    pieces[small] = pieces[~small][scipy.spatial.cKDTree(cells[~small]).query(cells[small])[1]]
    return pieces
