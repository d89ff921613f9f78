"""The faces between the voxels of a mask and those outside, without a list of them.

Eight voxels of a row are a word, voxel n its byte n; a mask has a layer outside around it. A block is 4 x 4 x 4 voxels.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Mask = NDArray[np.bool_]
    Floats = NDArray[np.float64]

BYTE, REST, NONE = np.uint64(8), np.uint64(56), np.uint64(0)
"""Bits of a voxel, and of the other seven of a word; no voxel."""


@kernel("i8(u8[:,:,::1], i8, f8[:,::1], b1[:,:,::1], i8, i8)")
def list_sides(words: NDArray[np.uint64], every: int, places: Floats, held: Mask, first: int, found: int) -> int:
    """List some of the faces, by voxel and then by axis, and mark the blocks that have any.

    Parameters
    ----------
    words : (K, J, W) uint64 array
    every : int
        The first of so many is listed, as long as there is room.
    places : (n, 3) float array
        Result: their middles as indices (x, y, z).
    held : (ceil(K / 4), ceil(J / 4), 2 W) bool array
        False on entry. Result: whether a voxel of the block has a face to the next one along an axis.
    first : int
        The layer that is the first of these: that after the last only tells of faces towards it.
    found : int
        Faces of the layers before.

    Returns
    -------
    int
        Number of all faces so far.
    """
    room = len(places)
    for k in range(words.shape[0] - 1):
        for j in range(words.shape[1] - 1):
            for w in range(words.shape[2]):
                here = words[k, j, w]
                beyond = words[k, j, w + 1] << REST if w + 1 < words.shape[2] else NONE
                across_x = here ^ (here >> BYTE | beyond)
                across_y, across_z = here ^ words[k, j + 1, w], here ^ words[k + 1, j, w]
                if across_x | across_y | across_z == NONE:
                    continue
                for n in range(8):
                    shift, i = np.uint64(8 * n), 8 * w + n
                    x, y, z = across_x >> shift & 1, across_y >> shift & 1, across_z >> shift & 1
                    if x | y | z == 0:
                        continue
                    held[k // 4, j // 4, i // 4] = True
                    for axis in range(3):
                        if (x if axis == 0 else y if axis == 1 else z) == 0:
                            continue
                        row = found // every
                        if found % every == 0 and row < room:
                            places[row, 0], places[row, 1], places[row, 2] = i, j, first + k
                            places[row, axis] += 0.5
                        found += 1
    return found


@kernel("f8(b1[:,:,::1], i8, i8, i8, i8, f8, f8, f8, f8)")
def nearest_in_block(
    mask: Mask, first: int, c: int, b: int, a: int, x: float, y: float, z: float, best: float
) -> float:
    """Return the squared distance to the nearest face in a block, or the best so far where that is less."""
    for k in range(4 * c, min(4 * c + 4, mask.shape[0] - 1)):
        for j in range(4 * b, min(4 * b + 4, mask.shape[1] - 1)):
            for i in range(4 * a, min(4 * a + 4, mask.shape[2] - 1)):
                here, dx, dy, dz = mask[k, j, i], x - i, y - j, z - (first + k)
                if here != mask[k, j, i + 1]:
                    best = min(best, (dx - 0.5) ** 2 + dy * dy + dz * dz)
                if here != mask[k, j + 1, i]:
                    best = min(best, dx * dx + (dy - 0.5) ** 2 + dz * dz)
                if here != mask[k + 1, j, i]:
                    best = min(best, dx * dx + dy * dy + (dz - 0.5) ** 2)
    return best


@kernel("f8(f8, i8, i8, i8)")
def beyond_blocks(at: float, low: int, high: int, last: int) -> float:
    """Return how far faces along one axis are at least that lie in none of the blocks from `low` to `high`."""
    far = np.inf
    if low > 0:
        far = min(far, at - 4.0 * low + 0.5)
    if high < last:
        far = min(far, 4.0 * (high + 1) - at)
    return far


@kernel("void(b1[:,:,::1], b1[:,:,::1], i8, f8[:,::1], f8[::1], i8, i8)")
def nearest_sides(mask: Mask, held: Mask, first: int, places: Floats, squared: Floats, start: int, stop: int) -> None:
    """Find the squared distance (n,) of places (n, 3), as indices (x, y, z), to the nearest face.

    The layers are those from `first` on, and the distances on entry those that others have, or infinite. Blocks are
    looked at from the place's own outward, shell by shell, until all others are farther than the best.
    """
    layers, rows, columns = held.shape
    for n in range(start, stop):
        x, y, z = places[n]
        a = int(min(max(np.floor(x / 4.0), 0.0), columns - 1.0))
        b = int(min(max(np.floor(y / 4.0), 0.0), rows - 1.0))
        c = int(min(max(np.floor((z - first) / 4.0), 0.0), layers - 1.0))
        best = squared[n]
        for ring in range(max(layers, rows, columns)):
            a0, a1 = max(a - ring, 0), min(a + ring, columns - 1)
            b0, b1 = max(b - ring, 0), min(b + ring, rows - 1)
            c0, c1 = max(c - ring, 0), min(c + ring, layers - 1)
            for w in range(c0, c1 + 1):
                for v in range(b0, b1 + 1):
                    whole = abs(w - c) == ring or abs(v - b) == ring
                    for u in range(a0, a1 + 1):
                        if (whole or abs(u - a) == ring) and held[w, v, u]:
                            best = nearest_in_block(mask, first, w, v, u, x, y, z, best)
            far = min(
                beyond_blocks(x, a0, a1, columns - 1),
                beyond_blocks(y, b0, b1, rows - 1),
                beyond_blocks(z - first, c0, c1, layers - 1),
            )
            if far == np.inf or (far > 0.0 and best <= far * far):
                break
        squared[n] = best
