"""Loops over the borders between voxels inside and outside, and the levels across them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..compile import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@kernel("void(f8[:,::1], f8[:,::1], f8[::1], f8[::1], b1, f8[::1], i8, i8)")
def leave_window(
    inside: NDArray[np.float64],
    outside: NDArray[np.float64],
    lower: NDArray[np.float64],
    upper: NDArray[np.float64],
    first: bool,
    shares: NDArray[np.float64],
    start: int,
    stop: int,
) -> None:
    """Find the share of the way from voxels inside to those outside where levels leave their layers' windows.

    Parameters
    ----------
    inside, outside : (q, L) float array
        NaN where a level is not known.
    lower, upper : (L,) float array
    first : bool
        Whether the first layer counts that is not in its window any more; else the last of those that were.
    shares : (q,) float array
        Result; infinite where no layer counts, NaN where one is not known.
    start, stop : int
        Ways to work on.
    """
    for f in range(start, stop):
        share = np.inf if first else -np.inf
        for n in range(len(lower)):
            a, b = inside[f, n], outside[f, n]
            level = b if first else a
            counts = not lower[n] < level <= upper[n] if first else lower[n] < level <= upper[n]
            if counts:
                bound = upper[n] if b > upper[n] else lower[n]
                part = (a - bound) / (a - b)
                if np.isnan(part):
                    share = part
                    break
                share = min(share, part) if first else max(share, part)
        shares[f] = share


@kernel("void(i4[:,::1], u1[::1], i8[::1], i8[::1], i8[::1], i8[:,:,::1], b1[:,::1], i8, i8)")
def list_lines(
    inner: NDArray[np.int32],
    directions: NDArray[np.uint8],
    low: NDArray[np.int64],
    held: NDArray[np.int64],
    volume: NDArray[np.int64],
    places: NDArray[np.int64],
    beyond: NDArray[np.bool_],
    start: int,
    stop: int,
) -> None:
    """Find the four voxels in line with each border: the second is inside, the third outside.

    Parameters
    ----------
    inner : (q, 3) int32 array
        The voxel (x, y, z) inside.
    directions : (q,) uint8 array
        From it to the voxel outside.
    low, held : (3,) int64 array
        First voxel (x, y, z) of the part of a volume that is known, and how many it has along each axis.
    volume : (3,) int64 array
        How many the volume has.
    places : (3, q, 4) int64 array
        Result: indices along z, y and x in that part, the nearest that there are.
    beyond : (q, 4) bool array
        Result: whether the place is outside of the volume.
    start, stop : int
        Borders to work on.
    """
    for n in range(start, stop):
        own, step = directions[n] // 2, 2 * (directions[n] & 1) - 1
        for m in range(4):
            for axis in range(3):
                place = inner[n, axis] + (m - 1) * step * int(axis == own)
                if axis == own:
                    beyond[n, m] = place < 0 or place >= volume[axis]
                places[2 - axis, n, m] = min(max(place - low[axis], 0), held[axis] - 1)
